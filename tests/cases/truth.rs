//! The scheme against exact solutions: every problem of the table on the CPU in both precisions by both solvers, and on
//! the GPU. Each comparison has a negative control: the result of a known mistake fails the same bound.
//!
//! A missed bound means an error, not that the bound is too tight. Without an adapter, GPU cases fail, unless
//! `ALLOW_NO_GPU=1`: then they are reported as ignored.

mod controls;

use crate::{everything, may_lack_gpu};
use controls::Control;
use curvelax::{
    backend::gpu::Gpu,
    ensemble::{
        Ended, Spec, Status, Study,
        request::spec::{BackendChoice, Precision, Solver},
    },
    flow::Flow,
    relax,
    scheme::{Parameters, State, Workspace, curvature::Curvature, position::Position, redistribution, step::Steps},
    solver::{Blocks, Memory, direct},
    truth::{Beside, ConvergenceRow, LEMNISCATE_LIFE, Measure, Problem, Solved, Varied, problems, studies},
};
use glam::DVec2;
use libtest_mimic::{Failed, Trial};

use crate::common::{DIRECT, Stepper, radius, slope, wavy_circle};

type Outcome = Result<(), Failed>;

/// The tests of all problems by all methods.
pub fn trials() -> Vec<Trial> {
    let mut trials = vec![
        Trial::test("errors fall at order two in h and one in tau, within their bounds", orders),
        Trial::test("the Willmore circle under tau = h² has the published errors", willmore_circle),
        Trial::test("the misprint of the paper fails the bound and does not converge", misprint),
    ];
    let gpu = Gpu::list().into_iter().next();
    let allowed = may_lack_gpu();
    for backend in [BackendChoice::Cpu, BackendChoice::Gpu] {
        for precision in [Precision::F64, Precision::F32] {
            let on_gpu = backend == BackendChoice::Gpu;
            if on_gpu && precision == Precision::F64 && gpu.as_ref().is_some_and(|gpu| !gpu.has_f64()) {
                continue;
            }
            // On a GPU each solver and each precision once: conformance compares all kernels with the CPU.
            let precise = gpu.as_ref().is_none_or(|gpu| gpu.capacity().best_precision() == precision);
            let by_sweeps = everything() && precision == Precision::F32;
            let is_wanted = |solver: Solver| !on_gpu || if solver.sweeps() { by_sweeps } else { precise };
            for solver in Solver::ALL.into_iter().filter(|solver| is_wanted(*solver)) {
                let method = Spec { backend, precision: Some(precision), solver: solver.into(), ..Spec::default() };
                for problem in problems() {
                    let name = format!("{backend:?} {precision:?} {solver:?}: {}", problem.name).to_lowercase();
                    let method = method.clone();
                    let ignored = on_gpu && gpu.is_none() && allowed;
                    trials.push(Trial::test(name, move || judge(&problem, &method)).with_ignored_flag(ignored));
                }
                if on_gpu && precision == Precision::F64 && solver == Solver::Direct {
                    let name = "gpu f64 direct: a driven ellipse vanishes when it does on the CPU";
                    let ignored = gpu.is_none() && allowed;
                    trials.push(Trial::test(name, vanishing).with_ignored_flag(ignored));
                }
                let name = format!("{backend:?} {precision:?} {solver:?}: the lemniscate vanishes").to_lowercase();
                let ignored = on_gpu && gpu.is_none() && allowed;
                trials.push(Trial::test(name, move || extinction(&method)).with_ignored_flag(ignored));
            }
        }
    }
    trials
}

