//! `curvelax merge`: shards → the files that one run of all members would have written.

use std::{
    io,
    path::{Path, PathBuf},
};

use super::{flags, parsers, print, report_flags::check_name};
use crate::{
    error::{Error, Result},
    files::{OutputFolder, names, state::shard},
    report::{
        ResultFormat,
        merge::{Shards, listed_ranges},
    },
    text::{plural, quoted},
};

const EXAMPLES: &str = "\
Examples:
  curvelax merge shards/* --out study
  curvelax merge shards/* --missing
      shards that are not finished, and the command that submits them to Slurm again

The files are those that one run without --shard would have written, byte for byte except the times and the
number of threads in run.json. Shards that are missing, unfinished, duplicated or modified are rejected by name, and so are
those of another spec, seed, version or back end.";

/// Join the shards of a study.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct MergeArgs {
    /// Folders of the shards, in any order
    #[arg(value_name = "DIR", required = true)]
    shards: Vec<PathBuf>,
    /// Folder for the results, which must not exist yet
    #[arg(long, value_name = "DIR", required_unless_present = "missing", help_heading = flags::OUTPUT)]
    out: Option<PathBuf>,
    /// Write into an existing --out DIR, replacing the earlier run in it. A folder that holds anything else is refused
    #[arg(long, help_heading = flags::OUTPUT)]
    force: bool,
    /// Print the missing shards and the command that submits them to Slurm, and stop
    #[arg(long, conflicts_with_all = ["out", "force", "json"], help_heading = flags::OUTPUT)]
    missing: bool,
    /// The job script in that command
    #[arg(long, value_name = "FILE", default_value = "array.sh", requires = "missing", help_heading = flags::OUTPUT)]
    script: PathBuf,
    /// Print no table: only errors, and the results if --json is given
    #[arg(long, conflicts_with = "missing", help_heading = flags::OUTPUT)]
    quiet: bool,
    /// Print the results as one JSON document instead of the table
    #[arg(long, help_heading = flags::OUTPUT)]
    json: bool,
}

/// Runs the command.
pub fn merge(args: MergeArgs) -> Result<()> {
    let found = args.shards.iter().map(|path| shard::look(path)).collect::<Result<Vec<_>>>()?;
    let shards = Shards::new(found)?;
    if args.missing {
        return print(&missing(&shards, &args.script));
    }
    shards.check_complete()?;
    let out = args.out.ok_or_else(|| Error::Request("--out DIR: the results need a folder".into()))?;
    check_name(args.json, &out)?;
    check_place(&out, &args.shards)?;
    let folder = OutputFolder::open(&out, args.force)?;
    let form = if args.json { ResultFormat::Json } else { ResultFormat::Overview };
    let (text, verdict) = shards.merge(&folder, form)?;
    if args.json || !args.quiet {
        print(&text)?;
    }
    verdict.check(false, &out.join(names::SUMMARY))
}

/// Which shards are missing, and how to submit them.
fn missing(shards: &Shards, script: &Path) -> String {
    let (missing, count) = (shards.missing(), shards.count);
    if missing.is_empty() {
        return format!("all {count} {} are present\n", plural(count, "shard"));
    }
    let array = listed_ranges(&missing);
    let submit = format!("sbatch --array={array} --export=ALL,{}={count} {}", parsers::SHARDS, quoted(script));
    shards.in_words().into_iter().chain([submit]).map(|line| line + "\n").collect()
}

/// Refuses to write the results into a shard, whose files they would replace.
fn check_place(out: &Path, shards: &[PathBuf]) -> Result<()> {
    let cannot = |e: io::Error| Error::Request(format!("--out {}: cannot be found ({e})", out.display()));
    let out_is = place(out).map_err(cannot)?;
    for shard in shards {
        if out_is.starts_with(place(shard).map_err(cannot)?) {
            let problem = format!("it is inside the shard {}", shard.display());
            return Err(Error::value("out", out.display(), &problem, "use a folder outside the shards"));
        }
    }
    Ok(())
}

/// The path at which `path` is or would be, with links resolved.
fn place(path: &Path) -> io::Result<PathBuf> {
    match path.canonicalize() {
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            let name = path.file_name().ok_or(e)?;
            let above = path.parent().filter(|above| !above.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Ok(place(above)?.join(name))
        }
        found => found,
    }
}
