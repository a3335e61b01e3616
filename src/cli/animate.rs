//! `curvelax animate`: a movie of the first members of a finished run, from its portraits.

use std::path::{Path, PathBuf};

use super::{check_range, print};
use crate::{
    error::{Error, Result},
    files::{OutputFolder, Owner, names, reader},
    report::{
        gallery::MAX_PANELS,
        movie::{HOLD, MAX_SECONDS, Movie, MovieOptions, SECONDS, WIDTH, WIDTHS},
    },
    text::{bytes, count, number},
};

const EXAMPLES: &str = "\
Examples:
  curvelax animate ellipses
  curvelax animate ellipses --out movie.svg
  curvelax animate ellipses --out three.gif --members 3 --seconds 10 --width 600

Members stand side by side, to one scale, with their start in grey. Between the times of plots/portraits.json their nodes
move on straight lines. Physical time advances slowly at first and faster later, so that the motion looks even.
The same folder gives the same bytes on every machine.";

/// Make a movie of the first members of a finished run.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct AnimateArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    run: PathBuf,
    /// File for the movie, .gif or .svg, which must not exist yet [default: movie.gif in the folder of the run]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Seconds from the first state to the last, which stays for another second
    #[arg(long, value_name = "S", default_value_t = SECONDS)]
    seconds: f64,
    /// Width of the picture in pixels
    #[arg(long, value_name = "PX", default_value_t = WIDTH)]
    width: u32,
    /// Members shown at most: the first ones, or some of all cells of a sweep
    #[arg(long, value_name = "K", default_value_t = MAX_PANELS)]
    members: usize,
    /// Replace an existing --out FILE
    #[arg(long)]
    force: bool,
    /// Print nothing: only errors
    #[arg(long)]
    quiet: bool,
}

/// The formats of a movie, by the extension of its file.
#[derive(Clone, Copy)]
enum MovieFormat {
    Gif,
    Svg,
}

impl MovieFormat {
    /// The format of the file at `path`.
    ///
    /// # Errors
    /// [`Error::Request`] for another extension than `.gif` or `.svg`.
    fn of(path: &Path) -> Result<MovieFormat> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("gif") => Ok(MovieFormat::Gif),
            Some("svg") => Ok(MovieFormat::Svg),
            Some(_) => Err(Error::value("out", path.display(), "unknown extension", "write .gif or .svg")),
            None => Err(Error::value("out", path.display(), "no extension", "write .gif or .svg")),
        }
    }
}

/// Runs the command.
pub fn animate(args: AnimateArgs) -> Result<()> {
    let cut = cut(&args)?;
    let path = args.out.clone().unwrap_or_else(|| args.run.join(names::MOVIE));
    let format = MovieFormat::of(&path)?;
    // Before a folder is opened, which would create a missing one.
    let provenance = reader::provenance(&args.run)?;
    let spec = &provenance.spec;
    let films = reader::films(&args.run)?;
    let cannot = |problem: &str| {
        let place = args.run.join(names::PORTRAITS);
        Err(Error::Request(format!("{}: {problem}", place.display())))
    };
    if films.is_empty() {
        return cannot("no members to show: the run could not save them, or the file was removed; run again");
    }
    // Only they are not in the portraits.
    let tally = spec.refine.then(|| reader::tally(&args.run, &provenance)).transpose()?;
    let limit = |member| tally.as_ref().and_then(|tally| tally.named(member)?.t_limit);
    let Some(movie) = Movie::new(&films, spec, &cut, limit) else {
        return cannot("no member has a state that can be drawn; see `status` in summary.csv");
    };
    let (folder, name) = open(&path, args.out.is_none() || args.force)?;
    let (content, frames) = match format {
        MovieFormat::Gif => movie.gif().map(|(bytes, frames)| (bytes, format!("{frames} frames, ")))?,
        MovieFormat::Svg => (movie.svg().into_bytes(), String::new()),
    };
    folder.publish_all(vec![folder.write(&name, &content)?])?;
    if args.quiet {
        return Ok(());
    }
    let shown = count(movie.members() as u64, "member");
    let (seconds, size) = (number(cut.seconds + HOLD), bytes(content.len() as u64));
    print(&format!("results    {}: {shown}, {seconds} s, {frames}{size}\n", path.display()))
}

/// Checks the numbers.
fn cut(args: &AnimateArgs) -> Result<MovieOptions> {
    let AnimateArgs { seconds, width, members, .. } = *args;
    check_range("seconds", seconds, MAX_SECONDS, "")?;
    check_range("width", width, WIDTHS, " pixels")?;
    check_range("members", members, [1, MAX_PANELS], "")?;
    Ok(MovieOptions { seconds, width, members })
}

/// Opens the folder of `path`, and makes it if there is none; returns it and the name of the file. An existing file is
/// refused, unless it may be `replaced`.
fn open(path: &Path, replaced: bool) -> Result<(OutputFolder, String)> {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return Err(Error::value("out", path.display(), "not a name of a file in UTF-8", "use another name"));
    };
    if !replaced && path.symlink_metadata().is_ok() {
        let remedy = "name another file, or add --force to replace it";
        return Err(Error::value("out", path.display(), "already exists", remedy));
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    Ok((OutputFolder::open_for(folder, true, Owner::Movie, vec![name.into()])?, name.into()))
}