/// Whether a run is within its bound of the exact value, and not within it of the mistaken one.
fn judge(problem: &Problem, method: &Spec) -> Outcome {
    let control = Control::of(problem);
    let at = control.resolution();
    let Solved { ratio, outcome, precision, .. } = problem.solve(method, at).map_err(|e| e.to_string())?;
    let Some(ratio) = ratio else {
        return Err(format!("ended as {} at t = {}", outcome.status.name(), outcome.t_end).into());
    };
    let (error, bound) = (ratio - 1.0, control.bound_at(at, precision));
    let mistaken = ratio * problem.exact / control.mistaken - 1.0;
    let line = format!("{}: error {error:+.2e}, bound {bound:.2e}; {}: {mistaken:+.2e}", problem.name, control.mistake);
    println!("{line}");
    if error.abs() <= bound && mistaken.abs() > bound { Ok(()) } else { Err(line.into()) }
}

/// The lemniscate ends exactly when its life is over, and not as relaxed: as singular, or with sweeps as stalled,
/// because they diverge in the step across the end.
fn extinction(method: &Spec) -> Outcome {
    let mut problem = Problem::named("lemniscate").map_err(|e| e.to_string())?;
    problem.t_end = 1.2 * LEMNISCATE_LIFE;
    let Solved { outcome, .. } = problem.solve(method, problem.in_steps(66, 1000)).map_err(|e| e.to_string())?;
    let life = outcome.t_end / LEMNISCATE_LIFE;
    let line = format!("{} after {life:.4} of its life", outcome.status.name());
    println!("{line}");
    let expected = if method.solver().sweeps() { Status::Stalled } else { Status::Singular };
    if outcome.status == expected && (life - 1.0).abs() < 0.01 { Ok(()) } else { Err(line.into()) }
}

/// A member that vanishes has its time on both back ends; with a force larger by a part in 10⁵ it is another one.
fn vanishing() -> Outcome {
    let t_vanish = |backend, force: f64| -> Result<f64, Failed> {
        let text = format!(
            "shape = 'ellipse:1.5,1'\ncurves = 1\namplitude = 0\npoints = 66\nadaptive = 1e-4\npull = 'auto'\n\
             t-end = 'auto'\nprecision = 'f64'\ndrive = {force}"
        );
        let spec = Spec { backend, ..Spec::from_toml(&text).map_err(|e| e.to_string())? };
        let mut members: Vec<Ended> = Vec::new();
        relax(&Study::new(spec).map_err(|e| e.to_string())?, &mut members).map_err(|e| e.to_string())?;
        let outcome = &members[0].outcome;
        match (outcome.status, outcome.t_vanish) {
            (Status::Vanished, Some(t)) => Ok(t),
            (status, t) => Err(format!("{backend:?}: {} with t_vanish {t:?}", status.name()).into()),
        }
    };
    let exact = t_vanish(BackendChoice::Cpu, 0.5)?;
    let [own, other] = [t_vanish(BackendChoice::Gpu, 0.5)?, t_vanish(BackendChoice::Gpu, 0.5 * (1.0 + 1e-5))?]
        .map(|t| (t / exact - 1.0).abs());
    println!("t_vanish {exact} on the CPU; on the GPU off by {own:e}, and by {other:e} with another force");
    if own <= 1e-6 && other > 1e-6 { Ok(()) } else { Err(format!("{own:e} {other:e}").into()) }
}

/// The method for which errors are those of the scheme alone.
fn reference() -> Spec {
    let (backend, precision) = (BackendChoice::Cpu, Some(Precision::F64));
    Spec { backend, precision, solver: Solver::Direct.into(), ..Spec::default() }
}

/// Compares the errors in time, those against the tightest tolerance, with the tolerances, of which they may be so
/// many; counts those above a hundredth of it.
fn within_tolerance(rows: &[ConvergenceRow], most: f64, above_a_hundredth: &mut usize) -> Outcome {
    let errors: Vec<f64> = rows.iter().filter_map(|row| row.error).collect();
    for (row, error) in rows.iter().zip(&errors).take(rows.len() - 1) {
        let (tolerance, in_time) = (row.at.tolerance.ok_or("no tolerance")?, (error - errors[rows.len() - 1]).abs());
        if in_time > most * tolerance {
            return Err(
                format!("{}: an error of {in_time:e} in time at the tolerance {tolerance:e}", row.problem).into()
            );
        }
        *above_a_hundredth += usize::from(in_time > 0.01 * tolerance);
    }
    Ok(())
}

