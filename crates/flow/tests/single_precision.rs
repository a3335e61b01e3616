//! Relaxation times of adaptive runs in f32 against those of the same runs in f64.

// `f32::algebraic_add` and its kin are not stable.
#![cfg_attr(feature = "fast-math", feature(float_algebraic))]

use std::f64::consts::{PI, TAU};

use curvelax_flow::{
    crystal::Crystal,
    flow::Flow,
    scheme::{
        Parameters, State,
        evolve::{Evolves, Team},
        extrapolation::MOST_ORDER,
        member::{NEVER, Observed},
        run::Run,
        step::Method,
    },
    solver::{Blocks, Solver},
};
use glam::DVec2;

const ASPECTS: [f64; 4] = [1.05, 1.2, 2.0, 4.0];
/// The tolerance of a step with `--adaptive=1e-4`. Since rows have other parts in f64, errors of the steps differ, too.
const TOLERANCE: f64 = 1e-4 / 12.0;
/// Longer ones depend on where steps end: f64 itself is off by 3e-4 at the same tolerance.
const ASPECTS_OF_CRYSTALS: [f64; 2] = [1.2, 2.0];
/// Of the median and of the largest difference from f64, by the number of nodes.
const BOUNDS: [(usize, [f64; 2]); 4] =
    [(100, [1e-5, 5e-5]), (200, [2e-5, 1e-4]), (320, [5e-5, 2e-4]), (400, [5e-5, 2e-4])];

fn plain_flows() -> [Flow; 2] {
    [Flow::SurfaceDiffusion, Flow::Willmore]
}

/// Surface diffusion of materials whose energy, mobility or both depend on the direction.
fn crystals() -> [Flow; 3] {
    let crystal = |energy: &str, diffusivity: &str| {
        let (energy, diffusivity) = (energy.parse().unwrap(), diffusivity.parse().unwrap());
        Flow::Crystal(Crystal { energy, diffusivity })
    };
    [crystal("cos:4,0.03", "1"), crystal("1", "cos:4,0.3"), crystal("cos:6,0.01,10", "cos:2,0.2,30")]
}

/// An ellipse with evenly spaced nodes and a semi-minor axis of 1.
fn ellipse(n: usize, a: f64) -> Vec<DVec2> {
    let fine = 100_000;
    let at = |place: f64| DVec2::new(a * (TAU * place / f64::from(fine)).cos(), (TAU * place / f64::from(fine)).sin());
    let mut so_far = vec![0.0];
    for j in 0..fine {
        so_far.push(so_far[j as usize] + at(j.into()).distance(at(f64::from(j + 1))));
    }
    let node = |i: usize| {
        let wanted = so_far[fine as usize] * i as f64 / n as f64;
        let after = so_far.partition_point(|s| *s <= wanted).min(fine as usize);
        let share = (wanted - so_far[after - 1]) / (so_far[after] - so_far[after - 1]);
        at((after - 1) as f64 + share)
    };
    (0..n).map(node).collect()
}

/// All observables at this value.
fn level(value: f64) -> Observed<f64> {
    Observed::from_numbers(&[value; Observed::<f64>::FIELDS.len()])
}

/// Adaptive steps of this tolerance up to a late time.
fn parameters(n: usize, flow: &Flow, adaptive: f64) -> Parameters<f64> {
    Parameters {
        adaptive,
        polygon_ratio: flow.equilibrium().least_quotient(n),
        time_unit: 2f64.powi(-10),
        time_tick: 2f64.powi(-34),
        end_high: 64.0,
        goal_high: 64.0,
        clock_end: 64.0,
        ..Parameters::of_flow(flow, 0.0)
    }
}

/// A member at its start.
fn started<T: Evolves>(nodes: &[DVec2], mut p: Parameters<f64>) -> Run<T> {
    if T::IS_SHORT {
        p.compare_with(nodes);
    }
    Run::new(State::with_offset(nodes, p.r_offset), p).convert()
}

/// t_relax to 1 % of the excess at the start, by steps up to the highest order.
fn t_relax<T: Evolves>(nodes: &[DVec2], flow: &Flow, geometric: bool) -> f64 {
    t_relax_by::<T>(nodes, flow, geometric, TOLERANCE)
}

