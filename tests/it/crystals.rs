//! Crystals from outside, against numbers of an independent spectral program (128 to 256 directions): a 2:1 ellipse
//! under four surface energies, the Wulff shape, and the decay of its perturbations.

use std::f64::consts::{PI, TAU};

use curvelax::{crystal::Energy, ensemble::outcome::wulff_distance};
use glam::DVec2;

use crate::common::program::{Done, column, number, positions, run, run_with};

const TIMES: [f64; 6] = [0.01, 0.05, 0.1, 0.2, 0.5, 1.0];

/// Flags, L and E at the times.
const ELLIPSES: [(&str, [f64; 6], [f64; 6]); 4] = [
    (
        "--energy cos:2,0.1",
        [9.6452715, 9.5357792, 9.4337541, 9.2805466, 9.0595928, 8.9729567],
        [9.1972606, 9.1253397, 9.0560886, 8.9578669, 8.8439284, 8.8201508],
    ),
    (
        "--energy cos:3,0.05",
        [9.6342420, 9.5060432, 9.3851727, 9.2051188, 8.9802328, 8.9329311],
        [9.6092034, 9.4582768, 9.3240836, 9.1299501, 8.8935157, 8.8437645],
    ),
    (
        "--energy cos:4,0.03",
        [9.6368093, 9.4836707, 9.3415648, 9.1433652, 8.9424281, 8.9165084],
        [9.6884077, 9.5272702, 9.3686660, 9.1364509, 8.8892524, 8.8564870],
    ),
    (
        "--energy cos:4,0.03 --diffusivity cos:4,0.5",
        [9.6535005, 9.5221223, 9.3938265, 9.2119596, 8.9858486, 8.9223767],
        [9.7016938, 9.5604074, 9.4164120, 9.2064059, 8.9393829, 8.8634808],
    ),
];

/// One unperturbed 2:1 ellipse with these flags, and steps of this tolerance.
fn ellipse(flags: &str, n: usize, tolerance: f64, [t_end, interval]: [f64; 2]) -> Done {
    run(&format!(
        "{flags} --shape ellipse:2,1 --amplitude 0 --curves 1 --points {n} --adaptive={tolerance} --t-end {t_end} \
         --series {interval} --snapshots {t_end}"
    ))
}

/// L and E of the series at the times.
fn at_times(done: &Done) -> [[f64; 6]; 2] {
    let rows = done.rows("series.csv");
    ["length", "energy"].map(|column| {
        TIMES.map(|t| {
            let row = rows.iter().find(|row| (number(row, "t") - t).abs() < 1e-9).unwrap();
            number(row, column)
        })
    })
}

