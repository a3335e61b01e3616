//! Crystals from outside, against numbers of an independent spectral program (128 to 256 directions): a 2:1 ellipse under
//! four surface energies, the Wulff shape, and the decay of its perturbations.

use std::f64::consts::{PI, TAU};

use curvelax::crystal::Energy;
use glam::DVec2;

use crate::common::program::{Done, number, positions, run, run_with};

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

/// One unperturbed 2:1 ellipse with these flags.
fn ellipse(flags: &str, n: usize, t_end: f64, interval: f64) -> Done {
    run(&format!(
        "{flags} --shape ellipse:2,1 --amplitude 0 --curves 1 --points {n} --adaptive=1e-5 --t-end {t_end} --series {interval} \
         --snapshots {t_end}"
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
    for (flags, lengths, energies) in ELLIPSES {
        let runs = [50, 100, 200].map(|n| at_times(&ellipse(flags, n, 1.0, 0.01)));
        for (what, of, exact) in [("L", 0, lengths), ("E", 1, energies)] {
            let errors = runs.map(|found| worst(&found[of], &exact));
            let order = (errors[0] / errors[2]).log2() / 2.0;
            println!("{flags}: {what}: {errors:.1e?}, order {order:.2}");
            assert!(errors[2] < 3e-4 && order > 1.9, "{flags}: {what}: {errors:e?}, order {order}");
            // Of the limit of n.
            let limits: [f64; 6] = std::array::from_fn(|i| (4.0 * runs[2][of][i] - runs[1][of][i]) / 3.0);
            let off = worst(&limits, &exact);
            println!("{flags}: {what}: limits {off:.1e}");
            assert!(off < 3e-5, "{flags}: {what}: {off:e}");
        }
    }
    // The control: another energy, and none.
    let other = at_times(&ellipse("--energy cos:4,0.031", 100, 1.0, 0.01));
    assert!(worst(&other[1], &ELLIPSES[2].2) > 2e-4);
    assert!(worst(&at_times(&ellipse("--form geometric", 100, 1.0, 0.01))[0], &ELLIPSES[2].1) > 2e-3);
}

/// The largest error of the support function of a polygon, centred, against the Wulff shape of its area.
fn distance_from_wulff(nodes: &[DVec2], energy: &Energy) -> f64 {
    let n = nodes.len();
    let cross = |i: usize| nodes[i].perp_dot(nodes[(i + 1) % n]);
    let area = 0.5 * (0..n).map(cross).sum::<f64>();
    let centre = (0..n).map(|i| cross(i) * (nodes[i] + nodes[(i + 1) % n])).sum::<DVec2>() / (6.0 * area);
    let scale = (area / energy.wulff_area()).sqrt();
    let error = |i: usize| {
        let psi = TAU * i as f64 / 360.0;
        let support = nodes.iter().map(|node| (*node - centre).dot(DVec2::from_angle(psi))).fold(0.0, f64::max);
        (support - scale * energy.waves().at(psi)[0]).abs()
    };
    (0..360).map(error).fold(0.0, f64::max)
}

#[test]
fn an_ellipse_ends_as_the_wulff_shape_with_its_area_and_an_energy_that_never_rises() {
    for (text, n, bounds) in [("cos:2,0.1", [50, 100, 200], 3e-4), ("cos:4,0.03", [50, 100, 200], 3e-4)] {
        let energy: Energy = text.parse().unwrap();
        let errors = n.map(|n| {
            let done = ellipse(&format!("--energy {text}"), n, 3.0, 0.05);
            let series = done.rows("series.csv");
            let energies: Vec<f64> = series.iter().map(|row| number(row, "energy")).collect();
            assert!(energies.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 1e-13)), "{text}, {n}: {energies:?}");
            let [first, last] = [0, series.len() - 1].map(|i| number(&series[i], "area"));
            assert!(n < 200 || (last / first - 1.0).abs() < 2e-4, "{text}: area {first} {last}");
            distance_from_wulff(&positions(&done.rows("snapshots.csv")), &energy)
        });
        let order = (errors[0] / errors[2]).log2() / 2.0;
        println!("{text}: {errors:.1e?}, order {order:.2}");
        assert!(errors[2] < bounds && order > 1.8, "{text}: {errors:e?}, order {order}");
        // The control: it is not the shape of another energy.
        let done = ellipse(&format!("--energy {text}"), 100, 3.0, 0.5);
        let other: Energy = "cos:4,0.02".parse().unwrap();
        assert!(distance_from_wulff(&positions(&done.rows("snapshots.csv")), &other) > 5e-3);
    }
}

/// The Wulff shape of area 2π with a small wave along its outline, as a file.
fn disturbed(energy: &Energy, mode: f64, phase: f64) -> String {
    let scale = (2.0 * PI / energy.wulff_area()).sqrt();
    let node = |i: usize| {
        let psi = TAU * i as f64 / 2000.0;
        let (sine, cosine) = (mode * psi + phase).sin_cos();
        // A wave of the support function.
        let normal = DVec2::from_angle(psi);
        let node = scale * energy.wulff_point(psi) + 1e-3 * (cosine * normal - mode * sine * normal.perp());
        format!("{:.15},{:.15}\n", node.x, node.y)
    };
    (0..2000).map(node).collect()
}

#[test]
fn small_perturbations_of_wulff_shapes_decay_at_the_exact_rates() {
    // Energy, mobility, wave and its phase, the rate of the slowest mode that it excites.
    for (energy, mobility, mode, phase, rate) in [
        ("cos:2,0.1", "", 2.0, 0.0, 0.0),
        ("cos:3,0.05", "", 2.0, 0.0, 3.0568598),
        ("cos:4,0.03", "", 2.0, 0.0, 2.4299444),
        ("cos:4,0.03", "", 2.0, 0.25 * TAU, 3.8050596),
        ("cos:4,0.03", "cos:4,0.5", 2.0, 0.0, 0.0),
    ] {
        let of: Energy = energy.parse().unwrap();
        let mobility = if mobility.is_empty() { String::new() } else { format!("--diffusivity {mobility}") };
        let errors = [100, 200].map(|n| {
            let done = run_with(
                &[("wulff.csv", &disturbed(&of, mode, phase))],
                &format!(
                    "--energy {energy} {mobility} --shape file:wulff.csv --rounding 0 --points {n} --adaptive=1e-6 --t-end 1.5 \
                     --relax-to 1e-3"
                ),
            );
            let row = &done.summary()[0];
            println!("{energy} {mobility} {n}: {} theory {}", row["rate"], row["rate_theory"]);
            number(row, "rate") / (2.0 * rate) - 1.0
        });
        println!("{energy} {mobility}: {errors:.1e?}");
    }
}
