use super::{coarse::row, *};
use crate::solver::{Order, direct, system::Row};

/// Sizes of every remainder by 8, primes, powers of two, and the smallest ones.
const SIZES: [usize; 21] = [6, 7, 8, 9, 10, 11, 12, 13, 23, 96, 99, 100, 101, 102, 103, 104, 127, 128, 255, 256, 512];
/// Longest τ; a circle of this size relaxes in 1/12.
const LONGEST: f64 = 1.0;
/// τ/h⁴, unless τ would be longer than `LONGEST`.
const STIFFNESSES: [f64; 6] = [0.06, 6.0, 60.0, 600.0, 6e4, 6e6];

/// A mesh: the jump of its spacings from node to node, and the ratio of its widest to its narrowest part.
#[derive(Clone, Copy, Debug)]
struct Mesh {
    jitter: f64,
    ratio: f64,
}

const MESHES: [Mesh; 3] =
    [Mesh { jitter: 0.0, ratio: 1.0 }, Mesh { jitter: 0.3, ratio: 1.0 }, Mesh { jitter: 0.05, ratio: 10.0 }];

/// `u/τ + ∂⁴u + p ∂²u + w ∂u` on a ring of length 2π, with p and w similar to those of a curve near the unit circle.
fn problem(n: usize, stiffness: f64, mesh: Mesh) -> (System<f64, 2>, Levels<f64, 2>) {
    let angle = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
    let noise = |i: usize| (12.9898 * i as f64 + 0.3).sin() * 43758.5453 % 1.0;
    let spacing = |i: usize| (0.5 * mesh.ratio.ln() * (2.0 * angle(i)).sin()).exp() * (1.0 + mesh.jitter * noise(i));
    let unit = std::f64::consts::TAU / (0..n).map(spacing).sum::<f64>();
    let tau = (stiffness * (std::f64::consts::TAU / n as f64).powi(4)).min(LONGEST);
    let mut levels = Levels::new(n);
    levels.rate = 1.0 / tau;
    let terms = &mut levels.terms;
    (0..n).for_each(|i| terms.spacing[i] = unit * spacing(i));
    terms.spacing.close();
    for i in 0..n {
        terms.cell[i] = 0.5 * (terms.spacing.window(i)[1] + terms.spacing[i]);
        terms.mass[i] = 1.0 / tau;
        terms.second[i] = 0.8 + 0.1 * (3.0 * angle(i)).cos();
        terms.first[i] = 0.3 * (2.0 * angle(i) + 1.0).sin();
    }
    terms.close();
    let reciprocal = |ring: &Ring<f64>| Ring::from_nodes(ring.nodes().iter().map(|v| 1.0 / v));
    let (id, iv) = (reciprocal(&terms.spacing), reciprocal(&terms.cell));
    let mut system = System::zeros(n);
    for i in 0..n {
        let mass = terms.cell[i] * terms.mass[i];
        let (row, inverse) = row(id.window(i), iv.window(i), [mass, terms.second[i], terms.first[i]]);
        system.rows[i] = Row { weight: tau * iv[i] / inverse, ..row };
        system.rhs[0][i] = mass * inverse * ((2.0 * angle(i)).sin() + 0.3 * (5.0 * angle(i)).cos() + 0.1 * noise(i));
        system.rhs[1][i] = mass * inverse * (angle(i).cos() + 0.1 * noise(i + n));
    }
    (system, levels)
}

fn control(tolerance: f64, max_sweeps: u32) -> Control<f64> {
    Control { tolerance, negligible: 0.0, sor: 1.0, max_sweeps, order: Order::Coloured }
}

/// The solution after a solve from zero, and the result of the solve.
fn solved(system: &System<f64, 2>, levels: &mut Levels<f64, 2>, control: Control<f64>) -> ([Ring<f64>; 2], Swept<f64>) {
    let n = system.rows.len();
    let mut unknown = [Ring::zeros(n), Ring::zeros(n)];
    let swept = solve(system, unknown.each_mut(), Blocks::new(n).unwrap(), &control, true, levels);
    (unknown, swept)
}

/// Largest error relative to the direct solution.
fn error(system: &System<f64, 2>, unknown: &[Ring<f64>; 2]) -> f64 {
    let n = system.rows.len();
    let mut exact = [Ring::zeros(n), Ring::zeros(n)];
    direct::solve(system, exact.each_mut(), &mut direct::Factor::new(n));
    let largest = |value: &dyn Fn(usize, usize) -> f64| {
        (0..2).flat_map(|f| (0..n).map(move |i| (f, i))).map(|(f, i)| value(f, i).abs()).fold(0.0, f64::max)
    };
    largest(&|f, i| unknown[f][i] - exact[f][i]) / largest(&|f, i| exact[f][i])
}

