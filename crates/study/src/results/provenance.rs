//! `run.json`: enough to repeat a run, to trust it and to draw it again. The only file with clock times.

use std::{collections::BTreeMap, time::Duration};

use serde::{Deserialize, Serialize};

use super::{tally::Tally, treatment::MollifiedMembers};
use crate::placement::Platform;
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{Spec, request::spec::Precision};

/// Programs that read a run check this first: it grows when an older reader would misunderstand the files.
pub const FORMAT: u64 = 1;

/// The content of `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program.
    pub curvelax: String,
    /// [`FORMAT`] of the files.
    pub format: u64,
    /// Seed of the perturbations.
    pub seed: u64,
    /// Number type of the arithmetic.
    pub precision: Precision,
    /// Residual tolerance of the sweeps, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// The resolved spec.
    pub spec: Spec,
    /// Where it was computed.
    pub platform: Platform,
    /// Members that ended: the rows of `summary.csv`.
    pub members: u64,
    /// Members that ended, by status.
    pub members_by_status: BTreeMap<String, u64>,
    /// Total steps of all members.
    pub steps: u64,
    /// Total steps of the paper's scheme that were computed, also in refused adaptive steps.
    pub solves: u64,
    /// Total sweeps on curvature systems.
    pub sweeps_k: u64,
    /// Total sweeps on position systems.
    pub sweeps_x: u64,
    /// Members whose corners were rounded off before the run.
    pub mollified: MollifiedMembers,
    /// Members whose threshold is below the rounding of the precision.
    pub below_rounding: u64,
    /// Rows of `levels.csv`.
    pub levels: u64,
    /// Rows of `mean_excess.csv`.
    pub excess_rows: u64,
    /// Warnings given to the user, one sentence each.
    pub warnings: Vec<String>,
    /// When it began, in UTC.
    pub started: String,
    /// How long it took, to the millisecond.
    pub wall_seconds: f64,
}

impl Provenance {
    /// Collects the record at the end of a run.
    pub fn new(
        spec: &Spec,
        platform: &Platform,
        tally: &Tally,
        warnings: &[String],
        started: Duration,
        wall: Duration,
    ) -> Provenance {
        Provenance {
            curvelax: curvelax_base::VERSION.into(),
            format: FORMAT,
            seed: spec.seed,
            precision: platform.precision,
            tolerance: spec.solver().sweeps().then(|| spec.tolerance_at(platform.precision)),
            spec: spec.clone(),
            platform: platform.clone(),
            members: tally.members(),
            members_by_status: by_status(tally),
            steps: tally.steps,
            solves: tally.solves,
            sweeps_k: tally.sweeps_k,
            sweeps_x: tally.sweeps_x,
            mollified: tally.supplement.mollified,
            below_rounding: tally.supplement.below_rounding,
            levels: tally.levels,
            excess_rows: tally.supplement.excess.iter().map(|cell| cell.len() as u64).sum(),
            warnings: warnings.into(),
            started: rfc3339(started),
            wall_seconds: (wall.as_secs_f64() * 1e3).round() / 1e3,
        }
    }

    /// The text of the file.
    pub fn to_json(&self) -> Result<String> {
        json(self, "run.json")
    }
}

/// `value` as multi-line JSON; `name` is used in the error message.
pub fn json(value: &impl Serialize, name: &str) -> Result<String> {
    let text = serde_json::to_string_pretty(value);
    text.map(|text| text + "\n").map_err(|e| Error::Failed(format!("cannot write {name}: {e}")))
}

/// Members by the name of their status.
pub fn by_status(tally: &Tally) -> BTreeMap<String, u64> {
    tally.counts().map(|(status, count)| (status.name().into(), count)).collect()
}

/// Formats a time `since` 1970 in UTC to the second, for example `2026-11-05T09:08:07Z`.
pub fn rfc3339(since: Duration) -> String {
    let seconds = since.as_secs();
    let (day, second) = (seconds / 86_400, seconds % 86_400);
    // Years begin in March here, so that a leap day is the last day of its year (H. Hinnant, days_from_civil).
    let shifted = day + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * day_of_year + 2) / 153;
    let day_of_month = day_of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    let year = 400 * era + year_of_era + u64::from(month <= 2);
    let (hour, minute) = (second / 3600, second / 60 % 60);
    format!("{year:04}-{month:02}-{day_of_month:02}T{hour:02}:{minute:02}:{:02}Z", second % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::platform;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (951_868_799, "2000-02-29T23:59:59Z"),
            (1_735_689_599, "2024-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(rfc3339(Duration::from_secs(seconds)), text);
        }
    }

    #[test]
    fn the_spec_in_run_json_repeats_the_run() {
        let spec = Spec { seed: u64::MAX, tau: Some((1.0 / 3.0).into()), only: Some(vec![2]), ..Spec::default() };
        let (platform, tally) = (platform(), Tally::default());
        let run = Provenance::new(&spec, &platform, &tally, &[], Duration::ZERO, Duration::from_millis(1500));
        let json: serde_json::Value = serde_json::from_str(&run.to_json().unwrap()).unwrap();
        assert_eq!(serde_json::from_value::<Spec>(json["spec"].clone()).unwrap(), spec);
        assert_eq!(json["curvelax"], curvelax_base::VERSION);
        assert_eq!(json["tolerance"], 1e-5);
        assert_eq!(json["wall_seconds"], 1.5);
        assert_eq!(json["members_by_status"]["relaxed"], 0);
        assert_eq!(serde_json::from_str::<Provenance>(&run.to_json().unwrap()).unwrap(), run);
    }
}