/// The same by steps of another tolerance.
fn t_relax_by<T: Evolves>(nodes: &[DVec2], flow: &Flow, geometric: bool, adaptive: f64) -> f64 {
    let direct = Method::coloured(Solver::Direct, 1);
    let p = Parameters { geometric: f64::from(u8::from(geometric)), ..parameters(nodes.len(), flow, adaptive) };
    t_relax_with::<T>(nodes, p, &direct)
}

/// The same with any parameters and by any solver.
fn t_relax_with<T: Evolves>(nodes: &[DVec2], mut p: Parameters<f64>, method: &Method) -> f64 {
    let n = nodes.len();
    (p.low, p.high) = (level(-1e18), level(1e18));
    let start = Run::new(State::<f64>::from_nodes(nodes), p).report.now.excess;
    (p.relax_at, p.half_at, p.follow_to) = (0.01 * start, 0.5 * start, 0.01 * start);
    let mut run: Run<T> = started(nodes, p);
    run.report.progress.next = T::of(1e-5);
    (run.counters.goal, run.counters.stop_when_relaxed, run.counters.order) = (10_000, 1, MOST_ORDER);
    let mut team = Team::new(Blocks::new(n).unwrap());
    while run.counters.is_running() && run.counters.rejected < 10_000 {
        Evolves::evolve(&mut run, method, &mut team, 100);
    }
    assert_ne!(run.counters.relax_step, NEVER, "n = {n}: {:?}, {p:?}", run.counters);
    let p = &run.report.progress;
    [p.relax_high, p.relax_low, p.relax_fraction * p.relax_length].map(T::to_f64).iter().sum()
}

/// By how much ln excess falls per step, at the end of a step from `nodes`, by its derivative; and in that step, by
/// length and area alone, which are rounded.
fn slopes<T: Evolves>(nodes: &[DVec2]) -> [f64; 2] {
    let n = nodes.len();
    let p = parameters(n, &Flow::SurfaceDiffusion, 1.0);
    let mut run: Run<T> = started(nodes, p);
    let start = run.report.now;
    run.report.progress.next = T::of(2f64.powi(-8));
    (run.counters.goal, run.counters.order) = (1, 2);
    let method = Method::coloured(Solver::Direct, 1);
    Evolves::evolve(&mut run, &method, &mut Team::new(Blocks::new(n).unwrap()), 1);
    let [before, after] = [start, run.report.now].map(|at| (at.length * at.length / at.area).to_f64());
    let excess = run.report.now.excess.to_f64();
    [run.report.progress.slope.to_f64(), (after - before) / (4.0 * PI) / excess]
}

/// The median and the largest error of ellipses under some flows against f64.
fn errors(n: usize, geometric: bool, aspects: &[f64], flows: &[Flow]) -> [f64; 2] {
    let mut all = Vec::new();
    for aspect in aspects {
        let nodes = ellipse(n, *aspect);
        for flow in flows {
            let short = t_relax::<f32>(&nodes, flow, geometric);
            let long = t_relax::<f64>(&nodes, flow, geometric);
            all.push((short / long - 1.0).abs());
            println!(
                "n = {n}, {aspect}:1, {flow}, geometric {geometric}: {long:.6}, f32 off by {:.1e}",
                all[all.len() - 1]
            );
        }
    }
    all.sort_by(f64::total_cmp);
    [all[all.len() / 2], all[all.len() - 1]]
}

#[test]
fn times_in_f32_are_those_in_f64_up_to_400_nodes() {
    for (n, bounds) in BOUNDS {
        for geometric in [true, false] {
            let [median, worst] = errors(n, geometric, &ASPECTS, &plain_flows());
            assert!(median < bounds[0] && worst < bounds[1], "n = {n}, {geometric}: {median:e} {worst:e}");
        }
    }
}

