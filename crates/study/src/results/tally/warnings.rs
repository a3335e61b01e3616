//! What the user should know about the results of a run, from its totals.

use super::{CellTally, DISTRUSTED_DRIFT, RELAXED, Tally, TallySupplement};
use curvelax_base::text::{count, plural, significant};
use curvelax_ensemble::Status;

/// Maximum number of cells that a warning names.
const NAMED_CELLS: usize = 5;

impl Tally {
    /// What the user should know about the results, one sentence each.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings: Vec<String> = self.supplement.mollified.warning(self.members()).into_iter().collect();
        let members = format!("{} {}", self.members(), plural(self.members(), "member"));
        let failed = self.failed();
        if failed > 0 {
            let stalled: u64 =
                self.counts().filter(|(status, _)| *status == Status::Stalled).map(|(_, count)| count).sum();
            // Members that creep are stalled, too, without a sweep or in adaptive steps.
            let swept = self.sweeps_k > 0 || self.sweeps_x > 0;
            let remedy = match stalled > 0 && swept {
                true if stalled == failed && !self.remedies.adaptive => {
                    "Gauss-Seidel sweeps did not converge; use --adaptive --pull auto, or --solver direct".into()
                }
                true => format!("use --solver direct where sweeps stalled; {}", self.remedies.of_failures()),
                false => self.remedies.of_failures(),
            };
            warnings.push(format!("{failed} of {members} failed (see `status`): {remedy}"));
        }
        warnings.extend(self.vanished());
        let TallySupplement { drifted: (drifted, worst), below_rounding, .. } = self.supplement;
        // More time shows no threshold that rounding hides.
        if self.cells.iter().map(|cell| cell.late).sum::<u64>() > below_rounding {
            warnings.extend(self.late());
        }
        if below_rounding > 0 {
            warnings.push(format!(
                "{below_rounding} of {members} started so nearly round that rounding hides the threshold: t_relax cannot be \
                 determined; use --precision f64, or a larger --relax-to or --relax-at"
            ));
        }
        warnings.extend(self.moving());
        warnings.extend(self.without_limits());
        let judged = || self.cells.iter().flat_map(|cell| &cell.relaxing.judged);
        let open = judged().filter(|limit| limit.is_open()).count();
        if self.counted.refined && open > 0 {
            let all = judged().count();
            warnings.push(format!(
                "the times of {open} of {all} {} do not converge in n (see `points`): their t_limit assumes a single term of \
                 the error, and their t_error is a wide bound{}",
                plural(all as u64, "member"),
                if self.has_outlines { "; fewer nodes are enough with a larger --rounding" } else { "" }
            ));
        }
        if let (coarse @ 1.., most) = self.coarse {
            let remedy = match self.remedies.relative {
                true => {
                    "use --relax-at 0.01, as details decide when a share of the initial excess is left, or give more points"
                }
                false => "give more points, or --interpolate spline if the outlines are smooth between these",
            };
            warnings.push(format!(
                "the outlines of {coarse} of {members} have too few data points: without every second one, their times change \
                 by up to {} % (see `t_data_error`); {remedy}",
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
                "{before} of {all} {} vanished before relaxing: t_relax is censored at that time (see t_vanish)",
                plural(all, "member")
            )
        })
    }

    /// The warning about vesicles that still moved at their final time, beside others that had come to rest.
    fn moving(&self) -> Option<String> {
        let some = self.cells.iter().filter(|cell| cell.counts[RELAXED] > 0);
        let moving: u64 = some.map(|cell| cell.moving).sum();
        (moving > 0).then(|| {
            format!(
                "{moving} of {} still moved at their final time, or came back near the threshold of the energy: their t_relax \
                 is unknown, and the statistics are those of the others, mostly the fast ones; {}",
                count(self.members(), "member"),
                self.remedies.of_time()
            )
        })
    }

    /// The warnings about times without a limit where limits were asked for, of one kind each.
    fn without_limits(&self) -> Vec<String> {
        // Nothing is told of an event before which members were stopped.
        let of_event =
            |i: usize| self.cells.iter().filter_map(move |cell| cell.events.get(i)).filter(|of| of.stopped == 0);
        let named = self.events.iter().enumerate().map(|(i, name)| {
            let without: u64 = of_event(i).map(|of| of.without_limit).sum();
            (format!("reached the event {name}"), "event_levels.csv", without)
        });
        let relaxed = self.cells.iter().map(|cell| cell.relaxing.without_limit).sum();
        let vanished = self.cells.iter().map(|cell| cell.vanishing.without_limit).sum();
        let kinds = [("relaxed", relaxed), ("vanished", vanished)];
        let kinds = kinds.into_iter().map(|(did, without)| (did.to_string(), "levels.csv", without)).chain(named);
        let told = |(did, file, without): (String, &str, u64)| {
            let members = count(self.members(), "member");
            let round = if did == "vanished" { ", or a curve was not round at the end" } else { "" };
            format!(
                "{without} of {members} {did} without a limit: the times at other resolutions do not converge (see {file})\
                 {round}; statistics of limits censor them at their own time; more --points may help"
            )
        };
        kinds.filter(|(.., without)| *without > 0).map(told).collect()
    }

    /// The warnings about cells in which no member relaxed, because the final time came first; of cells of vesicles
    /// one of their own.
    fn late(&self) -> Vec<String> {
        let is_late = |cell: &CellTally| cell.late > 0 && cell.counts[RELAXED] == 0;
        let late = |vesicles: bool| {
            let cells = (0..).zip(&self.cells).filter(|(_, cell)| is_late(cell)).map(|(rank, _)| rank);
            cells.filter(move |rank| self.is_vesicle(*rank) == vesicles).collect::<Vec<u64>>()
        };
        let kinds = [
            (late(false), "relaxed before its final time", ""),
            (
                late(true),
                "has a relaxation time",
                ": the energy still moved at the end, or came back near the threshold",
            ),
        ];
        let told = |(late, did, why): (Vec<u64>, &str, &str)| {
            let remedy = self.remedies.of_time();
            let (cells, all) = (late.len(), self.cells.len());
            if all == 1 {
                return format!("no member {did}{why}; {remedy}");
            }
            let mut named: Vec<String> = late.iter().take(NAMED_CELLS).map(|rank| self.sweep.name(*rank)).collect();
            if cells > NAMED_CELLS {
                named.push(format!("{} more", cells - NAMED_CELLS));
            }
            format!("no member {did} in {cells} of {all} cells ({}){why}; {remedy}", named.join("; "))
        };
        kinds.into_iter().filter(|(late, ..)| !late.is_empty()).map(told).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::outcome;
    use curvelax_ensemble::{LevelTimes, Outcome, Spec};
    use curvelax_statistics::Limit;

    fn of(spec: &str, members: &[Outcome]) -> Tally {
        let mut tally = Tally::of(&Spec::from_toml(spec).unwrap(), &LevelTimes::default());
        members.iter().for_each(|member| tally.add(member).unwrap());
        tally
    }

    #[test]
    fn a_vesicle_that_still_moves_is_not_known_to_relax_later() {
        let own = || {
            let mut moving = outcome(0, Status::Unfinished, None);
            moving.end.turning = 1;
            [moving, outcome(1, Status::Relaxed, Some(0.5)), outcome(2, Status::Unfinished, None)]
        };
        let vesicles = of("flow = 'willmore'\nconserve = 'area,length'", &own());
        let later_than =
            |of: &Tally, cell: usize| of.cells[cell].relaxing.times.iter().map(|seen| seen.time).collect::<Vec<_>>();
        assert_eq!(later_than(&vesicles, 0), [0.0, 0.5, 0.0]);
        assert_eq!(vesicles.later_than(&vesicles.named[0]), None);
        let warning = "2 of 3 members still moved at their final time, or came back near the threshold of the energy: \
                       their t_relax is unknown, and the statistics are those of the others, mostly the fast ones; use a longer --t-end, or another --relax-to";
        assert_eq!(vesicles.warnings(), [warning]);
        // The control: members with one of the two are censored, in a sweep, too.
        let sweep = "flow = 'willmore'\n[sweep]\nconserve = ['area', 'area,length']";
        let others = own().map(|of| Outcome { cell: 1, ..of });
        let both = of(sweep, &[&own()[..], &others].concat());
        assert_eq!((later_than(&both, 0), later_than(&both, 1)), (vec![2.0, 0.5, 2.0], vec![0.0, 0.5, 0.0]));
        assert_eq!([0, 3].map(|i| both.later_than(&both.named[i])), [Some(2.0), None]);
        let [first, ..] = own();
        let unfinished = [0, 1].map(|cell| Outcome { member: cell, cell, ..first.clone() });
        let late = [
            "no member relaxed before its final time in 1 of 2 cells (conserve = area); use a longer --t-end, or another --relax-to",
            "no member has a relaxation time in 1 of 2 cells (conserve = area,length): the energy still moved at the end, or \
             came back near the threshold; use a longer --t-end, or another --relax-to",
        ];
        assert_eq!(of(sweep, &unfinished).warnings(), late);
    }

    #[test]
    fn times_without_a_limit_are_told_where_limits_were_asked_for() {
        let limit = |t| Limit { t, error: 1e-4, fixed: 0.0, order: None, asymptotic: true, relative: 0.0 };
        let relaxed = |t_limit: Option<f64>, event, vanished: bool| Outcome {
            judged: t_limit.map(limit),
            events: vec![event],
            t_vanish: vanished.then_some(1.5),
            ..outcome(0, Status::Relaxed, Some(0.5))
        };
        let members = [relaxed(Some(0.4), None, false), relaxed(None, Some(0.2), true), relaxed(None, None, false)];
        let spec = "drive = 0.5\nadaptive = 1e-3\nevent = ['early = k_min >= 0']";
        let told = of(&format!("refine = true\n{spec}"), &members).warnings();
        let starts = [
            "2 of 3 members relaxed without a limit:",
            "1 of 3 members vanished without a limit:",
            "1 of 3 members reached the event early without a limit:",
        ];
        assert_eq!(told.len(), starts.len(), "{told:?}");
        assert!(told.iter().zip(starts).all(|(told, start)| told.starts_with(start)), "{told:?}");
        assert!(told[1].contains("or a curve was not round at the end") && !told[0].contains("round"), "{told:?}");
        assert_eq!(of(spec, &members).warnings(), [""; 0]);
    }
}
