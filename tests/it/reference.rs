//! The f64 scheme against full-precision states of an independent implementation (`tests/data/README.md`).

use curvelax::{
    flow::Flow,
    scheme::{
        Parameters, State, Workspace,
        step::{Method, Steps},
    },
    solver::{Blocks, Solver},
};
use glam::DVec2;

/// One row of a reference file: `t, i, x, y, k, r`.
type Row = [f64; 6];

fn read(name: &str) -> Vec<(f64, Vec<Row>)> {
    let path = format!("{}/tests/data/reference/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let mut states: Vec<(f64, Vec<Row>)> = Vec::new();
    for record in csv::Reader::from_path(path).unwrap().deserialize() {
        let row: Row = record.unwrap();
        match states.last_mut() {
            Some((t, rows)) if *t == row[0] => rows.push(row),
            _ => states.push((row[0], vec![row])),
        }
    }
    states
}

/// Largest deviation over all stored times, per column relative to its largest entry.
fn worst_deviation(name: &str, flow: Flow, tau: f64, redistribution: bool) -> f64 {
    let states = read(name);
    assert!(states.len() > 3);
    let nodes: Vec<DVec2> = states[0].1.iter().map(|row| DVec2::new(row[2], row[3])).collect();
    let mut state = State::<f64>::from_nodes(&nodes);
    let mut work = Workspace::new(Blocks::new(nodes.len()).unwrap());
    let method = Method::coloured(Solver::Direct, 1);
    let mut p = Parameters::of_flow(&flow, tau);
    p.redistribution = f64::from(u8::from(redistribution));
    let (mut steps, mut worst) = (0, 0.0_f64);
    for (t, rows) in &states {
        while steps < (t / tau).round() as u64 {
            Steps::step(&state.curve, &mut state.increments, &p, &method, &mut work);
            std::mem::swap(&mut state.curve, &mut work.new);
            steps += 1;
        }
        for (column, field) in state.curve.fields().into_iter().enumerate() {
            let scale = rows.iter().map(|row| row[column + 2].abs()).fold(0.0, f64::max);
            for (row, value) in rows.iter().zip(field.nodes()) {
                worst = worst.max((row[column + 2] - value).abs() / scale);
            }
        }
        eprintln!("{name} t={t} {worst:e}");
    }
    worst
}

#[test]
fn surface_diffusion_with_redistribution_matches_the_reference() {
    let worst = worst_deviation("ref_sd_ellipse_2_1_n100_tau1e-3", Flow::SurfaceDiffusion, 1e-3, true);
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn surface_diffusion_with_fixed_nodes_matches_the_reference() {
    let worst = worst_deviation("ref_sd_ellipse_2_1_n100_tau1e-3_fixed_nodes", Flow::SurfaceDiffusion, 1e-3, false);
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn willmore_flow_matches_the_reference() {
    let worst = worst_deviation("ref_willmore_ellipse_2_1_n100_tau1e-3", Flow::Willmore, 1e-3, true);
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn the_nonconvex_curve_matches_the_reference() {
    let worst = worst_deviation("ref_sd_nonconvex_n100_tau1e-6", Flow::SurfaceDiffusion, 1e-6, true);
    assert!(worst < 1e-9, "{worst:e}");
}