/// Refined to 10⁻⁶ they are as near to f64 as direct solves. The control are sweeps to the tolerance of fixed steps.
#[test]
fn sweeps_in_f32_are_refined_like_direct_solves() {
    let errors = |tolerance: f64, sor: f64| {
        let sweeps = Method::coloured(Solver::GaussSeidel, 1_000_000);
        let mut all = Vec::new();
        for aspect in ASPECTS {
            let nodes = ellipse(100, aspect);
            for flow in plain_flows() {
                for geometric in [1.0, 0.0] {
                    let p = Parameters { geometric, tolerance, sor, ..parameters(100, &flow, TOLERANCE) };
                    let long = t_relax::<f64>(&nodes, &flow, geometric == 1.0);
                    all.push((t_relax_with::<f32>(&nodes, p, &sweeps) / long - 1.0).abs());
                    println!("{aspect}:1, {flow}, geometric {geometric}: {long:.6}, off by {:.1e}", all[all.len() - 1]);
                }
            }
        }
        all.sort_by(f64::total_cmp);
        println!(
            "sweeps to {tolerance:e} by {sor}: median {:.1e}, worst {:.1e}",
            all[all.len() / 2],
            all[all.len() - 1]
        );
        [all[all.len() / 2], all[all.len() - 1]]
    };
    let [median, worst] = errors(1e-6, 0.0);
    assert!(median < 1e-5 && worst < 5e-5, "{median:e} {worst:e}");
    let [_, worst] = errors(1e-3, 0.0);
    assert!(worst > 1e-4, "the control: {worst:e}");
}

/// Under flows of crystals, which have the geometric form only.
#[test]
fn times_of_crystals_in_f32_are_those_in_f64() {
    for (n, bounds) in &BOUNDS[..2] {
        let [median, worst] = errors(*n, true, &ASPECTS_OF_CRYSTALS, &crystals());
        assert!(median < bounds[0] && worst < bounds[1], "n = {n}: {median:e} {worst:e}");
    }
}

/// Steps grow at rest, where nothing but rounding is left to err in.
#[test]
fn a_circle_at_rest_stays_one() {
    for n in [200, 320, 400] {
        let mut p = parameters(n, &Flow::SurfaceDiffusion, 1e-3);
        (p.end_high, p.goal_high, p.clock_end, p.relax_at) = (8.0, 8.0, 8.0, -1.0);
        (p.half_at, p.follow_to) = (-1.0, 1e-6);
        (p.low, p.high) = (level(-1e18), level(1e18));
        let mut run: Run<f32> = started(&ellipse(n, 1.2), p);
        let before = run.report.now;
        run.report.progress.next = 1e-5;
        (run.counters.goal, run.counters.order) = (10_000, MOST_ORDER);
        let mut team = Team::new(Blocks::new(n).unwrap());
        while run.counters.is_running() && run.report.progress.time_high < 8.0 && run.counters.steps < 10_000 {
            Evolves::evolve(&mut run, &Method::coloured(Solver::Direct, 1), &mut team, 100);
        }
        let now = run.report.now;
        println!(
            "n = {n}: {} steps, excess {:e}, area by {:e}",
            run.counters.steps,
            now.excess,
            now.area / before.area
        );
        assert!(now.excess < 1e-4 && (now.area / before.area - 1.0).abs() < 0.01, "n = {n}: {now:?}");
    }
}

#[test]
fn the_slope_of_the_excess_in_f32_is_right_near_a_circle() {
    for n in [64, 100, 200] {
        for aspect in [1.005, 1.05, 1.5] {
            let nodes = ellipse(n, aspect);
            let ([short, rounded], [long, exact]) = (slopes::<f32>(&nodes), slopes::<f64>(&nodes));
            println!(
                "n = {n}, {aspect}:1: {long:.6}, in f32 off by {:.1e}, else {:.1e}",
                short / long - 1.0,
                rounded / exact - 1.0
            );
            assert!((short / long - 1.0).abs() < 5e-3, "n = {n}, {aspect}:1: {short} {long}");
            assert!(aspect > 1.01 || (rounded / exact - 1.0).abs() > 0.01, "the control passes: {rounded} {exact}");
        }
    }
}