fn worst(found: &[f64; 6], exact: &[f64; 6]) -> f64 {
    found.iter().zip(exact).map(|(found, exact)| (found / exact - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn lengths_and_energies_of_ellipses_converge_to_those_of_a_spectral_program() {
    // Errors of the steps are some 10⁻⁶.
    let run = |flags: &str, n: usize| at_times(&ellipse(flags, n, 1e-4, [1.0, 0.01]));
    for (flags, lengths, energies) in ELLIPSES {
        let runs = [50, 100, 200].map(|n| run(flags, n));
        for (what, of, exact) in [("L", 0, lengths), ("E", 1, energies)] {
            let errors = runs.map(|found| worst(&found[of], &exact));
            let order = (errors[0] / errors[2]).log2() / 2.0;
            println!("{flags}: {what}: {errors:.7?}, order {order:.2}");
            assert!(errors[2] < 3e-4 && order > 1.9, "{flags}: {what}: {errors:?}, order {order}");
            // Of the limit of n.
            let limits: [f64; 6] = std::array::from_fn(|i| (4.0 * runs[2][of][i] - runs[1][of][i]) / 3.0);
            let off = worst(&limits, &exact);
            println!("{flags}: {what}: limits {off:.1e}");
            assert!(off < 3e-5, "{flags}: {what}: {off:e}");
        }
    }
    // The control: another energy, and none.
    assert!(worst(&run("--energy cos:4,0.031", 100)[1], &ELLIPSES[2].2) > 2e-4);
    assert!(worst(&run("--form geometric", 100)[0], &ELLIPSES[2].1) > 2e-3);
}

#[test]
fn an_ellipse_ends_as_the_wulff_shape_with_its_area_and_an_energy_that_never_rises() {
    for (text, n, bounds) in [("cos:2,0.1", [50, 100, 200], 3e-4), ("cos:4,0.03", [50, 100, 200], 3e-4)] {
        let energy: Energy = text.parse().unwrap();
        let errors = n.map(|n| {
            let done = ellipse(&format!("--energy {text}"), n, 1e-5, [3.0, 0.05]);
            let series = done.rows("series.csv");
            let energies: Vec<f64> = series.iter().map(|row| number(row, "energy")).collect();
            // At rest by less than the tolerance of the steps.
            assert!(energies.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 2e-8)), "{text}, {n}: {energies:?}");
            let [first, last] = [0, series.len() - 1].map(|i| number(&series[i], "area"));
            assert!(n < 200 || (last / first - 1.0).abs() < 2e-4, "{text}: area {first} {last}");
            let distance = number(&done.summary()[0], "wulff_distance");
            let nodes = positions(&done.rows("snapshots.csv"));
            assert!((distance - wulff_distance(&nodes, &energy)).abs() < 1e-12, "{text}, {n}: {distance}");
            distance
        });
        let order = (errors[0] / errors[2]).log2() / 2.0;
        println!("{text}: {errors:.7?}, order {order:.2}");
        assert!(errors[2] < bounds && order > 1.8, "{text}: {errors:?}, order {order}");
        // The control: it is not the shape of another energy.
        let done = ellipse(&format!("--energy {text}"), 100, 1e-5, [3.0, 0.5]);
        let other: Energy = "cos:4,0.02".parse().unwrap();
        assert!(wulff_distance(&positions(&done.rows("snapshots.csv")), &other) > 5e-3);
    }
}

/// The Wulff shape of area 2π with a small wave of its support function, `size cos(2ψ + phase)`, as a file.
fn disturbed(energy: &Energy, size: f64, phase: f64) -> String {
    let scale = (2.0 * PI / energy.wulff_area()).sqrt();
    let node = |i: usize| {
        let psi = TAU * i as f64 / 2000.0;
        let (sine, cosine) = (2.0 * psi + phase).sin_cos();
        let normal = DVec2::from_angle(psi);
        let node = scale * energy.wulff_point(psi) + size * (cosine * normal - 2.0 * sine * normal.perp());
        format!("{:.15},{:.15}\n", node.x, node.y)
    };
    (0..2000).map(node).collect()
}

/// `∫x² - y² dA` and `∫xy dA` about the centroid over A²: what of mode 2 is in a polygon, whatever its size.
fn second_moments(nodes: &[DVec2]) -> [f64; 2] {
    let n = nodes.len();
    let (mut area, mut centre, mut stretched, mut sheared) = (0.0, DVec2::ZERO, 0.0, 0.0);
    for i in 0..n {
        let (a, b) = (nodes[i], nodes[(i + 1) % n]);
        let cross = a.perp_dot(b);
        area += 0.5 * cross;
        centre += cross / 6.0 * (a + b);
        let squares = a * a + a * b + b * b;
        stretched += cross / 12.0 * (squares.x - squares.y);
        sheared += cross / 24.0 * (a.x * b.y + 2.0 * (a.x * a.y + b.x * b.y) + b.x * a.y);
    }
    [stretched - (centre.x * centre.x - centre.y * centre.y) / area, sheared - centre.x * centre.y / area]
        .map(|moment| moment / (area * area))
}

#[test]
fn small_perturbations_of_wulff_shapes_decay_at_the_exact_rates() {
    // Energy, mobility, and the slowest rates of even and odd perturbations.
    for (text, mobility, rates) in [
        ("cos:2,0.1", "", [3.0068690, 2.9182802]),
        ("cos:3,0.05", "", [3.0568598; 2]),
        ("cos:4,0.03", "", [3.8050596, 2.4299444]),
        ("cos:4,0.03", "--diffusivity cos:4,0.5", [2.3714632, 2.5536235]),
    ] {
        let energy: Energy = text.parse().unwrap();
        // Even and odd, of both signs, at once.
        let phases = [0.0, 0.25 * TAU];
        let starts = phases.iter().flat_map(|phase| [5e-3, -5e-3].map(|size| disturbed(&energy, size, *phase)));
        let starts: Vec<String> = starts.collect();
        let names = ["w0.csv", "w1.csv", "w2.csv", "w3.csv"];
        let files: Vec<(&str, &str)> = names.into_iter().zip(starts.iter().map(String::as_str)).collect();
        let rates_of = |n: usize| {
            let done = run_with(
                &files,
                &format!(
                    "--energy {text} {mobility} --shape files:w?.csv --rounding 0 --points {n} --adaptive=1e-6 --t-end 0.8 \
                     --snapshots 0.4,0.8"
                ),
            );
            let rows = done.rows("snapshots.csv");
            let moments = |member: usize, time: &str| {
                let own = rows.iter().filter(|row| row["member"] == member.to_string() && row["t"] == time);
                second_moments(&positions(&own.cloned().collect::<Vec<_>>()))
            };
            [0, 1].map(|parity| {
                // What is even in the perturbation cancels.
                let [early, late] = ["0.4", "0.8"].map(|time| {
                    let [plus, minus] = [2 * parity, 2 * parity + 1].map(|member| moments(member, time)[parity]);
                    plus - minus
                });
                (early / late).ln() / 0.4
            })
        };
        let [coarse, fine] = [100, 200].map(rates_of);
        for (parity, exact) in rates.into_iter().enumerate() {
            let errors = [coarse, fine].map(|rates| rates[parity] / exact - 1.0);
            let order = (errors[0] / errors[1]).log2();
            println!("{text} {mobility} {parity}: {errors:.5?}, order {order:.2}");
            assert!(errors[0].abs() < 0.01 && order > 1.8, "{text} {mobility} {parity}: {errors:?}, order {order}");
        }
    }
}

#[test]
fn the_excess_of_a_crystal_is_that_over_its_wulff_shape() {
    let common = "--curves 20 --points 60 --adaptive --t-end auto";
    let done = run(&format!("--energy cos:3,0.05,10 {common}"));
    let (members, rates) = (done.summary(), done.rows("rates.csv"));
    // It relaxes to it, at its slowest rate, before the cap.
    assert!(members.iter().all(|row| row["status"] == "relaxed" && number(row, "excess_end") > 0.0), "{members:?}");
    assert!(column(&rates, "rate_ratio").iter().all(|ratio| (ratio - 1.0).abs() < 0.05), "{rates:?}");
    // Where two directions decay differently, there is no theory, but a cap.
    let done = run(&format!("--energy cos:4,0.03,10 {common}"));
    assert!(done.summary().iter().all(|row| row["status"] == "relaxed"));
    assert!(done.rows("rates.csv").iter().all(|row| row["rate_theory"].is_empty()));
    // The Wulff shape itself has none, and a circle has one.
    let energy: Energy = "cos:4,0.03,10".parse().unwrap();
    let flags = "--energy cos:4,0.03,10 --amplitude 0 --curves 1 --points 100 --adaptive --t-end 0.1 --shape";
    let start = |done: &Done| number(&done.summary()[0], "excess_start");
    let wulff =
        start(&run_with(&[("w.csv", &disturbed(&energy, 0.0, 0.0))], &format!("{flags} file:w.csv --rounding 0")));
    let circle = start(&run(&format!("{flags} circle:1")));
    assert!(wulff.abs() < 1e-6 && circle > 1e-3, "{wulff:e} {circle:e}");
    // E²/(4|W|A) - 1 of a circle, ∮γ ds = 2π.
    assert!((circle / (PI / energy.wulff_area() - 1.0) - 1.0).abs() < 0.02, "{circle}");
}

#[test]
fn a_constant_energy_and_mobility_give_the_bits_of_the_geometric_form() {
    let common = "--curves 3 --points 34 --adaptive --t-end 0.2 --series 0.05";
    for method in ["", "--solver gauss-seidel", "--precision f32"] {
        let plain = run(&format!("{common} {method} --form geometric"));
        let crystal = run(&format!("{common} {method} --energy cos:4,0 --diffusivity cos:6,0"));
        let columns = ["length", "area", "k_min", "k_max", "mesh_ratio"];
        let of =
            |done: &Done| done.rows("series.csv").iter().map(|row| columns.map(|c| row[c].clone())).collect::<Vec<_>>();
        assert_eq!(of(&plain), of(&crystal), "{method}");
        // The control.
        assert_ne!(of(&plain), of(&run(&format!("{common} {method} --energy cos:4,1e-4"))), "{method}");
    }
}

#[test]
fn sweeps_f32_and_fixed_steps_agree_with_the_direct_solver_in_f64() {
    let common = "--energy cos:3,0.04+cos:4,0.01,20 --diffusivity cos:4,0.4+cos:1,0.2 --curves 4 --points 61 --t-end 0.3 --snapshots 0.3";
    let ends = |method: &str| positions(&run(&format!("{common} {method}")).rows("snapshots.csv"));
    let exact = ends("--adaptive=1e-6");
    for (method, bound) in [
        ("--adaptive=1e-6 --solver gauss-seidel --tolerance 1e-10", 1e-5),
        // f32 has lower orders. In f64 this tolerance leaves 1.6e-3, and 1e-3 leaves 2.8e-3.
        ("--adaptive=1e-4 --precision f32", 2.8e-3),
        ("--tau 1e-4 --solver direct", 4e-3),
        ("--tau 1e-4 --sor auto", 4e-3),
    ] {
        let found = ends(method);
        let apart = exact.iter().zip(&found).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        println!("{method}: {apart:.1e}");
        assert!(apart < bound, "{method}: {apart:e}");
    }
}

#[test]
fn numbers_of_an_energy_are_swept_and_drawn() {
    let swept = run("--curves 2 --points 40 --adaptive --t-end 0.05 --sweep energy=cos:4,0.01;cos:4,0.03");
    let cells: Vec<String> = swept.rows("ensemble.csv").iter().map(|row| row["energy"].clone()).collect();
    assert_eq!(cells, ["cos:4,0.01", "cos:4,0.03"]);
    let drawn = run("--curves 3 --points 40 --adaptive --t-end 0.05 --energy cos:4,uniform(0.01..0.03),uniform(0..90)");
    let members = drawn.rows("members.csv");
    let sizes: Vec<f64> = members.iter().map(|row| number(row, "energy_1")).collect();
    assert!(sizes.iter().all(|size| (0.01..0.03).contains(size)) && sizes[0] != sizes[1], "{members:?}");
    assert!(members.iter().all(|row| (0.0..90.0).contains(&number(row, "energy_2"))));
    // Each has its own energy: at the start, too.
    assert!(
        drawn.summary().iter().zip(&sizes).all(|(row, _)| number(row, "energy_start") != number(row, "length_start"))
    );
}
