//! What a completed run has to answer for by its exit code: its files are written, and do not hold what was asked for.

use std::path::Path;

use super::{EnsembleStatistics, provenance::Provenance, shortfall::Shortfall};
use curvelax_base::{
    error::{Error, Result},
    text::plural,
};
use curvelax_ensemble::Status;

/// How a completed run ended as a whole.
#[derive(Clone, Debug)]
pub struct RunVerdict {
    members: u64,
    /// Members that ended neither relaxed nor unfinished, by status.
    failed: Vec<(Status, u64)>,
    /// What it lacks of the goal of `--accuracy`.
    missed: Option<Shortfall>,
    /// One of several shards: what all members have in common is judged when they are merged.
    is_part: bool,
}

impl RunVerdict {
    /// The verdict on the run of `provenance`, whose `statistics` are needed if [they are
    /// judged](RunVerdict::needs_statistics).
    pub fn new(provenance: &Provenance, statistics: Option<&EnsembleStatistics>) -> RunVerdict {
        let count = |status: Status| provenance.members_by_status.get(status.name()).copied().unwrap_or(0);
        let failures = Status::ALL.into_iter().filter(|status| status.is_failure());
        let failed = failures.map(|status| (status, count(status))).filter(|(_, count)| *count > 0).collect();
        RunVerdict {
            members: provenance.members,
            failed,
            missed: statistics.and_then(|statistics| Shortfall::of(&provenance.spec, statistics)),
            is_part: provenance.spec.shard.is_some(),
        }
    }

    /// Whether the verdict on this run depends on its statistics.
    pub fn needs_statistics(provenance: &Provenance) -> bool {
        provenance.spec.accuracy.is_some()
    }

    /// Checks that the run with this `summary.csv` holds what was asked for: some member that did not fail, no member
    /// that failed if it is `strict`, and the accuracy.
    ///
    /// # Errors
    /// [`Error::Strict`] with what is missing.
    pub fn check(&self, strict: bool, summary: &Path) -> Result<()> {
        let RunVerdict { members, ref failed, ref missed, is_part } = *self;
        let count: u64 = failed.iter().map(|(_, count)| count).sum();
        let see = format!("see `status` in {}", summary.display());
        let all = format!("{members} {}", plural(members, "member"));
        if count > 0 && strict {
            return Err(Error::Strict(format!(
                "--strict: {count} of {all} ended neither relaxed nor unfinished; {see}"
            )));
        }
        if count > 0 && count == members && !is_part {
            let statuses: Vec<String> =
                failed.iter().map(|(status, count)| format!("{count} {}", status.name())).collect();
            return Err(Error::Strict(format!("every member failed ({} of {all}); {see}", statuses.join(", "))));
        }
        match missed {
            Some(missed) if !is_part => Err(Error::Strict(missed.sentence())),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeMap, time::Duration};

    use super::*;
    use crate::{results::tally::Tally, samples::platform};
    use curvelax_ensemble::Spec;

    fn verdict(relaxed: u64, failed: [u64; 3], shard: Option<&str>) -> RunVerdict {
        let spec = Spec { shard: shard.map(|shard| shard.parse().unwrap()), ..Spec::default() };
        let mut run = Provenance::new(&spec, &platform(), &Tally::default(), &[], Duration::ZERO, Duration::ZERO);
        let counts = [("relaxed", relaxed), ("singular", failed[0]), ("nonfinite", failed[1]), ("stalled", failed[2])];
        run.members_by_status =
            counts.map(|(name, count)| (name.to_string(), count)).into_iter().collect::<BTreeMap<_, _>>();
        run.members = relaxed + failed.iter().sum::<u64>();
        RunVerdict::new(&run, None)
    }

    fn said(verdict: &RunVerdict, strict: bool) -> Option<String> {
        let error = verdict.check(strict, Path::new("out/summary.csv")).err()?;
        assert_eq!(error.exit_code(), 3);
        Some(error.to_string())
    }

    #[test]
    fn a_run_in_which_every_member_failed_says_so_without_being_strict() {
        let all = "every member failed (2 singular, 1 stalled of 3 members); see `status` in out/summary.csv";
        assert_eq!(said(&verdict(0, [2, 0, 1], None), false).as_deref(), Some(all));
        // One shard is not the run.
        assert_eq!(said(&verdict(0, [2, 0, 1], Some("0/2")), false), None);
        assert!(said(&verdict(0, [2, 0, 1], Some("0/2")), true).unwrap().starts_with("--strict: 3 of 3 members"));
        assert_eq!(said(&verdict(1, [2, 0, 1], None), false), None);
        assert!(said(&verdict(1, [2, 0, 1], None), true).unwrap().starts_with("--strict: 3 of 4 members"));
        assert_eq!(said(&verdict(0, [0, 0, 0], None), true), None);
    }
}
