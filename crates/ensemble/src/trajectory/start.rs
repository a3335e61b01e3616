//! The start of a member: its unit, its thresholds, its clock.

use glam::DVec2;

use super::{
    Course, FIRST_STEP, Time, Trajectory,
    settling::Settling,
    vanishing::Vanishing,
    watch::{ROUND, Watch, resolution},
};
use crate::{
    Member, Observables, Paused, Spec, Status,
    request::spec::{OrAuto, Pace, Precision},
    schedule::{self, Clock, Outputs, Ticks},
    theory::rates::{own_omega, own_tau, radius, relaxation_rate, strongest_pull},
};
use curvelax_curve::polygon;
use curvelax_flow::{
    flow::Flow,
    forcing::Forcing,
    scheme::{
        Parameters, State,
        run::{FIRST_ORDER, Run},
    },
};

/// A threshold that no excess reaches.
const NO_THRESHOLD: f64 = -1.0;
/// The rate is fitted while the excess is between these fractions of its start. Adaptive steps follow the shape to the
/// end of the fit, or to half the threshold.
const FITTED: [f64; 2] = [1e-3, 1e-1];
/// A curve that has shrunk to this fraction of its length has vanished.
const SHRUNK: f64 = 1e-3;
/// Largest error of an adaptive step in units of the tolerance: t_relax is then off by a tenth of it
/// (docs/internals/method.md).
const ERROR_PER_TOLERANCE: f64 = 1.0 / 12.0;
/// Minimum number of clock ticks in the first adaptive step.
const FIRST_TICKS: f64 = 16.0;
/// Largest growth for which a member in f32 gets a larger unit: a start in it has as many digits as a number of f32.
const MAX_GROWTH: f64 = 16.0;
/// `--pull auto`: κ in units of the member's relaxation rate.
const PULL_PER_RATE: f64 = 4.0;

