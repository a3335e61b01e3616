//! Ensembles through the program and the library: repetition, events, statuses, input.

use std::{collections::HashMap, fs, path::Path};

use curvelax::{
    backend::{Backend, cpu::CpuBackend},
    ensemble::{Family, Spec},
    scheme::{Parameters, State, Status, member::Counters, run::Run, step::Method},
    solver::Blocks,
};
use glam::DVec2;
use tempfile::TempDir;

use crate::common::{
    DIRECT, SWEEPS,
    command::curvelax,
    distance, nodes,
    program::{Done, FILES, Row, number, positions, run, run_with},
};

/// Prime numbers of members and nodes, more members than slots, output times on and between steps.
const MIXED: &str = "--curves 41 --points 61 --t-end 0.05 --series 0.0071 --snapshots 0,0.0123,0.05";

#[test]
fn equal_seeds_make_equal_bytes_whatever_the_threads() {
    let first = run(&format!("{MIXED} --threads 1")).texts();
    for again in ["--threads 1", "--threads 2", "--threads 3", ""] {
        assert!(run(&format!("{MIXED} {again}")).texts() == first, "{again}");
    }
    let other = run(&format!("{MIXED} --seed 2")).texts();
    assert!(FILES.iter().zip(first.iter().zip(&other)).all(|(_, (a, b))| a != b), "the seed does not matter");
    let mut rows: Vec<&str> = first[0].lines().map(|line| line.split_once(',').unwrap().1).collect();
    rows.sort_unstable();
    rows.dedup();
    assert_eq!(rows.len(), 42, "members are not all different");
}

#[test]
fn a_chosen_member_is_the_same_bit_for_bit() {
    let (all, only) = (run(MIXED), run(&format!("{MIXED} --only 37,3,7")));
    for name in FILES {
        let expected = all.lines_of(name, &[3, 7, 37]);
        assert!(!expected.is_empty());
        assert_eq!(only.text(name).lines().skip(1).collect::<Vec<_>>(), expected, "{name}");
    }
}

#[test]
fn a_member_that_stops_when_relaxed_ends_in_that_step() {
    let common = "--curves 7 --points 53 --t-end 1 --solver direct --series 0.1";
    let (whole, stopped) = (run(common), run(&format!("{common} --stop-when-relaxed")));
    let mut ends = Vec::new();
    for (whole, stopped) in whole.summary().iter().zip(stopped.summary()) {
        let (t_end, t_relax) = (number(&stopped, "t_end"), number(&stopped, "t_relax"));
        assert!(t_end - 0.001 <= t_relax && t_relax <= t_end && t_end < 1.0, "{t_relax} {t_end}");
        assert_eq!((&*stopped["status"], &*whole["status"]), ("relaxed", "relaxed"));
        for name in ["t_relax", "t_half", "length_start", "area_start", "excess_start"] {
            assert_eq!(whole[name], stopped[name], "{name}");
        }
        ends.push(stopped["t_end"].clone());
    }
    ends.dedup();
    assert!(ends.len() > 3, "members do not end at their own times: {ends:?}");
    for member in 0..7 {
        let [all, until] = [&whole, &stopped].map(|done| done.lines_of("series.csv", &[member]));
        assert_eq!(until, all[..until.len()], "member {member}");
        let t_end = number(&stopped.summary()[member as usize], "t_end");
        assert_eq!(until.len(), (t_end / 0.1).floor() as usize + 1, "member {member}");
    }
}

#[test]
fn a_circle_is_relaxed_before_its_first_step() {
    for stop in ["", "--stop-when-relaxed"] {
        let rows = run(&format!("--curves 3 --shape circle:0.7 --amplitude 0 --t-end 0.01 {stop}")).summary();
        for row in rows {
            assert_eq!((&*row["status"], number(&row, "t_relax")), ("relaxed", 0.0));
            assert_eq!(row["steps"], if stop.is_empty() { "10" } else { "0" });
        }
    }
}