#[test]
fn the_excess_in_f32_is_right_to_its_eighth_decimal() {
    let (mut worst, mut worst_quotient) = (0.0_f64, 0.0_f64);
    for n in [64, 100, 200] {
        for aspect in [1.0, 1.001, 1.05, 1.2] {
            let nodes = ellipse(n, aspect);
            let polygon_ratio = n as f64 / PI * (PI / n as f64).tan();
            let p = Parameters { polygon_ratio, ..Parameters::of_flow(&Flow::SurfaceDiffusion, 1.0) };
            let short: Run<f32> = Run::new(State::from_nodes(&nodes), p.convert());
            let rounded: Vec<DVec2> = short.state.curve.positions().collect();
            let exact = Run::<f64>::new(State::from_nodes(&rounded), p).report.now.excess;
            let now = short.report.now;
            let quotient = now.length * now.length / (4.0 * std::f32::consts::PI * now.area) - polygon_ratio as f32;
            worst = worst.max((f64::from(now.excess) - exact).abs());
            worst_quotient = worst_quotient.max((f64::from(quotient) - exact).abs());
        }
    }
    println!("{worst:e}; by the quotient of length and area {worst_quotient:e}");
    assert!(worst < 1e-8 && worst_quotient > 1e-7, "{worst:e} {worst_quotient:e}");
}

/// The control compares with nothing at rest, so that the energy and the area are summed themselves.
#[test]
fn the_excess_of_crystals_in_f32_is_right_to_its_seventh_decimal() {
    let (mut worst, mut worst_plain) = (0.0_f64, 0.0_f64);
    for flow in crystals() {
        for n in [64, 100, 200] {
            for aspect in [1.0, 1.05, 1.2] {
                let nodes: Vec<DVec2> = ellipse(n, aspect).iter().map(|node| *node + DVec2::new(0.3, -0.1)).collect();
                let polygon_ratio = flow.equilibrium().least_quotient(n);
                let plain = Parameters { polygon_ratio, ..Parameters::of_flow(&flow, 1.0) };
                let mut compared = plain;
                compared.compare_with(&nodes);
                compared.r_offset = 0.0;
                let [own, by_sums] = [compared, plain].map(|p| {
                    let short: Run<f32> = Run::new(State::from_nodes(&nodes), p.convert());
                    let rounded: Vec<DVec2> = short.state.curve.positions().collect();
                    let exact = Run::<f64>::new(State::from_nodes(&rounded), plain).report.now.excess;
                    (f64::from(short.report.now.excess) - exact).abs()
                });
                (worst, worst_plain) = (worst.max(own), worst_plain.max(by_sums));
            }
        }
    }
    println!("{worst:e}; by sums of energy and area {worst_plain:e}");
    assert!(worst < 1e-7 && worst_plain > 5e-7, "{worst:e} {worst_plain:e}");
}

/// Arithmetic of a compiler that is free with numbers: it reassociates and contracts them, divides by reciprocals, and
/// quotients and roots are off by one place in the last digit.
#[cfg(feature = "fast-math")]
mod fast_math {
    use std::{
        fmt,
        hint::black_box,
        ops::{Add, AddAssign, Div, Mul, Neg, Sub},
    };

    use curvelax_flow::{
        number::{
            Number, Precision, Real,
            place::{NodePlace, SingleNodePlace},
        },
        scheme::{
            Curve, Increments, Workspace,
            evolve::evolve_abreast,
            run::Group,
            step::{Stepped, Steps, step_by},
        },
        solver::Elimination,
    };

    use pulp::{Arch, Simd, WithSimd};

    use super::*;

    /// HELD: whether numbers that are to be [rounded](Number::rounded) are.
    #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, bytemuck::Pod, bytemuck::Zeroable)]
    #[repr(transparent)]
    struct Loose<const HELD: bool>(f32);

    /// The next number up or down.
    fn about<const HELD: bool>(exact: f32) -> Loose<HELD> {
        if !exact.is_normal() {
            return Loose(exact);
        }
        let bits = exact.to_bits();
        Loose(f32::from_bits(if (bits >> 3) & 1 == 0 { bits + 1 } else { bits - 1 }))
    }