fn orders() -> Outcome {
    let mut above_a_hundredth = 0;
    for problem in problems() {
        let control = Control::of(&problem);
        for study in studies(&problem, Solver::Direct) {
            let rows = study.rows(&problem, &reference()).map_err(|e| e.to_string())?;
            for row in &rows {
                let error = row.error.ok_or("ended early")?;
                let bound = control.bound_at(row.at, Precision::F64);
                println!("{}, {:?}: error {error:+.2e}, bound {bound:.2e}", problem.name, row.at);
                if error.abs() > bound && row.at.tolerance.is_none() {
                    return Err(format!("{}, {:?}: error {error:e} above {bound:e}", problem.name, row.at).into());
                }
            }
            // Errors of steps of several orders cancel now and then, which leaves no order to be seen: what counts is
            // that the error in time is below the tolerance.
            if study.varied == Varied::Tolerance {
                // Decays of small modes in the geometric form are off by five tolerances, and by eleven where the
                // position equation damps what the flow itself does not.
                let most = match problem.beside {
                    Beside::Nothing => 0.7,
                    Beside::Conserved(_) => 14.0,
                    _ => 7.0,
                };
                within_tolerance(&rows, most, &mut above_a_hundredth)?;
                continue;
            }
            // Steps that leave no error have no order.
            let errors = || rows.iter().filter_map(|row| row.error);
            let spread = errors().fold(f64::MIN, f64::max) - errors().fold(f64::MAX, f64::min);
            if study.varied == Varied::Step && control.bound.time < 1e-8 && spread < control.bound.time {
                continue;
            }
            let last = rows.last().and_then(|row| row.order);
            let found = last.ok_or_else(|| format!("{}: no order in {}", problem.name, study.varied.name()))?;
            // The lemniscate is so near its end that 400 steps do not yet show the full order.
            let (order, margin) = match (study.varied, problem.name.as_str()) {
                // Fifty nodes do not yet resolve the four waves of a crystal.
                (Varied::Nodes, "crystal-wave") => (2.0, 0.15),
                (Varied::Nodes, _) => (2.0, 0.1),
                // Nor do those of the geometric form.
                (_, "lemniscate" | "area-kept-mode-2" | "length-kept-mode-2" | "crystal-wave") => (1.0, 0.2),
                _ => (1.0, 0.1),
            };
            println!("{}, order in {}: {found:.3}", problem.name, study.varied.name());
            if (found - order).abs() > margin {
                return Err(format!("{}: order {found} in {}", problem.name, study.varied.name()).into());
            }
        }
    }
    // The negative control: a bound a hundred times as tight would fail.
    if above_a_hundredth < 10 {
        return Err(format!("{above_a_hundredth}: the errors in time have become too small to compare").into());
    }
    Ok(())
}

/// `R(1) = 3^(1/4)`: the errors of an independent program.
fn willmore_circle() -> Outcome {
    let exact = 3.0_f64.powf(0.25);
    let errors = [10, 20, 40, 80, 160].map(|n| {
        let p = Parameters::of_flow(&Flow::Willmore, 1.0 / (n * n) as f64);
        let curve = Stepper::<f64>::new(&wavy_circle(n, 1.0, 2, 0.0), &p, DIRECT).steps(n * n);
        (n, (radius(&curve.positions()) - exact).abs())
    });
    let order = -slope(&errors.map(|(n, error)| ((n as f64).ln(), error.ln())));
    println!("Willmore circle: {errors:?}, order {order:.4}");
    assert!((order - 2.0).abs() < 0.05, "order {order}");
    for ((n, error), published) in errors.into_iter().zip([2.47e-2, 6.2e-3, 1.56e-3, 3.9e-4]) {
        assert!((error / published - 1.0).abs() < 0.02, "n = {n}: {error:e} instead of {published:e}");
    }
    Ok(())
}