#[test]
fn a_cycle_halves_the_error_for_every_n_stiffness_and_mesh() {
    for mesh in MESHES {
        for stiffness in STIFFNESSES {
            let (mut worst, mut at) = (0.0_f64, 0);
            for n in SIZES {
                let (system, mut levels) = problem(n, stiffness, mesh);
                let mut after = |cycles| {
                    let (unknown, _) = solved(&system, &mut levels, control(1e-300, cycles * SWEEPS_PER_CYCLE));
                    error(&system, &unknown)
                };
                // Below this the errors are rounding.
                let (early, late) = (after(2), after(8).max(1e-13 * stiffness.max(1.0)));
                let factor = (late / early).powf(1.0 / 6.0);
                if early > 1e-9 && factor > worst {
                    (worst, at) = (factor, n);
                }
            }
            println!("jitter {}, ratio {}, τ/h⁴ = {stiffness:.0e}: {worst:.2} at n = {at}", mesh.jitter, mesh.ratio);
            assert!(worst < 0.5, "{mesh:?}, τ/h⁴ = {stiffness}: {worst} at n = {at}");
        }
    }
}

#[test]
fn cycles_reach_the_direct_solution_for_every_n() {
    for n in (6..70).chain(SIZES) {
        for stiffness in [0.06, 60.0, 6e4] {
            let (system, mut levels) = problem(n, stiffness, MESHES[1]);
            let (unknown, swept) = solved(&system, &mut levels, control(1e-9, 1000));
            assert!(swept.converged && swept.sweeps <= 70.0, "n = {n}, τ/h⁴ = {stiffness}: {swept:?}");
            let error = error(&system, &unknown);
            assert!(error < 1e-8, "n = {n}, τ/h⁴ = {stiffness}: {error:e}");
        }
    }
}

#[test]
fn interpolation_is_exact_for_cubics_on_any_mesh() {
    for n in [23, 24] {
        let (_, mut levels) = problem(n, 1.0, MESHES[2]);
        levels.build();
        let spacing = levels.terms.spacing.nodes();
        let place = |i: usize| spacing[..i].iter().sum::<f64>();
        let cubic = |i: usize| ((place(i) - 2.0) * (place(i) - 4.0) + 0.5) * place(i);
        let coarse = Ring::from_nodes((0..n / 2).map(|j| cubic(2 * j)));
        // Not across the ends, where the cubic jumps.
        let mut fine = Ring::zeros(n);
        levels.transfer.interpolate(&coarse, &mut fine, None);
        for (i, value) in fine.nodes().iter().enumerate() {
            let seam = i < 3 || i + 5 > n;
            assert!(seam || (value - cubic(i)).abs() < 1e-12, "n = {n}, node {i}: {value} for {}", cubic(i));
        }
        let sums = (0..n / 2).map(|j| levels.transfer.weights.iter().map(|w| w[j]).sum::<f64>());
        let odd: f64 = if n % 2 == 1 { levels.transfer.odd.iter().sum() } else { 1.0 };
        assert!(sums.chain([odd]).all(|sum| (sum - 1.0).abs() < 1e-12), "n = {n}");
    }
}

#[test]
fn the_cap_and_what_is_not_finite_are_reported() {
    let (mut system, mut levels) = problem(64, 600.0, MESHES[0]);
    let (_, swept) = solved(&system, &mut levels, control(1e-12, 3));
    assert!(!swept.converged && swept.finite && swept.sweeps == 3.0, "{swept:?}");
    system.rhs[1][17] = f64::NAN;
    let (unknown, swept) = solved(&system, &mut levels, control(1e-12, 100));
    assert!(!swept.converged && !swept.finite && swept.sweeps == 0.0, "{swept:?}");
    assert_eq!(unknown[0], Ring::zeros(64));
}

#[test]
fn the_inverse_of_the_coarsest_matrix_is_its_inverse() {
    for n in [12, 14, 16, 18, 20, 22] {
        let (_, mut levels) = problem(n, 60.0, MESHES[1]);
        levels.build();
        let coarsest = levels.coarse.last().unwrap();
        let m = coarsest.share.len();
        assert!((3..=COARSEST).contains(&m));
        for column in 0..m {
            let unknown = Ring::from_nodes((0..m).map(|j| levels.inverse[m * j + column]));
            for j in 0..m {
                let unit = f64::from(u8::from(j == column));
                let residual = coarsest.system.rows[j].residual(unit, unknown.window(j));
                assert!(residual.abs() < 1e-12, "n = {n}: {residual:e}");
            }
        }
    }
}