/// The excess of mode 2 is proportional to the square of its amplitude, which decays at the rate 12/R⁴.
#[test]
fn a_small_mode_relaxes_when_the_linear_theory_says() {
    for (radius, sampling, bound) in
        [(1.0_f64, "parameter", 0.012), (1.0, "arclength", 0.006), (0.5, "arclength", 0.006)]
    {
        let unit = radius.powi(4);
        let outline: String = nodes(400, |u| radius * (1.0 + 0.01 * (2.0 * u).cos()) * DVec2::from_angle(u))
            .iter()
            .map(|node| format!("{:?},{:?}\n", node.x, node.y))
            .collect();
        let shape = if radius == 1.0 { "flower:2:0.01" } else { "file:flower.csv" };
        let (tau, t_end) = (1e-4 * unit, 0.25 * unit);
        let flags = format!("--shape {shape} --amplitude 0 --curves 1 --tau {tau} --t-end {t_end} --solver direct");
        let row = run_with(&[("flower.csv", &outline)], &format!("{flags} --sampling {sampling}")).summary().remove(0);
        for (name, fall) in [("t_relax", 100.0_f64), ("t_half", 2.0)] {
            let error = number(&row, name) / (fall.ln() / 24.0 * unit) - 1.0;
            eprintln!("R = {radius}, {sampling}: {name} is off by {error:.2e}");
            assert!(error.abs() < bound, "{sampling}: {name} is {}", row[name]);
        }
    }
}

/// Members by status in the summary.
fn members_by_status(rows: &[Row]) -> HashMap<String, Vec<u64>> {
    rows.iter().fold(HashMap::new(), |mut members, row| {
        members.entry(row["status"].clone()).or_insert_with(Vec::new).push(row["member"].parse().unwrap());
        members
    })
}

#[test]
fn too_few_sweeps_stall_every_member() {
    let rows = run("--curves 5 --max-sweeps 8 --t-end 0.01").summary();
    for row in rows {
        assert_eq!((&*row["status"], &*row["steps"], &*row["sweeps_k"]), ("stalled", "0", "8"));
        assert_eq!((&*row["t_relax"], &*row["t_half"], &*row["t_end"]), ("", "", "0.0"));
        for end in ["length", "area", "excess", "energy"] {
            assert_eq!(row[&format!("{end}_end")], row[&format!("{end}_start")]);
        }
    }
}

/// A step far too large for the shape ends members in different ways; the survivors are not affected.
#[test]
fn members_that_fail_leave_the_others_alone() {
    for (flags, failures) in [
        ("--shape nonconvex --curves 23 --tau 1e-4 --t-end 0.02 --max-sweeps 20000", &["stalled"][..]),
        ("--shape flower:3:0.3,5:0.5 --points 64 --amplitude 0.1 --curves 23 --tau 0.001 --t-end 0.1", &["singular"]),
        ("--curves 23 --points 61 --t-end 0.02 --max-sweeps 64", &["stalled"]),
    ] {
        let done = run(flags);
        let by_status = members_by_status(&done.summary());
        eprintln!("{flags}: {by_status:?}");
        for failure in failures {
            assert!(by_status.contains_key(*failure), "{flags}: no member is {failure}");
        }
        let good = |status: &str| by_status.get(status).cloned().unwrap_or_default();
        let survivors = [good("relaxed"), good("unfinished")].concat();
        assert!(!survivors.is_empty(), "{flags}: no member survives");
        let only: Vec<String> = survivors.iter().map(u64::to_string).collect();
        let alone = run(&format!("{flags} --only {}", only.join(",")));
        assert_eq!(alone.lines_of("summary.csv", &survivors), done.lines_of("summary.csv", &survivors), "{flags}");
    }
}

/// If the step is too large, k and r drift from x, and the curve shrinks to a point that looks round.
#[test]
fn a_curve_that_its_metric_has_left_is_never_called_relaxed() {
    let flags = "--shape nonconvex --sampling parameter --curves 48 --tau 1e-4 --t-end 0.2 --solver direct";
    for row in run(flags).summary() {
        let kept = number(&row, "area_end") / number(&row, "area_start");
        let drift = number(&row, "metric_drift");
        assert!(row["status"] == "singular" || drift < 1.0, "{}: area times {kept:e}, drift {drift:e}", row["status"]);
    }
}

