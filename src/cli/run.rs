//! `curvelax run`: arguments → spec → members → files.

use std::{ops::Range, path::PathBuf, time::Duration};

use super::{dry_run, flags, note, print, to_json};
use crate::{
    backend,
    ensemble::{Cell, Spec, study},
    error::{Error, Result},
    estimate::Estimate,
    report::{Form, OutputFolder, Report, folder, gallery::MOST_PANELS, text::plural},
    simulate::simulate,
};

const EXAMPLES: &str = "\
Examples:
  curvelax run --out ellipses
      256 perturbed 2:1 ellipses under surface diffusion, with the paper's n, τ and ω
  curvelax run --flow willmore --curves 10000 --stop-when-relaxed --out willmore
  curvelax run --adaptive --pull auto --relax-at 0.01 --shape file:island.csv --out island
      relaxation times of an outline, with steps of the right length
  curvelax run --curves 8 --tau 1e-4 --print-spec > spec.toml
  curvelax run spec.toml --seed 2 --out second
  curvelax run spec.toml --dry-run

The keys of SPEC.toml are the names of the flags; a flag wins over the file.";

/// Simulate one ensemble.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct RunArgs {
    /// Spec file; what it does not set takes its default
    #[arg(value_name = "SPEC.toml")]
    spec: Option<PathBuf>,
    #[command(flatten)]
    flags: flags::SpecFlags,
    /// Folder for the results, which must not exist yet
    #[arg(long, value_name = "DIR", required_unless_present_any = ["print_spec", "dry_run"], help_heading = flags::OUTPUT)]
    out: Option<PathBuf>,
    /// Write into an existing DIR, replacing the files of an earlier run
    #[arg(long, help_heading = flags::OUTPUT)]
    force: bool,
    /// No progress, no notes, no table: only errors, and what --json asks for
    #[arg(long, help_heading = flags::OUTPUT)]
    quiet: bool,
    /// Print the results as one JSON document instead of the table
    #[arg(long, conflicts_with = "print_spec", help_heading = flags::OUTPUT)]
    json: bool,
    /// Exit code 3 if a member ends neither relaxed nor unfinished
    #[arg(long, help_heading = flags::OUTPUT)]
    strict: bool,
    /// Stop after this time, such as 90, 90s, 5m or 1h30m, with exit code 75; the rows of the members that ended are kept
    #[arg(long, value_name = "DURATION", value_parser = flags::duration, allow_hyphen_values = true, help_heading = flags::OUTPUT)]
    max_time: Option<Duration>,
    /// Print what the run will take, from a pilot of about two seconds, and stop: memory, steps, time
    #[arg(long, conflicts_with = "print_spec", help_heading = flags::OUTPUT)]
    dry_run: bool,
    /// Print the resolved spec and stop
    #[arg(long, help_heading = flags::OUTPUT)]
    print_spec: bool,
}

/// Runs the command.
pub fn run(args: RunArgs) -> Result<()> {
    let mut spec = resolve(args.spec, args.flags)?;
    let mut cells = study::cells(&spec)?;
    let companies = study::companies(&cells);
    let choices = companies
        .iter()
        .map(|range| {
            let company = &mut cells[range.clone()];
            let choice = backend::choose(&company[0].spec, company[0].spec.points)?;
            company.iter_mut().for_each(|cell| choice.settle(&mut cell.spec));
            Ok(choice)
        })
        .collect::<Result<Vec<_>>>()?;
    if spec.sweep.is_empty() {
        spec = Spec { only: spec.only, ..cells[0].spec.clone() };
    } else {
        choices[0].settle_place(&mut spec);
    }
    if args.print_spec {
        return print(&spec.to_toml()?);
    }
    if args.dry_run {
        let estimate = Estimate::new(&mut cells, companies, choices)?;
        return match (args.json, args.quiet) {
            (true, _) => print(&to_json(&estimate)?),
            (false, false) => print(&dry_run::table(&estimate, &cells[0].spec)),
            (false, true) => Ok(()),
        };
    }
    let out = args.out.ok_or_else(|| Error::Request("--out DIR: a run needs a folder for its results".into()))?;
    let say = |line: &str| {
        if !args.quiet {
            note(line)
        }
    };
    let folder = OutputFolder::open(&out, args.force)?;
    let early = warnings(&cells);
    early.iter().for_each(|warning| say(&format!("warning: {warning}")));
    let mut report = Report::begin(folder, &spec, cells[0].spec.points, args.quiet)?;
    if let Some(most) = args.max_time {
        report.stop_after(most);
    }
    let rows = report.kept_rows();
    let form = if args.json { Form::Json } else { Form::Overview };
    let done = advance(&cells, companies, choices, &mut report, &say).and_then(|platform| {
        let (late, failed) = (report.warnings(), report.failed());
        let warnings = [&early[..], &late].concat();
        Ok((report.finish(&spec, &platform, &warnings, form)?, late, failed))
    });
    if done.is_err() && rows.exists() {
        note(&format!("note: the members that ended are kept in {}", rows.display()));
    }
    let (text, late, failed) = done?;
    late.iter().for_each(|warning| say(&format!("warning: {warning}")));
    if args.json || !args.quiet {
        print(&text)?;
    }
    match failed {
        1.. if args.strict => Err(Error::Strict(format!(
            "--strict: {failed} of {} {} ended neither relaxed nor unfinished; see `status` in {}",
            spec.member_count(),
            plural(spec.member_count(), "member"),
            out.join(folder::SUMMARY).display()
        ))),
        _ => Ok(()),
    }
}

/// Runs one company of cells after another; returns where the first one ran.
fn advance(
    cells: &[Cell],
    companies: Vec<Range<usize>>,
    choices: Vec<backend::Choice>,
    report: &mut Report,
    say: &dyn Fn(&str),
) -> Result<backend::Platform> {
    let mut first = None;
    for (range, choice) in companies.into_iter().zip(choices) {
        let company = &cells[range];
        let precision = choice.precision();
        say(&choice.sentence(&company[0].spec));
        let curves = company.iter().map(|cell| cell.spec.member_count()).sum();
        let whole = Spec { curves, only: None, ..company[0].spec.clone() };
        let (mut backend, platform) = choice.open(&whole, whole.points)?;
        first.get_or_insert(platform);
        let portraits = (MOST_PANELS * company.len()).div_ceil(cells.len());
        report.next_company();
        simulate(company, precision, backend.as_mut(), portraits, report)?;
    }
    first.ok_or_else(|| Error::Failed("a study has no cell".into()))
}

/// What the user should know about the curves of all cells, each sentence once.
fn warnings(cells: &[Cell]) -> Vec<String> {
    let mut all: Vec<String> = cells.iter().flat_map(|cell| cell.family.warnings().iter().cloned()).collect();
    all.sort();
    all.dedup();
    all
}

/// The spec file, overlaid with the flags, checked.
fn resolve(file: Option<PathBuf>, flags: flags::SpecFlags) -> Result<Spec> {
    let mut spec = file.map_or_else(|| Ok(Spec::default()), |path| Spec::read(&path))?;
    flags.overlay(&mut spec);
    spec.validate()
}
