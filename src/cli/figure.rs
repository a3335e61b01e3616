//! `curvelax figure`: the paper's figures and their data.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;

use super::{note, paper::PaperFlags, print};
use crate::{
    ensemble::{Ended, Spec},
    error::Result,
    figures::{FIGURES, Figure, OMEGA, POINTS},
    files::{
        OutputFolder, Owner,
        tables::{NodeRow, Table},
    },
    report::progress::Progress,
    text::number,
};

const EXAMPLES: &str = "\
Examples:
  curvelax figure fig1a --out figures
  curvelax figure fig1a fig1b fig1c fig2 --out figures
  curvelax figure fig2 --out figures --format pdf --width page

Writes DIR/NAME.svg (or .png and .pdf, by --format) and DIR/NAME.csv, with the columns of snapshots.csv. It takes a few seconds on the CPU.";

/// Draw the paper's figures and write their data.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct FigureArgs {
    /// Figures to draw
    #[arg(value_name = "NAME", required = true, value_parser = PossibleValuesParser::new(FIGURES.map(|f| f.name)))]
    names: Vec<String>,
    /// Folder for the files, which must not exist yet
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Write into an existing DIR, replacing the files of these figures
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    paper: PaperFlags,
    /// Print no progress, notes or table: only errors
    #[arg(long)]
    quiet: bool,
}

/// Runs the command.
pub fn figure(args: FigureArgs) -> Result<()> {
    let mut prints = args.paper.prints()?;
    // In the paper's order, each once.
    let chosen = FIGURES.iter().filter(|figure| args.names.iter().any(|name| name == figure.name));
    let chosen: Vec<(&Figure, Spec)> = chosen.map(|figure| Ok((figure, figure.spec()?))).collect::<Result<_>>()?;
    let files = |figure: &'static Figure| prints.extensions().chain(["csv"]).map(|of| file(figure, of));
    let names: Vec<String> = chosen.iter().flat_map(|(figure, _)| files(figure)).collect();
    let folder = OutputFolder::open_for(&args.out, args.force, Owner::Figure, names.clone())?;
    if !args.quiet {
        note(SOLVED_DIRECTLY);
    }
    let (mut parts, mut made) = (Vec::new(), Vec::new());
    for (figure, spec) in &chosen {
        let ended = figure.simulate(spec, Progress::new(args.quiet))?;
        let rows: Vec<NodeRow> = ended.rows.snapshots.iter().flat_map(NodeRow::of).collect();
        parts.push(Table::of(folder.file(&file(figure, "csv"))?, &rows)?);
        let plot = figure.plot(&ended);
        parts.extend(prints.write(&folder, |of| file(figure, of), &plot.title, |medium| plot.draw(medium))?);
        made.push((*figure, ended));
        if !args.quiet {
            note(&format!("note: {}: {}", figure.name, figure.remark));
        }
    }
    folder.publish_all(parts)?;
    if args.quiet {
        return Ok(());
    }
    prints.note_missing();
    print(&format!("{}\nresults  {}: {}\n", table(&made), args.out.display(), names.join(", ")))
}

const SOLVED_DIRECTLY: &str = "note: solved directly where the paper sweeps (Gauss-Seidel): the same systems, and the \
                               solution that sweeps converge to";

fn file(figure: &Figure, extension: &str) -> String {
    format!("{}.{extension}", figure.name)
}

/// The table: each figure's run and its last curve.
fn table(made: &[(&Figure, Ended)]) -> String {
    let mut text = format!(
        "{:<8}{:<13}{:<19}{:>5}{:>7}{:>7}{:>8}{:>7}{:>9}{:>9}{:>10}{:>8}  shown at t\n",
        "figure", "curve", "flow", "n", "tau", "omega", "steps", "t", "length", "area", "excess", "drift"
    );
    for (figure, Ended { outcome, .. }) in made {
        let Figure { name, shape, flow, tau, times, redistribution, .. } = figure;
        let (steps, t, end) = (outcome.steps, number(outcome.t_end), &outcome.end);
        let omega = if *redistribution { number(OMEGA) } else { "none".into() };
        let times = times.iter().map(|t| number(*t)).collect::<Vec<_>>().join(", ");
        let run = format!("{name:<8}{shape:<13}{flow:<19}{POINTS:>5}{:>7}{omega:>7}{steps:>8}", number(*tau));
        let [length, area, excess, drift] = [end.length, end.area, end.excess, end.metric_drift];
        text += &format!("{run}{t:>7}{length:>9.5}{area:>9.5}{excess:>10.2e}{drift:>8.4}  {times}\n");
    }
    text
}
