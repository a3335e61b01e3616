//! The end of a member's trajectory: its results.

use std::f64::consts::PI;

use glam::DVec2;

use super::{Course, Time, Trajectory, vanishing::Vanishing, watch::ROUND};
use crate::{Ended, Features, Observables, Outcome, Portrait, Status, outcome};
use curvelax_curve::polygon;
use curvelax_flow::{
    equilibrium::Equilibrium,
    scheme::{
        State,
        member::{self, Decay, NEVER},
    },
};

/// A fit with fewer points says nothing.
const MIN_POINTS: u32 = 8;

impl Trajectory<'_> {
    /// Returns whether [`Trajectory::end`] needs the last state.
    pub fn needs_last_state(&self) -> bool {
        self.portrait || self.equilibrium != Equilibrium::Circle
    }

    /// Slope of the line fitted to -ln excess, in 1/time, or against the logarithm of time if the excess falls as a
    /// power of it; and the fraction of the variance that the line explains.
    fn rate(&self) -> Option<(f64, f64)> {
        let Decay { xx, xy, yy, .. } = self.at.report.decay;
        let clock = if self.launch.parameters.growth > 0.0 { 1.0 } else { self.time.unit(self.time_unit) };
        let (rate, r2) = (-xy / xx / clock, xy * xy / (xx * yy));
        (self.at.counters.fit_points >= MIN_POINTS && rate.is_finite() && r2.is_finite()).then_some((rate, r2))
    }

    /// The excess at the times of [`schedule::grid`](crate::schedule::grid) that the member has reached.
    pub fn excess(&self) -> Vec<f64> {
        let noted = &self.at.report.excess_at[..(self.at.counters.noted as usize).min(member::TIMES)];
        let end = self.is_at_end().then_some(self.at.report.now.excess);
        [self.start.excess].into_iter().chain(noted.iter().copied()).chain(end).collect()
    }

    /// Returns the member's results, without what theory predicts of them; `last` is its last state, if it is
    /// [needed](Trajectory::needs_last_state).
    pub fn end(mut self, last: Option<&State<f64>>) -> Ended {
        let frames = std::mem::take(&mut self.at.frames);
        let progress = &self.at.report.progress;
        let inside = |step: u32, [high, low, length, fraction]: [f64; 4]| match (self.time, step) {
            (_, NEVER) => None,
            (Time::Fixed(clock), step) => Some(clock.inside(step, fraction)),
            (Time::Adaptive(_), _) => Some((high + (low + fraction * length)) * self.time_unit),
        };
        let p = progress;
        let relaxed =
            inside(self.at.counters.relax_step, [p.relax_high, p.relax_low, p.relax_length, p.relax_fraction]);
        let halved = inside(self.at.counters.half_step, [p.half_high, p.half_low, p.half_length, p.half_fraction]);
        let [t_relax, t_half] = match &self.settling {
            Some(settling) if self.is_at_end() => settling.times(self.t_end, self.at.report.now.energy / self.unit),
            Some(_) => [None; 2],
            None => {
                let t_relax = if self.course == Course::Round { Some(0.0) } else { relaxed };
                [t_relax, if self.start.excess <= ROUND { Some(0.0) } else { halved }]
            }
        };
        let failed = Status::ALL.into_iter().find(|status| *status as u32 == self.at.counters.status);
        // What happens to a curve at rest takes nothing from its time; one that is driven to a point is never at rest.
        let is_vanishing = self.vanishing.as_ref().is_some_and(Vanishing::is_expected);
        let status = match failed {
            Some(Status::Vanished) => Status::Vanished,
            Some(failed) if is_vanishing && failed != Status::Relaxed => failed,
            _ if t_relax.is_some() => Status::Relaxed,
            failed => failed.unwrap_or(Status::Unfinished),
        };
        let (rate, rate_r2) = self.rate().unzip();
        let (origin, unit) = (self.member.origin, self.unit);
        let before = || self.member.nodes.iter().map(|node| *node + origin).collect::<Vec<DVec2>>();
        let after = || last.map_or_else(before, |state| self.placing().nodes(state));
        let portrait = self.portrait.then(|| Portrait { before: before(), frames, after: after() });
        let wulff_distance = match self.equilibrium {
            Equilibrium::Circle => None,
            Equilibrium::Wulff(energy) => Some(outcome::wulff_distance(&after(), &energy)).filter(|d| d.is_finite()),
        };
        let end = Observables::new(&self.at.report.now, progress.turning, unit);
        let outcome = Outcome {
            member: self.member.index,
            cell: self.member.cell,
            status,
            t_end: self.now(),
            steps: self.at.counters.steps.into(),
            rejected: self.at.counters.rejected.into(),
            sweeps_k: self.at.sweeps[0],
            sweeps_x: self.at.sweeps[1],
            t_relax,
            t_half,
            rate,
            rate_r2,
            start: self.start,
            turn: polygon::largest_turn(&self.member.nodes),
            end,
            self_crossing: self.at.crossed,
            solves: self.at.counters.solves.into(),
            label: std::mem::take(&mut self.member.label),
            group: std::mem::take(&mut self.member.group),
            points: self.member.nodes.len() as u64,
            wulff_distance,
            t_vanish: self.t_vanish,
            reduced_area: self.conserved.then(|| 4.0 * PI * end.area / (end.length * end.length)),
            events: self.watches.iter().map(|watch| watch.t).collect(),
            ..Outcome::default()
        };
        Ended {
            features: Features::of(&self.member, &self.start),
            excess: self.excess(),
            outcome,
            rows: self.at.rows,
            portrait,
            mollified: self.member.mollified,
            unresolved: self.course == Course::Unresolved,
        }
    }
}
