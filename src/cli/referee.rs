//! `curvelax convergence --referee`: relaxation times of the scheme beside those of an independent solver.

use super::{note, parsers, print};
use crate::{
    curve::{Modes, Perturbation, Shape},
    ensemble::{
        Drawn, Spec,
        request::spec::{OrAuto, PositionForm},
    },
    error::{Error, Result},
    files::{OutputFolder, names, tables::Table, truth_tables::TruthRow},
    flow::Flow,
    text::significant,
    truth::{RefereeRow, limits, one_curve},
};

/// What the referee judges: the keys of a run on which its members and their times depend.
#[derive(clap::Args)]
pub struct RefereeFlags {
    /// Instead, compare relaxation times with those of an independent spectral solver, for a smooth shape
    #[arg(long, conflicts_with_all = ["problem", "work_precision"], help_heading = REFEREE)]
    pub referee: bool,
    /// Compare the limits of so many members of an ensemble, as `curvelax run --accurate` makes them, instead of one
    /// curve at several n
    #[arg(long, value_name = "COUNT", value_parser = parsers::whole::<u64>, requires = "referee", help_heading = REFEREE)]
    pub curves: Option<u64>,
    /// Only these members [default: all]
    #[arg(long, value_name = "J1,J2,...", value_delimiter = ',', value_parser = parsers::whole::<u64>, requires = "curves", help_heading = REFEREE)]
    only: Option<Vec<u64>>,
    /// Curve, as for `curvelax run` [default: ellipse:2,1]
    #[arg(long, value_name = "SHAPE", value_parser = parsers::text_of::<Drawn<Shape>>, requires = "referee", help_heading = REFEREE)]
    shape: Option<Drawn<Shape>>,
    /// Flow, as for `curvelax run` [default: surface-diffusion]
    #[arg(long, value_name = "FLOW", value_parser = parsers::text_of::<Drawn<Flow>>, requires = "referee", help_heading = REFEREE)]
    flow: Option<Drawn<Flow>>,
    /// Nodes at which limits are found [default: 100]
    #[arg(long, value_name = "N", value_parser = parsers::whole::<usize>, requires = "referee", help_heading = REFEREE)]
    points: Option<usize>,
    /// Size σ of the random perturbation [default: 0, with --curves 0.05]
    #[arg(long, value_name = "SIGMA", value_parser = parsers::text_of::<Drawn<f64>>, requires = "referee", help_heading = REFEREE)]
    amplitude: Option<Drawn<f64>>,
    /// Its modes [default: 2..=8]
    #[arg(long, value_name = "LO..=HI", value_parser = parsers::text_of::<Modes>, requires = "referee", help_heading = REFEREE)]
    modes: Option<Modes>,
    /// Its power p: mode m has standard deviation σ m^-p [default: 1]
    #[arg(long, value_name = "P", value_parser = parsers::text_of::<Drawn<f64>>, requires = "referee", allow_hyphen_values = true, help_heading = REFEREE)]
    decay: Option<Drawn<f64>>,
    /// Its distribution [default: amplitude-phase]
    #[arg(long, value_name = "HOW", value_parser = parsers::word::<Perturbation>(), requires = "referee", help_heading = REFEREE)]
    perturbation: Option<Perturbation>,
    /// Its seed [default: 1]
    #[arg(long, value_name = "SEED", value_parser = parsers::whole::<u64>, requires = "referee", help_heading = REFEREE)]
    seed: Option<u64>,
    /// Fraction of the initial excess at which a member is relaxed [default: 0.01]
    #[arg(long, value_name = "FRACTION", value_parser = parsers::real, requires = "referee", conflicts_with = "relax_at", help_heading = REFEREE)]
    relax_to: Option<f64>,
    /// Excess at which it is, instead [default: off]
    #[arg(long, value_name = "EXCESS", value_parser = parsers::real, requires = "referee", help_heading = REFEREE)]
    relax_at: Option<f64>,
    /// What moves the nodes, as for `curvelax run` [default: as with --accurate]
    #[arg(long, value_name = "FORM", value_parser = parsers::word::<PositionForm>(), requires = "referee", help_heading = REFEREE)]
    form: Option<PositionForm>,
    /// Rate κ of the pull, as for `curvelax run` [default: auto]
    #[arg(long, value_name = "KAPPA", value_parser = parsers::text_of::<OrAuto>, requires = "referee", allow_hyphen_values = true, help_heading = REFEREE)]
    pull: Option<OrAuto>,
}

const REFEREE: &str = "Referee";

