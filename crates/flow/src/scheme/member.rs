//! The parameters of a member's run and its reports: the structs shared with the kernel.
//!
//! Every field is one number of the run's precision, in declaration order, so that host and WGSL agree by
//! construction; a test compares names and offsets with naga's view of `shaders/member.wgsl`.

use serde::{Deserialize, Serialize};

use crate::{
    flow::{Flow, LAW},
    number::{BIG, Number, Real},
};

/// Parts of the run; the excess is recorded at the times between them.
pub const PARTS: usize = 32;
/// Times between the parts.
pub const TIMES: usize = PARTS - 1;

/// A struct of numbers of one type: first structs of such numbers, then arrays, then single ones. It is convertible to
/// and from one array in declaration order.
macro_rules! numbers {
    ($(#[$outer:meta])* $name:ident
        $(($($(#[$of_part:meta])* $part:ident: $struct:ident),+ $(,)?))?
        $([$($(#[$of_array:meta])* $array:ident: $size:expr),+ $(,)?])?
        { $($(#[$inner:meta])* $field:ident),* $(,)? }
    ) => {
        $(#[$outer])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[repr(C)]
        pub struct $name<N> {
            $($($(#[$of_part])* pub $part: $struct<N>,)+)?
            $($($(#[$of_array])* pub $array: [N; $size],)+)?
            $($(#[$inner])* pub $field: N,)*
        }

        impl<N: Copy> $name<N> {
            /// Field names in memory order.
            pub const FIELDS: &'static [&'static str] =
                &[$($(stringify!($part),)+)? $($(stringify!($array),)+)? $(stringify!($field)),*];
            /// Numbers of all fields.
            pub const LEN: usize = size_of::<$name<u8>>();

            /// Returns the numbers of the fields in memory order.
            pub fn to_numbers(&self) -> Vec<N> {
                let mut all = Vec::with_capacity(Self::LEN);
                $($(all.extend(self.$part.to_numbers());)+)?
                $($(all.extend(self.$array);)+)?
                all.extend_from_slice(&[$(self.$field),*]);
                all
            }

            /// Creates the struct from the numbers of its fields in memory order, [`Self::LEN`] of them.
            pub fn from_numbers(numbers: &[N]) -> Self {
                let rest = numbers;
                $($(
                    let ($part, rest) = rest.split_at($struct::<N>::LEN);
                    let $part = $struct::from_numbers($part);
                )+)?
                $($(let ($array, rest) = rest.split_first_chunk().expect(stringify!($array));)+)?
                let [$($field),*] = *rest else { panic!("{} numbers for {}", numbers.len(), stringify!($name)) };
                $name { $($($part,)+)? $($($array: *$array,)+)? $($field),* }
            }
        }

        impl<T: Real> $name<T> {
            /// Converts the numbers to another precision, rounding.
            pub fn convert<U: Real>(&self) -> $name<U> {
                let numbers: Vec<U> = self.to_numbers().into_iter().map(|number| U::of(number.to_f64())).collect();
                $name::from_numbers(&numbers)
            }
        }

        impl<N: Number> $name<N> {
            /// Sets one lane of every field.
            pub fn set_lane(&mut self, lane: usize, values: &$name<N::Real>) {
                $($(self.$part.set_lane(lane, &values.$part);)+)?
                $($(for (to, from) in self.$array.iter_mut().zip(values.$array) {
                    to.set_lane(lane, from);
                })+)?
                $(self.$field.set_lane(lane, values.$field);)*
            }
        }
    };
}

numbers! {
    /// Parameters of one member.
    Parameters (
        /// Where the member pauses if it is watched: an observable at or below its level here.
        low: Observed,
        /// An observable at or above its level here.
        high: Observed,
    ) [
        /// The numbers of the law; see [`Flow::law`].
        law: LAW,
    ] {
        /// Length τ of a fixed step, or of the current step if steps are adaptive.
        tau,
        /// ω of the redistribution, in 1/time.
        omega,
        /// 1 with redistribution, 0 without.
        redistribution,
        /// κ of the metric pull, in 1/time.
        pull,
        /// 1 if the force of the polygon moves the nodes, 0 for the paper's position equation.
        geometric,
        /// Tolerance of the sweeps.
        tolerance,
        /// Over-relaxation factor of the sweeps; 0 to choose it by the stiffness of each system.
        sor,
        /// The quotient of n nodes at [equilibrium](crate::equilibrium), `(n/π)·tan(π/n)` of a circle.
        polygon_ratio,
        /// What stored lengths of segments lack, the mean length of those of the start in short numbers: their digits
        /// are for what differs and changes. 0 in f64.
        r_offset,
        /// Excess at which the member is relaxed.
        relax_at,
        /// Half the excess at the start.
        half_at,
        /// Excess down to which adaptive steps follow the shape, not only the size, of the curve.
        follow_to,
        /// Length below which the curve has shrunk to a point.
        least_length,
        /// Travel at which the member pauses for inspection, if its curvature changes sign.
        look_at,
        /// Largest error of an adaptive step; 0 for fixed ones.
        adaptive,
        /// Unit of the high part of an adaptive time, a power of two.
        time_unit,
        /// Unit of its low part.
        time_tick,
        /// Time at which the member pauses, high part.
        goal_high,
        /// Low part.
        goal_low,
        /// Final time, high part.
        end_high,
        /// Low part.
        end_low,
        /// Final time on the clock of [`decay`](super::decay).
        clock_end,
        /// Excess at which the fit of its decay begins.
        fit_from,
        /// Excess at which the fit ends.
        fit_to,
        /// The time `growth` if the excess falls as a power of `growth + t`; 0 if it falls exponentially.
        growth,
        /// 1: the member pauses where an observable is at or below its level in `low`, or at or above that in `high`.
        watched,
    }
}

numbers! {
    /// Observables of one curve.
    Observed {
        /// Length of the polygon.
        length,
        /// Signed area of the polygon.
        area,
        /// Distance from [equilibrium](crate::equilibrium).
        excess,
        /// `∮(½k² + λ) ds`; of a crystal `∮γ ds`, in the same unit.
        energy,
        /// Smallest curvature.
        k_min,
        /// Largest curvature.
        k_max,
        /// Longest edge over the shortest.
        mesh_ratio,
        /// `max |r_i - |e_i|| / |e_i|`.
        metric_drift,
    }
}

numbers! {
    /// A member's time, and the times of its events.
    Progress {
        /// Turning number.
        turning,
        /// Sum over the steps of the largest displacement of a node.
        travel,
        /// Time of the last accepted curve, if steps are adaptive; high part.
        time_high,
        /// Low part.
        time_low,
        /// Length of the last adaptive step.
        taken,
        /// Length of the one before; 0 if there was none.
        taken_before,
        /// Length of the next one that its error allows.
        next,
        /// Length of one that ends shortly behind the place where the member is expected to relax; 0: not known.
        aim,
        /// Derivative of ln excess at the end of the last step, times its length.
        slope,
        /// Second derivative, times the square of the length.
        bend,
        /// Start of the step in which the member relaxed, if steps are adaptive; high part.
        relax_high,
        /// Low part.
        relax_low,
        /// Length of that step.
        relax_length,
        /// Position of the event in that step, as a fraction.
        relax_fraction,
        /// Start of the step in which its excess halved; high part.
        half_high,
        /// Low part.
        half_low,
        /// Length of that step.
        half_length,
        /// Position of the event in that step.
        half_fraction,
    }
}

numbers! {
    /// The line fitted to ln excess: the last point, and the means and sums of squares of all points.
    Decay {
        /// Abscissa of the last curve, relative to the first point.
        x,
        /// ln of its excess over that of the first point.
        y,
        /// Mean of x over the points.
        mean_x,
        /// Mean of y.
        mean_y,
        /// `Σ (x - mean)²`.
        xx,
        /// `Σ (x - mean)(y - mean)`.
        xy,
        /// `Σ (y - mean)²`.
        yy,
    }
}

numbers! {
    /// A member's report at the end of a dispatch.
    Report (
        /// The curve before the last step.
        before: Observed,
        /// The last accepted curve; only the excess is known before the first step.
        now: Observed,
        /// Its time and events.
        progress: Progress,
        /// The decay of its excess.
        decay: Decay,
    ) [
        /// Its excess at the first `noted` times of the grid of [`decay`](super::decay).
        excess_at: TIMES,
    ] {}
}

/// No such step.
pub const NEVER: u32 = u32::MAX;

/// Integers of one member, read and written by the kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable, Serialize, Deserialize)]
#[repr(C)]
pub struct Counters {
    /// 0 while the member is running, else its [`Status`](super::Status).
    pub status: u32,
    /// Accepted steps since the start.
    pub steps: u32,
    /// Refused adaptive steps since the start.
    pub rejected: u32,
    /// Adaptive steps refused since the last accepted one.
    pub refused: u32,
    /// Order of the next adaptive step.
    pub order: u32,
    /// Steps of the paper made since the start, also in refused steps.
    pub solves: u32,
    /// Steps at which to stop; a member that pauses earlier sets this to its steps.
    pub goal: u32,
    /// 1: end the member once it is relaxed.
    pub stop_when_relaxed: u32,
    /// Steps before the one in which the member relaxed, or [`NEVER`].
    pub relax_step: u32,
    /// Steps before the one in which the excess halved, or [`NEVER`].
    pub half_step: u32,
    /// Sweeps on curvature systems in this dispatch.
    pub sweeps_k: u32,
    /// Sweeps on position systems in this dispatch.
    pub sweeps_x: u32,
    /// Where the kernel paused inside an attempt: twice the number of finished parts, plus one after a curvature solve.
    /// The CPU never pauses.
    pub phase: u32,
    /// Sweeps that the paused solve has made.
    pub solve_sweeps: u32,
    /// Points of the fitted line.
    pub fit_points: u32,
    /// 1: the excess has left the window of the fit.
    pub fit_over: u32,
    /// Times of the grid that the member has passed.
    pub noted: u32,
    /// 1: an observable may have reached a level inside the last adaptive step and left it again, and the member
    /// paused.
    pub passed: u32,
}

impl Parameters<f64> {
    /// Returns the law of `flow` with fixed steps `tau`, the paper's ω = 1, redistribution and plain sweeps to 1e-5; no
    /// pull and no thresholds.
    pub fn of_flow(flow: &Flow, tau: f64) -> Parameters<f64> {
        Parameters {
            law: flow.law(1.0),
            tau,
            omega: 1.0,
            redistribution: 1.0,
            tolerance: 1e-5,
            sor: 1.0,
            polygon_ratio: 1.0,
            look_at: BIG,
            time_unit: 1.0,
            time_tick: 1.0,
            ..Parameters::default()
        }
    }
}

impl Counters {
    /// Returns whether the member has steps to make.
    pub fn is_running(&self) -> bool {
        self.status == 0 && self.steps < self.goal
    }
}