/// An immersed curve has no circle to relax to.
#[test]
fn a_figure_eight_with_unequal_lobes_ends_singular() {
    let eight = |t: f64| DVec2::new(t.sin() * (1.0 + 0.3 * t.sin()), t.sin() * t.cos() * (1.0 + 0.3 * t.sin()));
    let file: String = nodes(101, eight).iter().map(|node| format!("{:?},{:?}\n", node.x, node.y)).collect();
    let home = TempDir::new().unwrap();
    fs::write(home.path().join("eight.csv"), &file).unwrap();
    for tau in ["1e-4", "1e-5"] {
        let flags = format!("--shape file:eight.csv --amplitude 0 --curves 1 --tau {tau} --t-end 0.2 --solver direct");
        let row = run_quiet_with_warning(home.path(), &flags, tau);
        eprintln!(
            "eight, τ = {tau}: {} at {}, area {} to {}",
            row["status"], row["t_end"], row["area_start"], row["area_end"]
        );
        assert_eq!((&*row["status"], &*row["turning"]), ("singular", "0"));
    }
}

fn run_quiet_with_warning(home: &Path, flags: &str, out: &str) -> Row {
    let output = curvelax(home, &format!("run --backend cpu --out {out} {flags}"));
    assert_eq!(output.status.code(), Some(3), "its one member fails");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("crosses"), "no warning of the crossing: {said}");
    let mut reader = csv::Reader::from_path(home.join(out).join("summary.csv")).unwrap();
    reader.deserialize().next().unwrap().unwrap()
}

/// Runs `launches` on the CPU until they end; returns their counters and final states.
fn advance(launches: &[Run<f64>], method: Method) -> Vec<(Counters, State<f64>)> {
    let n = launches[0].state.curve.len();
    let mut backend = CpuBackend::<f64>::new(Blocks::new(n).unwrap(), method, 2).unwrap();
    for (slot, launch) in launches.iter().enumerate() {
        backend.load(slot, launch).unwrap();
    }
    while (0..launches.len()).any(|slot| backend.counters(slot).is_running()) {
        backend.advance().unwrap();
    }
    (0..launches.len()).map(|slot| (backend.counters(slot), backend.state(slot).unwrap())).collect()
}

#[test]
fn a_poisoned_member_is_nonfinite_and_alone_in_it() {
    let family = Family::new(&Spec { points: 37, ..Spec::default() }).unwrap();
    let launch = |nodes: &[DVec2]| {
        let parameters = Parameters::of_flow(&curvelax::flow::Flow::SurfaceDiffusion, 1e-3);
        let mut run = Run::new(State::from_nodes(nodes), Parameters { relax_at: -1.0, half_at: -1.0, ..parameters });
        run.counters.goal = 97;
        run
    };
    let curves: Vec<Vec<DVec2>> = (0..7).map(|j| family.member(j).unwrap().nodes).collect();
    let healthy: Vec<Run<f64>> = curves.iter().map(|nodes| launch(nodes)).collect();
    for method in [SWEEPS, DIRECT] {
        let expected = advance(&healthy, method);
        assert!(expected.iter().all(|(counters, _)| (counters.status, counters.steps) == (0, 97)));
        for poison in [f64::NAN, f64::INFINITY, 1e200] {
            let mut sick = healthy.clone();
            let mut nodes = curves[3].clone();
            nodes[11].x = poison;
            sick[3] = launch(&nodes);
            let found = advance(&sick, method);
            let (counters, _) = &found[3];
            assert_eq!((counters.status, counters.steps), (Status::Nonfinite as u32, 0), "{poison}, {method:?}");
            for (j, (found, expected)) in found.iter().zip(&expected).enumerate().filter(|(j, _)| *j != 3) {
                assert!(found == expected, "{poison}: member {j} has changed");
            }
        }
    }
}

/// A lopsided outline of 61 points, as the text of a file.
fn outline(offset: DVec2, order: impl Fn(usize) -> usize) -> String {
    let bean = |u: f64| DVec2::from_angle(u) * (1.0 + 0.2 * (2.0 * u).cos() + 0.1 * (3.0 * u).sin());
    let points = nodes(61, bean);
    (0..61).map(|i| points[order(i) % 61] + offset).map(|p| format!("{:?},{:?}\n", p.x, p.y)).collect()
}

fn outline_run(text: &str, more: &str) -> Done {
    let flags = "--shape file:bean.csv --amplitude 0 --curves 1 --t-end 0.1 --snapshots 0,0.0505,0.1";
    let solver = if more.contains("f32") { "gauss-seidel" } else { "direct" };
    run_with(&[("bean.csv", text)], &format!("{flags} {more} --solver {solver}"))
}