impl RefereeFlags {
    /// The spec of the members: what `curvelax run --accurate` makes of these flags.
    pub fn spec(self, method: Spec) -> Spec {
        let amplitude = if self.curves.is_some() { method.amplitude.clone() } else { 0.0.into() };
        let mut spec = Spec {
            curves: self.curves.unwrap_or(1),
            only: self.only,
            shape: self.shape.unwrap_or(method.shape.clone()),
            flow: self.flow.unwrap_or(method.flow.clone()),
            points: self.points.unwrap_or(method.points),
            amplitude: self.amplitude.unwrap_or(amplitude),
            modes: self.modes.unwrap_or(method.modes),
            decay: self.decay.unwrap_or(method.decay.clone()),
            perturbation: self.perturbation.unwrap_or(method.perturbation),
            seed: self.seed.unwrap_or(method.seed),
            relax_to: self.relax_to,
            relax_at: self.relax_at,
            ..method
        };
        spec.make_accurate(&[]);
        spec.form = self.form.or(spec.form);
        spec.pull = self.pull.unwrap_or(spec.pull);
        spec
    }
}

/// Compares the members of `spec`, at several n, too, if they are `one` curve.
pub fn referee(spec: &Spec, one: bool, folder: Option<OutputFolder>, quiet: bool) -> Result<()> {
    let mut rows = Vec::new();
    // A curve that is refused is told before anything runs.
    let only = if one { one_curve(spec)? } else { Vec::new() };
    let mut tell = |some: &[RefereeRow]| {
        rows.extend_from_slice(some);
        if quiet { Ok(()) } else { print(&some.iter().map(line).collect::<String>()) }
    };
    if !quiet {
        print(&cells(["member", "time", "n", "value", "+-", "referee", "+-", "error", "bars", "order"]))?;
    }
    match one {
        true => tell(&only)?,
        false => limits(spec, tell)?,
    }
    if let Some(folder) = folder {
        let table: Vec<TruthRow> = rows.iter().map(TruthRow::of).collect();
        let file = Table::of(folder.file(names::REFEREE)?, &table)?;
        folder.publish_all(vec![file])?;
    }
    verdict(&rows, quiet)
}

/// Says how many limits are within their half-widths; members without a truth are an error, with the reason of the
/// first.
fn verdict(rows: &[RefereeRow], quiet: bool) -> Result<()> {
    let bars: Vec<f64> = rows.iter().filter_map(RefereeRow::bars).map(f64::abs).collect();
    if !quiet && bars.len() > 1 {
        let (inside, worst) =
            (bars.iter().filter(|bars| **bars <= 1.0).count(), bars.iter().copied().fold(0.0, f64::max));
        note(&format!("{inside} of {} limits within their bars; the worst is off by {worst:.1} bars", bars.len()));
    }
    let refused: Vec<_> = rows.iter().filter_map(|row| Some((row.member, row.truth.as_ref().err()?))).collect();
    match refused.first() {
        None => Ok(()),
        Some((member, why)) => Err(Error::Failed(format!(
            "{} of {} rows have no truth; member {member}: {why}",
            refused.len(),
            rows.len()
        ))),
    }
}

fn cells([member, time, n, value, bar, referee, uncertainty, error, bars, order]: [&str; 10]) -> String {
    format!(
        "{member:>6}  {time:<7}{n:>6}{value:>14}{bar:>10}{referee:>16}{uncertainty:>10}{error:>11}{bars:>8}{order:>7}\n"
    )
}

fn line(row: &RefereeRow) -> String {
    let known = |value: Option<String>| value.unwrap_or("-".into());
    let truth = row.truth.as_ref().ok();
    cells([
        &row.member.to_string(),
        row.time,
        &row.points.to_string(),
        &known(row.t.map(|t| significant(t, 8))),
        &known(row.t_error.map(|error| format!("{error:.1e}"))),
        &known(truth.map(|truth| significant(truth.t, 10))),
        &known(truth.map(|truth| format!("{:.0e}", truth.error * truth.t))),
        &known(row.error().map(|error| format!("{error:+.1e}"))),
        &known(row.bars().map(|bars| format!("{bars:+.2}"))),
        &known(row.order.map(|order| format!("{order:.2}"))),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::Truth;

    #[test]
    fn a_line_has_the_error_in_bars_and_dashes_where_nothing_is_known() {
        let truth = Truth { t: 2.0, error: 1e-9, ..Truth::default() };
        let row = RefereeRow {
            member: 7,
            time: "t_limit",
            points: 100,
            t: Some(2.003),
            t_error: Some(0.002),
            order: Some(2.01),
            truth: Ok(truth),
        };
        let words = |row: &RefereeRow| line(row).split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&row)[0..5], ["7", "t_limit", "100", "2.0030000", "2.0e-3"]);
        assert_eq!(words(&row)[5..], ["2.000000000", "2e-9", "+1.5e-3", "+1.50", "2.01"]);
        let unknown = RefereeRow { truth: Err("rough".into()), ..row.clone() };
        assert_eq!(words(&unknown)[5..], ["-", "-", "-", "-", "2.01"]);
        let message = verdict(&[row, unknown], true).unwrap_err().to_string();
        assert_eq!(message, "1 of 2 rows have no truth; member 7: rough");
    }
}
