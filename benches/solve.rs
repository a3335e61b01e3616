//! The cost of a step compared with the fastest loop for its two solves alone: `cargo bench -p curvelax-benches --bench
//! solve`.
//!
//! The loop is written for this purpose only: bands ready in memory, fused multiply-adds, the widest vectors, one
//! thread. It solves the same systems as a step, a periodic pentadiagonal one for k and one for x and y, and does
//! nothing else.

use bytemuck::cast;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::time::Duration;

use curvelax::{
    bench::{self, Bench},
    ensemble::{
        Spec,
        request::spec::{BackendChoice, Precision},
    },
    solver::Solver,
};
use pulp::{Arch, Simd, WithSimd};

const POINTS: usize = 100;
const WINDOW: Duration = Duration::from_millis(50);

/// One number per member, for members side by side.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Lanes<S: Simd>(S::f64s);

/// Bands and right-hand sides of a row, overwritten by its factor: `[a, b, c, d, e]` by `[-, -, -, d, e]`.
#[derive(Clone, Copy)]
struct Row<S: Simd, const F: usize> {
    bands: [Lanes<S>; 5],
    rhs: [Lanes<S>; F],
    /// Columns of the last two unknowns.
    border: [Lanes<S>; 2],
}

/// Solves `(1 + s D⁴) u = rhs` on a ring `rounds` times; returns a number that depends on all of it.
struct Solves<const F: usize> {
    rounds: usize,
}

impl<const F: usize> WithSimd for Solves<F> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let of = |value: f64| Lanes::<S>(simd.splat_f64s(value));
        let zero = of(0.0);
        let stiff = 3.0;
        let bands = [of(stiff), of(-4.0 * stiff), of(1.0 + 6.0 * stiff), of(-4.0 * stiff), of(stiff)];
        let given: Vec<Row<S, F>> =
            (0..POINTS).map(|i| Row { bands, rhs: [of((i as f64).sin()); F], border: [zero; 2] }).collect();
        let mut rows = vec![Row::<S, F> { bands: [zero; 5], rhs: [zero; F], border: [zero; 2] }; POINTS];
        let mut unknown = vec![[zero; F]; POINTS];
        let mut sum = 0.0;
        for _ in 0..self.rounds {
            solve(simd, std::hint::black_box(&given), &mut rows, &mut unknown);
            let last = std::hint::black_box(&unknown)[POINTS / 2][F - 1];
            sum += simd.reduce_sum_f64s(last.0);
        }
        sum
    }
}