/// Mode 2 under surface diffusion by the scheme as the paper prints it.
fn misprint() -> Outcome {
    let problem = Problem::named("surface-diffusion-mode-2").map_err(|e| e.to_string())?;
    for n in [50, 100, 200] {
        let at = problem.in_steps(n, 400);
        let error = |step: fn(&mut Linear)| {
            let p = Parameters::of_flow(&problem.flow, problem.t_end / 400.0);
            let before = wavy_circle(n, 1.0, 2, 1e-4);
            let mut curve =
                Linear { state: State::from_nodes(&before), work: Workspace::new(Blocks::new(n).unwrap()), p };
            (0..400).for_each(|_| step(&mut curve));
            let after: Vec<DVec2> = curve.state.curve.positions().collect();
            Measure::Decay(2).of(&before, &after) / problem.exact - 1.0
        };
        let (correct, printed) = (error(correct_step), error(misprinted_step));
        let bound = Control::of(&problem).bound_at(at, Precision::F64);
        println!("n = {n}: error {correct:+.2e}, as printed {printed:+.2e}, bound {bound:.2e}");
        assert!(correct.abs() <= bound, "n = {n}: {correct:e}");
        assert!(printed > 1.0, "n = {n}, as printed: {printed:e}");
    }
    Ok(())
}

/// A circle with a small mode.
struct Linear {
    state: State<f64>,
    work: Workspace<f64>,
    p: Parameters<f64>,
}

fn correct_step(Linear { state, work, p }: &mut Linear) {
    Steps::step(&state.curve, &mut state.increments, p, &DIRECT, work);
    std::mem::swap(&mut state.curve, &mut work.new);
}

/// A step whose 𝓑_i has `φ(k_i) + φ(k_{i-1})`, as printed in the paper.
fn misprinted_step(Linear { state, work, p }: &mut Linear) {
    let State { curve, increments, .. } = state;
    let Workspace { blocks, motion, new, curvature, position, .. } = work;
    let Memory { system: curvature, factor, .. } = curvature;
    let Memory { system: position, factor: factor_of_both, .. } = position;
    redistribution::redistribute(curve, p, p.branches(), *blocks, motion, &mut new.r);
    curvature.assemble(&Curvature::new(curve, new, motion, p));
    direct::solve(curvature, [&mut increments.k], factor);
    (0..curve.len()).for_each(|i| new.k[i] = curve.k[i] + increments.k[i]);
    new.k.close();

    position.assemble(&Position::new(curve, new, motion, p, p.branches()));
    let law = p.law(p.branches().law);
    for i in 0..curve.len() {
        let ([_, before, _, after, _], ir) = (new.k.window(i), motion.ir[i]);
        let change = 0.5 * (law.phi(before) - law.phi(after)) * ir;
        let row = &mut position.rows[i];
        // The diagonal is q/τ minus the other entries, so it changes by the same amount in the opposite direction.
        let c = row.weight / (p.tau * motion.iq[i]);
        let rescale = c / (c - change);
        for (rhs, old) in position.rhs.iter_mut().zip([&curve.x, &curve.y]) {
            let [_, before, here, ..] = old.window(i);
            rhs[i] = (rhs[i] - change / c * (before - here)) * rescale;
        }
        row.b += change / c;
        [row.a, row.b, row.d, row.e] = [row.a, row.b, row.d, row.e].map(|entry| entry * rescale);
    }
    direct::solve(position, [&mut increments.x, &mut increments.y], factor_of_both);
    for i in 0..curve.len() {
        new.x[i] = curve.x[i] + increments.x[i];
        new.y[i] = curve.y[i] + increments.y[i];
    }
    new.x.close();
    new.y.close();
    std::mem::swap(curve, new);
}