impl<'a> Trajectory<'a> {
    /// Creates a member at its start, and serves the output times that are due there.
    pub fn new(member: Member, spec: &Spec, precision: Precision, outputs: &'a Outputs) -> Trajectory<'a> {
        let flow = member.flow.clone().unwrap_or_else(|| spec.typical().flow.into_owned());
        let forcing = member.forcing.unwrap_or_else(|| spec.typical().forcing);
        let forcing = forcing.kept_from([polygon::signed_area(&member.nodes), polygon::length(&member.nodes)]);
        let mut unit = unit_of(&member.nodes);
        if precision == Precision::F32 && (forcing.acts() || !spec.stops_when_relaxed()) {
            unit *= growth(&flow, &forcing, radius(&member.nodes), spec.mobility() * spec.final_time());
        }
        let nodes: Vec<DVec2> = member.nodes.iter().map(|node| *node / unit).collect();
        let time_unit = unit.powi(4) / spec.mobility();
        let mut parameters =
            parameters(spec, (&flow, &forcing), &nodes, [unit, time_unit], spec.tolerance_at(precision));
        if precision == Precision::F32 {
            parameters.compare_with(&nodes);
        }
        let mut launch = Run::new(State::with_offset(&nodes, parameters.r_offset), parameters);
        launch.counters.order = FIRST_ORDER.min(spec.most_order.unwrap_or(FIRST_ORDER));
        let turning = launch.report.progress.turning;
        let resolution = resolution(precision, parameters.branches().law.is_crystal());
        let watches = Watch::of(&spec.event, &launch.report.now, unit, precision, resolution);
        let start = Observables::new(&launch.report.now, turning, unit);
        let vanishing = Vanishing::new(flow.clone(), forcing, (&start, nodes.len()), unit, precision);
        let stops = spec.stops_when_relaxed() && !vanishing.as_ref().is_some_and(Vanishing::is_expected);
        launch.counters.stop_when_relaxed = stops.into();
        let limit = spec.threshold(member.given_excess.unwrap_or(start.excess));
        let course = match spec.keeps_both() {
            true => Course::Settling,
            false => Course::of(start.excess, turning, limit, resolution),
        };
        set_thresholds(&mut launch, course, start.excess, limit, resolution);
        let (time, out_of_range) = begin_time(&mut launch, spec, time_unit, precision);
        let clock = time.unit(time_unit);
        launch.parameters.clock_end = spec.final_time() / clock;
        launch.parameters.growth = spec
            .growth(&flow, &forcing, start.area)
            .map_or(0.0, |growth| (growth / clock).min(*schedule::range(precision).end()));
        let status = match course {
            Course::Round if stops => Some(Status::Relaxed),
            _ if beyond(&parameters, precision) => Some(Status::Nonfinite),
            _ => out_of_range,
        };
        let mut trajectory = Trajectory {
            member,
            unit,
            time_unit,
            t_end: spec.final_time(),
            time,
            outputs,
            at: Paused { counters: launch.counters, report: launch.report, ..Paused::default() },
            launch,
            start,
            course,
            watches,
            portrait: false,
            equilibrium: flow.equilibrium(),
            vanishing,
            t_vanish: None,
            settling: Settling::of(spec, &start),
            conserved: forcing.conserved.is_some(),
        };
        trajectory.at.counters.status = status.map_or(0, |status| status as u32);
        let state = std::mem::replace(&mut trajectory.launch.state, State::zeros(0));
        trajectory.look(&state);
        // At the start one row and one snapshot are due.
        trajectory.serve(Some(&state), usize::MAX);
        trajectory.launch.state = state;
        trajectory
    }
}

impl Course {
    /// The course of a curve with this excess and turning number, which is relaxed at an excess of `limit`.
    fn of(excess: f64, turning: f64, limit: f64, resolution: f64) -> Course {
        match limit {
            _ if excess <= ROUND => Course::Round,
            _ if turning.abs() != 1.0 => Course::Immersed,
            limit if excess <= limit => Course::Round,
            limit if limit < resolution => Course::Unresolved,
            _ => Course::Followed,
        }
    }
}

/// Sets the thresholds of the excess between `excess` and `limit`, and the length at which the curve has vanished.
fn set_thresholds(launch: &mut Run<f64>, course: Course, excess: f64, limit: f64, resolution: f64) {
    let parameters = &mut launch.parameters;
    let reachable = course != Course::Immersed && course != Course::Settling && excess > ROUND;
    let threshold = |excess: f64| if reachable && excess >= resolution { excess } else { NO_THRESHOLD };
    parameters.relax_at = if course == Course::Followed { limit } else { NO_THRESHOLD };
    parameters.half_at = threshold(0.5 * excess);
    parameters.follow_to = (FITTED[0] * excess).min(0.5 * limit).max(resolution);
    parameters.fit_from = threshold(FITTED[1] * excess);
    parameters.fit_to = (FITTED[0] * excess).max(resolution);
    parameters.least_length = SHRUNK * launch.report.now.length;
}

/// How the member's time advances, and its status if it ends at once because no clock of the precision holds its time.
fn begin_time(launch: &mut Run<f64>, spec: &Spec, time_unit: f64, precision: Precision) -> (Time, Option<Status>) {
    let tolerance = match spec.pace() {
        Pace::Fixed(tau) => {
            let tau = match tau {
                OrAuto::Number(tau) => tau,
                OrAuto::Auto => launch.parameters.tau * time_unit,
            };
            return (Time::Fixed(Clock::new(tau, spec.final_time())), None);
        }
        Pace::Adaptive(tolerance) => tolerance,
    };
    let (times, end) = (schedule::times(precision), spec.final_time() / time_unit);
    let status = match end {
        end if end < *times.start() => Some(Status::Nonfinite),
        end if end > *times.end() => Some(Status::Stalled),
        _ => None,
    };
    let end = end.clamp(*times.start(), *times.end());
    let ticks = Ticks::new(end, precision);
    let parameters = &mut launch.parameters;
    parameters.adaptive = ERROR_PER_TOLERANCE * tolerance;
    (parameters.time_unit, parameters.time_tick) = (ticks.unit, ticks.tick);
    (parameters.end_high, parameters.end_low) = ticks.split(end);
    let stored = launch.state.curve.r.nodes().iter().copied().fold(f64::INFINITY, f64::min);
    let shortest = launch.parameters.length_of(stored);
    launch.report.progress.next = (FIRST_STEP * shortest.powi(4)).max(FIRST_TICKS * ticks.tick);
    (Time::Adaptive(ticks), status)
}

/// The largest power of two not above the radius of the circle of the same length.
fn unit_of(nodes: &[DVec2]) -> f64 {
    (polygon::length(nodes) / std::f64::consts::TAU).log2().floor().exp2()
}

/// The power of two by which a circle of this radius grows until `end`, at most [`MAX_GROWTH`]: coordinates in f32 end
/// at 7.5 units.
fn growth(flow: &Flow, forcing: &Forcing, radius: f64, end: f64) -> f64 {
    let (mut grown, mut t) = (1.0, 0.0);
    while grown < MAX_GROWTH {
        let rate = forcing.growth(flow, grown * radius).max(forcing.growth(flow, 2.0 * grown * radius));
        t += grown * radius / rate;
        if !(rate > 0.0 && t < end) {
            break;
        }
        grown *= 2.0;
    }
    grown
}

/// Whether the law, a rate or the fixed step of a member is outside the range of a precision: too large, or a step too
/// short.
fn beyond(p: &Parameters<f64>, precision: Precision) -> bool {
    let range = schedule::range(precision);
    let rates = [p.redistribution * p.omega, p.pull, p.tau];
    let too_large = p.law.into_iter().chain(rates).any(|number| number.is_nan() || number.abs() > *range.end());
    too_large || (p.tau != 0.0 && p.tau < *range.start())
}

/// The parameters of a member in the units `unit` of length and `time` of time, except thresholds and times.
fn parameters(
    spec: &Spec,
    (flow, forcing): (&Flow, &Forcing),
    nodes: &[DVec2],
    [unit, time]: [f64; 2],
    tolerance: f64,
) -> Parameters<f64> {
    let rate = relaxation_rate(radius(nodes));
    let mut law = flow.law(unit);
    forcing.write(&mut law, unit);
    Parameters {
        law,
        tau: match spec.pace() {
            Pace::Fixed(OrAuto::Number(tau)) => tau / time,
            Pace::Fixed(OrAuto::Auto) => own_tau(rate),
            Pace::Adaptive(_) => 0.0,
        },
        omega: match spec.omega() {
            OrAuto::Number(rate) => rate * time,
            OrAuto::Auto => own_omega(rate),
        },
        redistribution: f64::from(u8::from(!spec.no_redistribution)),
        pull: match spec.pull {
            OrAuto::Number(rate) => rate * time,
            OrAuto::Auto => (PULL_PER_RATE * rate).min(strongest_pull(rate, nodes.len())),
        },
        geometric: f64::from(u8::from(spec.is_geometric())),
        tolerance,
        sor: match spec.sor() {
            OrAuto::Number(factor) => factor,
            OrAuto::Auto => 0.0,
        },
        polygon_ratio: flow.equilibrium().least_quotient(nodes.len()),
        ..Parameters::of_flow(flow, 1.0)
    }
}