#[test]
fn a_clockwise_file_is_the_same_curve() {
    let forwards = outline(DVec2::ZERO, |i| i);
    // From the same first point in the opposite direction, the nodes are the same.
    let backwards = outline(DVec2::ZERO, |i| 61 - i);
    for sampling in ["--sampling points", "--sampling points --no-redistribution"] {
        let [a, b] = [&forwards, &backwards].map(|text| outline_run(text, sampling));
        assert_eq!(a.text("summary.csv"), b.text("summary.csv"));
        assert_eq!(a.text("snapshots.csv"), b.text("snapshots.csv"));
        assert!(number(&a.summary()[0], "area_start") > 0.0);
    }
    // From another first point the nodes are numbered differently (and without redistribution no node is special).
    let turned = outline(DVec2::ZERO, |i| 61 + 60 - i);
    let [a, b] = [&forwards, &turned].map(|text| outline_run(text, "--sampling points --no-redistribution"));
    let [a, b] = [a, b].map(|done| done.rows("snapshots.csv").chunks(61).map(positions).collect::<Vec<_>>());
    for (a, mut b) in a.into_iter().zip(b) {
        b.rotate_left(1);
        let apart = distance(&a, &b);
        assert!(apart < 1e-11, "{apart:e}");
    }
    // Sampled by arclength, the two files describe one polygon through the same points.
    let [a, b] = [&forwards, &backwards].map(|text| outline_run(text, "--points 61").summary().remove(0));
    for name in ["length_end", "area_end", "excess_end", "t_half"] {
        assert!((number(&a, name) / number(&b, name) - 1.0).abs() < 1e-9, "{name}: {} {}", a[name], b[name]);
    }
}

/// At 10⁶ a coordinate is rounded to 10⁻¹⁰; nothing else is lost, because the state is centred.
#[test]
fn a_file_far_away_relaxes_as_one_at_home() {
    let far = DVec2::new(1e6, -1e6);
    for sampling in ["--sampling points", "--points 67", "--sampling points --precision f32"] {
        let home = outline_run(&outline(DVec2::ZERO, |i| i), sampling);
        let away = outline_run(&outline(far, |i| i), sampling);
        let bound = if sampling.contains("f32") { 1e-5 } else { 1e-8 };
        let [a, b] = [&home, &away].map(|done| done.summary().remove(0));
        for name in ["length_end", "area_end", "excess_end", "energy_end", "k_max", "t_half"] {
            // The excess is a difference of numbers near 1.
            let error = (number(&b, name) - number(&a, name)) / number(&a, name).max(1.0);
            assert!(error.abs() < bound, "{sampling}, {name}: {} and {}", a[name], b[name]);
        }
        let [a, mut b] = [home, away].map(|done| positions(&done.rows("snapshots.csv")));
        b.iter_mut().for_each(|node| *node -= far);
        let apart = distance(&a, &b);
        eprintln!("{sampling}: {apart:.1e} apart");
        assert!(apart < bound, "{sampling}: {apart:e}");
    }
}

/// A figure eight with lobes of different size, as a file.
fn figure_eight() -> String {
    let point = |i: usize| {
        let (sin, cos) = (std::f64::consts::TAU * i as f64 / 120.0).sin_cos();
        let size = if cos > 0.0 { 1.8 } else { 1.0 };
        format!("{},{}\n", size * cos, size * sin * cos)
    };
    "x,y\n".to_string() + &(0..120).map(point).collect::<String>()
}

#[test]
fn a_curve_that_is_not_simple_is_never_called_relaxed() {
    let flags = "--shape file:eight.csv --curves 1 --amplitude 0 --tau 1e-5 --t-end 0.1 --relax-to 0.5 --solver direct";
    let row = run_with(&[("eight.csv", &figure_eight())], flags).summary().remove(0);
    assert_ne!(row["turning"], "1", "the curve is simple, and the test tests nothing");
    assert_ne!(row["status"], "relaxed");
    assert_eq!((&*row["t_relax"], &*row["t_half"]), ("", ""));
}

#[test]
fn a_threshold_in_the_rounding_of_the_excess_gives_no_relaxation_time() {
    let flags = "--shape circle:1 --amplitude 0.0005 --modes 2..=4 --t-end 0.6 --curves 4 --solver direct";
    let single = run(&format!("{flags} --precision f32"));
    for row in single.summary() {
        assert_eq!((&*row["status"], &*row["t_relax"]), ("unfinished", ""), "excess {}", row["excess_start"]);
    }
    for row in run(flags).summary() {
        assert_eq!(row["status"], "relaxed");
    }
}
