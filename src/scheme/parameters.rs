//! What a member's run is governed by, and what it reports: the structs shared with the kernel.
//!
//! Every field is one number of the run's precision, in declaration order, so that host and WGSL agree by
//! construction; a test compares names and offsets with naga's view of `shaders/member.wgsl`.

use super::observe::{Maxima, Sums};
use crate::{
    flow::{Flow, MAX_DEGREE},
    number::{Number, Real},
};

/// A struct of numbers of one type, convertible to and from an array in declaration order.
macro_rules! numbers {
    ($(#[$outer:meta])* $name:ident { $($(#[$inner:meta])* $field:ident),+ $(,)? }) => {
        $(#[$outer])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        #[repr(C)]
        pub struct $name<N> { $($(#[$inner])* pub $field: N),+ }

        impl<N: Copy> $name<N> {
            /// Field names in memory order.
            pub const FIELDS: &'static [&'static str] = &[$(stringify!($field)),+];

            /// The fields in memory order.
            pub fn to_numbers(&self) -> Vec<N> {
                vec![$(self.$field),+]
            }

            /// From the fields in memory order; `numbers` has one entry per field.
            pub fn from_numbers(numbers: &[N]) -> Self {
                let [$($field),+] = *numbers else { panic!("{} numbers for {}", numbers.len(), stringify!($name)) };
                $name { $($field),+ }
            }
        }
    };
}

numbers! {
    /// Parameters of one member.
    Parameters {
        /// c₁ of `b(k) = c₁k + … + c₈k⁸`.
        c1,
        /// c₂.
        c2,
        /// c₃.
        c3,
        /// c₄.
        c4,
        /// c₅.
        c5,
        /// c₆.
        c6,
        /// c₇.
        c7,
        /// c₈.
        c8,
        /// Time step τ.
        tau,
        /// ω of the redistribution, in 1/time.
        omega,
        /// 1 with redistribution, 0 without.
        redistribution,
        /// Tolerance of the sweeps.
        tolerance,
        /// Over-relaxation factor of the sweeps.
        sor,
        /// λ of the energy `∮(½k² + λ) ds`.
        length_penalty,
        /// Isoperimetric ratio of the regular n-gon, `(n/π)·tan(π/n)`.
        polygon_ratio,
        /// Excess at which the member is relaxed.
        relax_at,
        /// Half the excess at the start.
        half_at,
    }
}

numbers! {
    /// What a member reports when a dispatch ends: observables of its last accepted state, and its events.
    Report {
        /// Length of the polygon.
        length,
        /// Signed area of the polygon.
        area,
        /// Isoperimetric excess over the regular polygon.
        excess,
        /// `∮(½k² + λ) ds`.
        energy,
        /// Smallest curvature.
        k_min,
        /// Largest curvature.
        k_max,
        /// Longest over shortest edge.
        mesh_ratio,
        /// `max |r_i - |e_i|| / |e_i|`.
        metric_drift,
        /// Turning number.
        turning,
        /// The relaxation event lies this fraction of a step after `Counters::relax_step`.
        relax_fraction,
        /// The same for the halving of the excess.
        half_fraction,
    }
}

/// No such step.
pub const NEVER: u32 = u32::MAX;

/// Integers of one member, read and written by the kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Counters {
    /// 0 while the member is running, else its [`Status`](super::Status).
    pub status: u32,
    /// Accepted steps since the start.
    pub steps: u32,
    /// Run until this many steps.
    pub goal: u32,
    /// 1: end the member when it is relaxed.
    pub stop_when_relaxed: u32,
    /// Steps before the one in which the member relaxed, or [`NEVER`].
    pub relax_step: u32,
    /// Steps before the one in which the excess halved, or [`NEVER`].
    pub half_step: u32,
    /// Sweeps on curvature systems in this dispatch.
    pub sweeps_k: u32,
    /// Sweeps on position systems in this dispatch.
    pub sweeps_x: u32,
    /// Where the kernel paused inside a step: 0 before or in the curvature solve, 1 after it. The CPU never pauses.
    pub phase: u32,
    /// Sweeps that the paused solve has made.
    pub solve_sweeps: u32,
}

impl Parameters<f64> {
    /// The law of `flow` with step `tau`, the paper's ω = 1, redistribution and plain sweeps to 1e-5; no thresholds.
    pub fn of_flow(flow: &Flow, tau: f64) -> Parameters<f64> {
        let [c1, c2, c3, c4, c5, c6, c7, c8] = flow.coefficients();
        let length_penalty = flow.length_penalty();
        let (omega, redistribution, tolerance, sor) = (1.0, 1.0, 1e-5, 1.0);
        let (polygon_ratio, relax_at, half_at) = (1.0, 0.0, 0.0);
        Parameters {
            c1,
            c2,
            c3,
            c4,
            c5,
            c6,
            c7,
            c8,
            tau,
            omega,
            redistribution,
            tolerance,
            sor,
            length_penalty,
            polygon_ratio,
            relax_at,
            half_at,
        }
    }
}

impl<T: Real> Report<T> {
    /// Takes what the sums and maxima of a curve say; the excess and the events are left alone.
    pub fn observe(&mut self, sums: &Sums<T>, maxima: &Maxima<T>) {
        self.length = sums.length;
        self.area = sums.area;
        self.energy = sums.energy;
        self.k_min = -maxima.minus_k_min;
        self.k_max = maxima.k_max;
        self.mesh_ratio = maxima.longest / -maxima.minus_shortest;
        self.metric_drift = maxima.drift;
        self.turning = sums.turning;
    }

    /// The same report in f64, exactly.
    pub fn widened(&self) -> Report<f64> {
        let numbers: Vec<f64> = self.to_numbers().into_iter().map(T::to_f64).collect();
        Report::from_numbers(&numbers)
    }
}

impl Counters {
    /// Field names in memory order.
    pub const FIELDS: [&'static str; 10] = [
        "status",
        "steps",
        "goal",
        "stop_when_relaxed",
        "relax_step",
        "half_step",
        "sweeps_k",
        "sweeps_x",
        "phase",
        "solve_sweeps",
    ];
}

impl<N: Number> Parameters<N> {
    /// The law's coefficients, `c₁` first.
    #[inline(always)]
    pub fn coefficients(&self) -> [N; MAX_DEGREE] {
        [self.c1, self.c2, self.c3, self.c4, self.c5, self.c6, self.c7, self.c8]
    }

    /// `b(k)` by Horner's rule.
    #[inline(always)]
    pub fn b(&self, k: N) -> N {
        self.b_over_k(k) * k
    }

    /// `φ(k) = k² - b(k)/k`, without division.
    #[inline(always)]
    pub fn phi(&self, k: N) -> N {
        k * k - self.b_over_k(k)
    }

    #[inline(always)]
    fn b_over_k(&self, k: N) -> N {
        let c = self.coefficients();
        let mut sum = c[MAX_DEGREE - 1];
        for j in (0..MAX_DEGREE - 1).rev() {
            sum = sum * k + c[j];
        }
        sum
    }
}
