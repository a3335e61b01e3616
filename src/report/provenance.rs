//! `run.json`: enough to repeat a run and to trust it. The only file with clock times.

use std::{
    collections::BTreeMap,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use serde::Serialize;

use super::tally::{MollifiedMembers, Tally};
use crate::{
    backend::Platform,
    ensemble::{Spec, spec::Precision},
    error::{Error, Result},
};

/// The content of `run.json`.
#[derive(Serialize)]
pub struct Provenance<'a> {
    curvelax: &'static str,
    seed: u64,
    precision: Precision,
    #[serde(skip_serializing_if = "Option::is_none")]
    tolerance: Option<f64>,
    spec: &'a Spec,
    platform: &'a Platform,
    members: u64,
    members_by_status: BTreeMap<&'static str, u64>,
    steps: u64,
    sweeps_k: u64,
    sweeps_x: u64,
    mollified: MollifiedMembers,
    warnings: &'a [String],
    started: String,
    wall_seconds: f64,
}

impl<'a> Provenance<'a> {
    /// Collects it at the end of a run.
    pub fn new(
        spec: &'a Spec,
        platform: &'a Platform,
        tally: &Tally,
        warnings: &'a [String],
        started: SystemTime,
        wall: Duration,
    ) -> Provenance<'a> {
        Provenance {
            curvelax: env!("CARGO_PKG_VERSION"),
            seed: spec.seed,
            precision: platform.precision,
            tolerance: spec.solver().sweeps().then(|| spec.tolerance_at(platform.precision)),
            spec,
            platform,
            members: tally.members(),
            members_by_status: tally.counts().map(|(status, count)| (status.name(), count)).collect(),
            steps: tally.steps,
            sweeps_k: tally.sweeps_k,
            sweeps_x: tally.sweeps_x,
            mollified: tally.mollified,
            warnings,
            started: rfc3339(started),
            wall_seconds: (wall.as_secs_f64() * 1e3).round() / 1e3,
        }
    }

    /// The text of the file.
    pub fn to_json(&self) -> Result<String> {
        let text = serde_json::to_string_pretty(self);
        text.map(|text| text + "\n").map_err(|e| Error::Failed(format!("cannot write run.json: {e}")))
    }
}

/// `time` in UTC to the second, for example `2026-11-05T09:08:07Z`.
pub fn rfc3339(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (day, second) = (seconds / 86_400, seconds % 86_400);
    // Years begin in March here, so that the leap day is the last of its year (H. Hinnant, days_from_civil).
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
pub(crate) mod tests {
    use super::*;

    pub fn platform() -> Platform {
        Platform {
            backend: "cpu".into(),
            adapter: None,
            driver: None,
            device_type: None,
            precision: Precision::F64,
            reason: "no hardware GPU".into(),
            threads: Some(2),
        }
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (951_868_799, "2000-02-29T23:59:59Z"),
            (1_735_689_599, "2024-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(rfc3339(UNIX_EPOCH + Duration::from_secs(seconds)), text);
        }
    }

    #[test]
    fn the_spec_in_run_json_repeats_the_run() {
        let spec = Spec { seed: u64::MAX, tau: Some(1.0 / 3.0), only: Some(vec![2]), ..Spec::default() };
        let (platform, tally) = (platform(), Tally::default());
        let run = Provenance::new(&spec, &platform, &tally, &[], UNIX_EPOCH, Duration::from_millis(1500));
        let json: serde_json::Value = serde_json::from_str(&run.to_json().unwrap()).unwrap();
        assert_eq!(serde_json::from_value::<Spec>(json["spec"].clone()).unwrap(), spec);
        assert_eq!(json["curvelax"], env!("CARGO_PKG_VERSION"));
        assert_eq!(json["tolerance"], 1e-5);
        assert_eq!(json["wall_seconds"], 1.5);
        assert_eq!(json["members_by_status"]["relaxed"], 0);
    }
}