#[inline(always)]
fn solve<S: Simd, const F: usize>(simd: S, given: &[Row<S, F>], rows: &mut [Row<S, F>], unknown: &mut [[Lanes<S>; F]]) {
    let core = given.len() - 2;
    let (zero, one) = (Lanes(simd.splat_f64s(0.0)), simd.splat_f64s(1.0));
    let none = Row { bands: [zero; 5], rhs: [zero; F], border: [zero; 2] };
    let (mut above2, mut above1): (Row<S, F>, Row<S, F>) = (none, none);
    for i in 0..core {
        let mut own = given[i];
        let [a, b, c, d, e] = own.bands;
        // The ends of the ring are in the border.
        match i {
            0 => own = Row { bands: [zero, zero, c, d, e], border: [a, b], ..own },
            1 => own = Row { bands: [zero, b, c, d, e], border: [zero, a], ..own },
            _ if i + 2 == core => own = Row { bands: [a, b, c, d, zero], border: [e, zero], ..own },
            _ if i + 1 == core => own = Row { bands: [a, b, c, zero, zero], border: [d, e], ..own },
            _ => {}
        }
        let [a, b, c, d, e] = own.bands;
        let b = minus(simd, b, a, above2.bands[3]);
        let c = minus(simd, minus(simd, c, a, above2.bands[4]), b, above1.bands[3]);
        let pivot = Lanes(simd.div_f64s(one, c.0));
        own.bands[3] = times(simd, minus(simd, d, b, above1.bands[4]), pivot);
        own.bands[4] = times(simd, e, pivot);
        for f in 0..F {
            own.rhs[f] = times(simd, minus(simd, minus(simd, own.rhs[f], a, above2.rhs[f]), b, above1.rhs[f]), pivot);
        }
        for s in 0..2 {
            own.border[s] =
                times(simd, minus(simd, minus(simd, own.border[s], a, above2.border[s]), b, above1.border[s]), pivot);
        }
        rows[i] = own;
        (above2, above1) = (above1, own);
    }
    let (mut below1, mut below2) = (none, none);
    for i in (0..core).rev() {
        let mut own = rows[i];
        let [.., d, e] = own.bands;
        for f in 0..F {
            own.rhs[f] = minus(simd, minus(simd, own.rhs[f], d, below1.rhs[f]), e, below2.rhs[f]);
        }
        for s in 0..2 {
            own.border[s] = minus(simd, minus(simd, own.border[s], d, below1.border[s]), e, below2.border[s]);
        }
        rows[i] = own;
        (below2, below1) = (below1, own);
    }
    // Rows core and core + 1 give the last two unknowns.
    let (p, q) = (given[core], given[core + 1]);
    let ([first, second], [before2, before1]) = ([rows[0], rows[1]], [rows[core - 2], rows[core - 1]]);
    let [pa, pb, pc, pd, pe] = p.bands;
    let [qa, qb, qc, qd, qe] = q.bands;
    let m00 =
        minus(simd, minus(simd, minus(simd, pc, pa, before2.border[0]), pb, before1.border[0]), pe, first.border[0]);
    let m01 =
        minus(simd, minus(simd, minus(simd, pd, pa, before2.border[1]), pb, before1.border[1]), pe, first.border[1]);
    let m10 =
        minus(simd, minus(simd, minus(simd, qb, qa, before1.border[0]), qd, first.border[0]), qe, second.border[0]);
    let m11 =
        minus(simd, minus(simd, minus(simd, qc, qa, before1.border[1]), qd, first.border[1]), qe, second.border[1]);
    let inverse = Lanes(simd.div_f64s(one, minus(simd, times(simd, m00, m11), m01, m10).0));
    for f in 0..F {
        let rp =
            minus(simd, minus(simd, minus(simd, p.rhs[f], pa, before2.rhs[f]), pb, before1.rhs[f]), pe, first.rhs[f]);
        let rq =
            minus(simd, minus(simd, minus(simd, q.rhs[f], qa, before1.rhs[f]), qd, first.rhs[f]), qe, second.rhs[f]);
        let s = times(simd, minus(simd, times(simd, rp, m11), rq, m01), inverse);
        let t = times(simd, minus(simd, times(simd, rq, m00), rp, m10), inverse);
        for i in 0..core {
            unknown[i][f] = minus(simd, minus(simd, rows[i].rhs[f], rows[i].border[0], s), rows[i].border[1], t);
        }
        (unknown[core][f], unknown[core + 1][f]) = (s, t);
    }
}

/// `c - a·b`, fused.
#[inline(always)]
fn minus<S: Simd>(simd: S, c: Lanes<S>, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    // pulp's negation of floating-point numbers is not inlined into its caller.
    let opposite = cast(simd.xor_u64s(cast(a.0), simd.splat_u64s((-0.0_f64).to_bits())));
    Lanes(simd.mul_add_f64s(opposite, b.0, c.0))
}

#[inline(always)]
fn times<S: Simd>(simd: S, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    Lanes(simd.mul_f64s(a.0, b.0))
}

/// Members in the widest vectors of this processor.
struct Width;

impl WithSimd for Width {
    type Output = usize;

    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F64_LANES
    }
}

/// The default ensemble on the CPU.
fn spec() -> Spec {
    bench::spec(POINTS, Spec { backend: BackendChoice::Cpu, ..Spec::default() }).expect("the default spec")
}

fn solves(c: &mut Criterion) {
    let lanes = Arch::new().dispatch(Width);
    let rounds = 256;
    let mut group = c.benchmark_group(format!("solve/f64/n={POINTS}, a curve"));
    group.throughput(Throughput::Elements((rounds * lanes) as u64));
    group.bench_function("best loop, k", |b| b.iter(|| Arch::new().dispatch(Solves::<1> { rounds })));
    group.bench_function("best loop, x and y", |b| b.iter(|| Arch::new().dispatch(Solves::<2> { rounds })));

    let spec = Spec { solver: Solver::Direct.into(), precision: Some(Precision::F64), threads: Some(1), ..spec() };
    let mut bench = Bench::open(&spec, WINDOW).expect("the CPU");
    group.bench_function("whole step", |b| {
        b.iter_custom(|iterations| {
            let wanted = iterations * (rounds * lanes) as u64;
            let (mut steps, mut elapsed) = (0, Duration::ZERO);
            while steps < wanted {
                let sample = bench.sample(WINDOW).expect("the CPU");
                (steps, elapsed) = (steps + sample.steps, elapsed + sample.elapsed);
            }
            elapsed.mul_f64(wanted as f64 / steps as f64)
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = solves
}
criterion_main!(benches);