    impl<const HELD: bool> fmt::Display for Loose<HELD> {
        fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
            self.0.fmt(f)
        }
    }

    macro_rules! operator {
        ($trait:ident $method:ident, $a:ident $b:ident => $result:expr) => {
            impl<const HELD: bool> $trait for Loose<HELD> {
                type Output = Loose<HELD>;
                #[inline(always)]
                fn $method(self, other: Loose<HELD>) -> Loose<HELD> {
                    let ($a, $b) = (self.0, other.0);
                    $result
                }
            }
        };
    }

    operator!(Add add, a b => Loose(a.algebraic_add(b)));
    operator!(Sub sub, a b => Loose(a.algebraic_sub(b)));
    operator!(Mul mul, a b => Loose(a.algebraic_mul(b)));
    operator!(Div div, a b => about(a.algebraic_div(b)));

    impl<const HELD: bool> AddAssign for Loose<HELD> {
        #[inline(always)]
        fn add_assign(&mut self, other: Loose<HELD>) {
            *self = *self + other;
        }
    }

    impl<const HELD: bool> Neg for Loose<HELD> {
        type Output = Loose<HELD>;
        #[inline(always)]
        fn neg(self) -> Loose<HELD> {
            Loose(-self.0)
        }
    }

    impl<const HELD: bool> NodePlace for Loose<HELD> {
        #[inline(always)]
        fn apart(from: Loose<HELD>, to: Loose<HELD>) -> Loose<HELD> {
            Loose(f32::apart(from.0, to.0))
        }
        #[inline(always)]
        fn moved(place: Loose<HELD>, by: Loose<HELD>) -> Loose<HELD> {
            Loose(f32::moved(place.0, by.0))
        }
        #[inline(always)]
        fn coordinate(place: Loose<HELD>) -> Loose<HELD> {
            Loose(f32::coordinate(place.0))
        }
        #[inline(always)]
        fn placed(at: Loose<HELD>) -> Loose<HELD> {
            Loose(f32::placed(at.0))
        }
    }

    impl<const HELD: bool> SingleNodePlace for Loose<HELD> {
        fn exact(place: Loose<HELD>) -> f64 {
            f32::exact(place.0)
        }
        fn nearest(at: f64) -> Loose<HELD> {
            Loose(f32::nearest(at))
        }
    }

    impl<const HELD: bool> Number for Loose<HELD> {
        type Real = Loose<HELD>;
        type Mask = bool;
        const LANES: usize = 1;
        const EPSILON: f64 = <f32 as Number>::EPSILON;
        const WHOLE: f64 = <f32 as Number>::WHOLE;
        fn of(value: f64) -> Loose<HELD> {
            Loose(value as f32)
        }
        fn rounded(self) -> Loose<HELD> {
            if HELD { Loose(self.0.max(-1e18)) } else { self }
        }
        fn lane(&self, _: usize) -> Loose<HELD> {
            *self
        }
        fn set_lane(&mut self, _: usize, value: Loose<HELD>) {
            *self = value;
        }
        #[inline(always)]
        fn sqrt(self) -> Loose<HELD> {
            about(self.0.sqrt())
        }
        fn abs(self) -> Loose<HELD> {
            Loose(self.0.abs())
        }
        fn max(self, other: Loose<HELD>) -> Loose<HELD> {
            Loose(Number::max(self.0, other.0))
        }
        fn min(self, other: Loose<HELD>) -> Loose<HELD> {
            Loose(Number::min(self.0, other.0))
        }
        fn exp2_integral(self) -> Loose<HELD> {
            Loose(self.0.exp2_integral())
        }
        fn le(self, other: Loose<HELD>) -> bool {
            self.0 <= other.0
        }
        fn select(mask: bool, yes: Loose<HELD>, no: Loose<HELD>) -> Loose<HELD> {
            if mask { yes } else { no }
        }
        /// Adding and subtracting a large number, which rounds, is no rounding here; WGSL has `floor`.
        fn small_floor(self) -> Loose<HELD> {
            Loose(self.0.floor())
        }
    }

    impl<const HELD: bool> Real for Loose<HELD> {
        const NAME: &'static str = "f32";
        const PRECISION: Precision = Precision::F32;
        fn to_f64(self) -> f64 {
            self.0.into()
        }
        fn floor(self) -> Loose<HELD> {
            Loose(self.0.floor())
        }
    }

    impl<const HELD: bool> Steps for Loose<HELD> {
        fn step(
            old: &Curve<Loose<HELD>>,
            increments: &mut Increments<Loose<HELD>>,
            p: &Parameters<Loose<HELD>>,
            method: &Method,
            work: &mut Workspace<Loose<HELD>>,
        ) -> Stepped<Loose<HELD>> {
            step_by::<Loose<HELD>, Elimination>(old, increments, p, p.branches(), true, method, work)
        }
    }

    /// Steps compiled for the best instructions of the processor: with those for a·b + c, which products and sums are
    /// contracted to.
    struct Evolving<'a, const HELD: bool>(&'a mut Run<Loose<HELD>>, &'a Method, &'a mut Team<Loose<HELD>>, u32);

    impl<const HELD: bool> WithSimd for Evolving<'_, HELD> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) {
            let Evolving(run, method, team, attempts) = self;
            for group in Group::of(&mut [run], 1) {
                evolve_abreast::<Loose<HELD>, Elimination>(group, method, team, attempts);
            }
        }
    }

    impl<const HELD: bool> Evolves for Loose<HELD> {
        fn evolve(run: &mut Run<Loose<HELD>>, method: &Method, team: &mut Team<Loose<HELD>>, attempts: u32) {
            Arch::new().dispatch(Evolving(run, method, team, attempts));
        }
    }

    /// The median and the largest error of ellipses under some flows against f64, and the largest beyond what the steps
    /// of f64 themselves leave: where rounding makes a member take another step, as at 400 nodes, it differs by a part
    /// of that.
    fn errors_of<const HELD: bool>(n: usize, geometric: bool, aspects: &[f64], flows: &[Flow]) -> [f64; 3] {
        let (mut all, mut most) = (Vec::new(), f64::NEG_INFINITY);
        for aspect in aspects {
            let nodes = ellipse(n, *aspect);
            for flow in flows {
                let loose = t_relax::<Loose<HELD>>(&nodes, flow, geometric);
                let short = t_relax::<f32>(&nodes, flow, geometric);
                let long = t_relax::<f64>(&nodes, flow, geometric);
                let off = loose / long - 1.0;
                println!(
                    "n = {n}, {aspect}:1, {flow}, geometric {geometric}: off by {off:.1e}, from f32 by {:.1e}",
                    loose / short - 1.0
                );
                assert!(loose != short, "nothing was reassociated");
                let of_steps = (long / t_relax_by::<f64>(&nodes, flow, geometric, 1e-5) - 1.0).abs();
                all.push(off.abs());
                most = most.max(off.abs() - of_steps);
            }
        }
        all.sort_by(f64::total_cmp);
        [all[all.len() / 2], all[all.len() - 1], most]
    }

    #[test]
    fn times_by_fast_mathematics_are_those_in_f64() {
        for (n, bounds) in BOUNDS {
            for geometric in [true, false] {
                let [median, largest, beyond] = errors_of::<true>(n, geometric, &ASPECTS, &plain_flows());
                let worst = if n < 400 { largest } else { beyond };
                // Twice as much: processors have other instructions, and rounding may add a step.
                let [of_median, of_worst] = bounds.map(|bound| 2.0 * bound);
                assert!(median < of_median && worst < of_worst, "n = {n}: {median:e} {worst:e}");
            }
        }
    }

    /// The control: products that neighbours share are contracted with the sums that take them.
    #[test]
    fn neighbours_must_see_the_same_products() {
        let (aspects, flows) = (&ASPECTS, &plain_flows());
        let held = errors_of::<true>(200, false, aspects, flows);
        let merged = errors_of::<false>(200, false, aspects, flows);
        assert!(merged[0] > 10.0 * held[0] && merged[1] > 3.0 * held[1], "{held:?} {merged:?}");
    }

    #[test]
    fn times_of_crystals_by_fast_mathematics_are_those_in_f64() {
        for (n, bounds) in &BOUNDS[..2] {
            let [median, worst, _] = errors_of::<true>(*n, true, &ASPECTS_OF_CRYSTALS, &crystals());
            assert!(median < 2.0 * bounds[0] && worst < 2.0 * bounds[1], "n = {n}: {median:e} {worst:e}");
        }
    }

    /// The control: what a sum of two numbers loses, which the next sums could make up for.
    #[test]
    fn what_a_sum_loses_cannot_be_told_by_fast_mathematics() {
        fn lost<N: Number>(a: N, b: N) -> N {
            let sum = a + b;
            let of_b = sum - a;
            (a - (sum - of_b)) + (b - of_b)
        }
        let [a, b] = [1.0_f32, 1e-8].map(black_box);
        assert_eq!((lost(a, b), lost(Loose::<true>(a), Loose(b)).0), (1e-8, 0.0));
    }
}
