//! `curvelax figure`: the paper's figures and their data.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;

use super::{note, print};
use crate::{
    draw::plot::short,
    ensemble::{Ended, Spec},
    error::Result,
    figures::{FIGURES, Figure, OMEGA, POINTS},
    files::{OutputFolder, Owner, tables::SnapshotTable},
    report::progress::Progress,
};

const EXAMPLES: &str = "\
Examples:
  curvelax figure fig1a --out figures
  curvelax figure fig1a fig1b fig1c fig2 --out figures

Writes DIR/NAME.svg and DIR/NAME.csv, with the columns of snapshots.csv. It takes a few seconds on the CPU.";

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
    /// Print no progress, notes or table: only errors
    #[arg(long)]
    quiet: bool,
}

/// Runs the command.
pub fn figure(args: FigureArgs) -> Result<()> {
    // In the paper's order, each once.
    let chosen = FIGURES.iter().filter(|figure| args.names.iter().any(|name| name == figure.name));
    let chosen: Vec<(&Figure, Spec)> = chosen.map(|figure| Ok((figure, figure.spec()?))).collect::<Result<_>>()?;
    let names: Vec<[String; 2]> = chosen.iter().map(|(figure, _)| files(figure)).collect();
    let folder = OutputFolder::open_for(&args.out, args.force, Owner::Figure, names.concat())?;
    if !args.quiet {
        note(SOLVED_DIRECTLY);
    }
    let (mut parts, mut made) = (Vec::new(), Vec::new());
    for ((figure, spec), [picture, data]) in chosen.iter().zip(&names) {
        let ended = figure.simulate(spec, Progress::new(args.quiet))?;
        let mut rows = SnapshotTable::new(folder.file(data)?)?;
        ended.rows.snapshots.iter().try_for_each(|snapshot| rows.snapshot(snapshot))?;
        parts.push(rows.ready()?);
        parts.push(folder.write(picture, figure.plot(&ended).draw())?);
        made.push((*figure, ended));
        if !args.quiet {
            note(&format!("note: {}: {}", figure.name, figure.remark));
        }
    }
    folder.publish_all(parts)?;
    if args.quiet {
        return Ok(());
    }
    print(&format!("{}\nresults  {}: {}\n", table(&made), args.out.display(), names.concat().join(", ")))
}

const SOLVED_DIRECTLY: &str = "note: solved directly where the paper sweeps (Gauss-Seidel): the same systems, and the \
                               solution that sweeps converge to";

/// Picture and data of a figure.
fn files(figure: &Figure) -> [String; 2] {
    ["svg", "csv"].map(|extension| format!("{}.{extension}", figure.name))
}

/// The table: each figure's run and its last curve.
fn table(made: &[(&Figure, Ended)]) -> String {
    let mut text = format!(
        "{:<8}{:<13}{:<19}{:>5}{:>7}{:>7}{:>8}{:>7}{:>9}{:>9}{:>10}{:>8}  shown at t\n",
        "figure", "curve", "flow", "n", "tau", "omega", "steps", "t", "length", "area", "excess", "drift"
    );
    for (figure, Ended { outcome, .. }) in made {
        let Figure { name, shape, flow, tau, times, redistribution, .. } = figure;
        let (steps, t, end) = (outcome.steps, short(outcome.t_end), &outcome.end);
        let omega = if *redistribution { short(OMEGA) } else { "none".into() };
        let times = times.iter().map(|t| short(*t)).collect::<Vec<_>>().join(", ");
        let run = format!("{name:<8}{shape:<13}{flow:<19}{POINTS:>5}{:>7}{omega:>7}{steps:>8}", short(*tau));
        let [length, area, excess, drift] = [end.length, end.area, end.excess, end.metric_drift];
        text += &format!("{run}{t:>7}{length:>9.5}{area:>9.5}{excess:>10.2e}{drift:>8.4}  {times}\n");
    }
    text
}
