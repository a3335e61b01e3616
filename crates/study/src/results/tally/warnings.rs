//! What the user should know about the results of a run, from its totals.

use super::{CellTally, DISTRUSTED_DRIFT, RELAXED, Tally};
use curvelax_base::text::{plural, significant};
use curvelax_ensemble::Status;

/// Maximum number of cells that a warning names.
const NAMED_CELLS: usize = 5;

impl Tally {
    /// What the user should know about the results, one sentence each.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings: Vec<String> = self.mollified.warning(self.members()).into_iter().collect();
        let members = format!("{} {}", self.members(), plural(self.members(), "member"));
        let failed = self.failed();
        if failed > 0 {
            let stalled = self.counts().any(|(status, count)| status == Status::Stalled && count > 0);
            // Members that creep are stalled, too, without a sweep.
            let swept = self.sweeps_k > 0 || self.sweeps_x > 0;
            let direct = if stalled && swept { "where sweeps stalled, --solver direct helps; " } else { "" };
            warnings
                .push(format!("{failed} of {members} failed (see `status`); {direct}{}", self.remedies.of_failures()));
        }
        warnings.extend(self.vanished());
        warnings.extend(self.late());
        if self.below_rounding > 0 {
            warnings.push(format!(
                "{} of {members} started so nearly round that rounding hides the threshold: t_relax cannot be \
                 determined; use --precision f64, or a larger --relax-to or --relax-at",
                self.below_rounding
            ));
        }
        let judged = || self.cells.iter().flat_map(|cell| &cell.judged);
        let open = judged().filter(|limit| limit.is_open()).count();
        if self.refined && open > 0 {
            let all = judged().count();
            warnings.push(format!(
                "t_limit of {open} of {all} {} is the time at the finest level, and t_error a wide bound: their times do not \
                 converge in n (see `points`){}",
                plural(all as u64, "member"),
                if self.has_outlines { "; fewer nodes are enough with a larger --rounding" } else { "" }
            ));
        }
        if let (coarse @ 1.., most) = self.coarse {
            warnings.push(format!(
                "the outlines of {coarse} of {members} have too few points: without every second one, their times move by up \
                 to {} % (see `t_data_error`); give more points, or --interpolate spline if the outlines are smooth between \
                 these",
                significant(100.0 * most, 2)
            ));
        }
        for (name, at_start) in self.events.iter().zip(&self.at_start).filter(|(_, at_start)| **at_start > 0) {
            warnings
                .push(format!("the event {name} holds from the start in {at_start} of {members}: its time is 0 there"));
        }
        for (i, name) in self.events.iter().enumerate() {
            let some = self.cells.iter().filter_map(|cell| cell.events.get(i)).filter(|of| of.reached > 0);
            let stopped: u64 = some.map(|of| of.stopped).sum();
            if stopped > 0 {
                warnings.push(format!(
                    "{stopped} of {members} were stopped when they relaxed, before the event {name}: the slow ones were \
                     seen for longer, so it has no statistics; use --stop-when-relaxed=false, and a number as --t-end"
                ));
            }
        }
        let (drifted, worst) = self.drifted;
        if drifted > 0 {
            warnings.push(format!(
                "{drifted} of {members} ended with a metric drift above {DISTRUSTED_DRIFT} (worst {worst:.2}): \
                 their times and areas are unreliable; {}",
                self.remedies.of_drift()
            ));
        }
        warnings
    }

    /// The warning about members that vanished before they relaxed.
    fn vanished(&self) -> Option<String> {
        let rank = Status::ALL.iter().position(|status| *status == Status::Vanished)?;
        let before: u64 = self.cells.iter().map(|cell| cell.others[rank]).sum();
        let all = self.members();
        (before > 0).then(|| {
            format!(
                "{before} of {all} {} vanished before they relaxed: to t_relax they are censored then, as if they would relax later; \
                 see t_vanish",
                plural(all, "member")
            )
        })
    }

    /// The warning about cells in which no member relaxed, because the final time came first.
    fn late(&self) -> Option<String> {
        let is_late = |cell: &CellTally| cell.late > 0 && cell.counts[RELAXED] == 0;
        let late: Vec<u64> = (0..).zip(&self.cells).filter(|(_, cell)| is_late(cell)).map(|(rank, _)| rank).collect();
        let remedy = self.remedies.of_time();
        if late.is_empty() {
            return None;
        }
        if self.cells.len() == 1 {
            return Some(format!("no member relaxed before its final time; {remedy}"));
        }
        let mut named: Vec<String> = late.iter().take(NAMED_CELLS).map(|rank| self.sweep.name(*rank)).collect();
        if late.len() > NAMED_CELLS {
            named.push(format!("{} more", late.len() - NAMED_CELLS));
        }
        let (cells, all) = (late.len(), self.cells.len());
        Some(format!(
            "no member relaxed before its final time in {cells} of {all} cells ({}); {remedy}",
            named.join("; ")
        ))
    }
}
