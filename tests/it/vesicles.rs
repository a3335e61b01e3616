//! Flows that keep area and length, from outside: against the energies of an independent spectral program, and circles.

use std::f64::consts::PI;

use tempfile::TempDir;

use crate::common::{
    command::curvelax,
    program::{Row, column, number, run},
};

/// One unperturbed ellipse of these half-axes under Willmore flow, with its series.
fn ellipse(axes: &str, flags: &str, n: usize) -> (Row, Vec<Row>) {
    let done = run(&format!(
        "--shape ellipse:{axes} --flow willmore {flags} --amplitude 0 --curves 1 --points {n} --adaptive=1e-5 \
         --series 0.05"
    ));
    (done.summary().remove(0), done.rows("series.csv"))
}

/// Times and values.
type Course = &'static [(f64, f64)];

/// What is kept, of which half-axes with which area and length, and the energy, the length or the area at times.
type Kept = (&'static str, &'static str, [f64; 2], &'static [(&'static str, Course)]);
const SPECTRAL: [Kept; 4] = [
    (
        "area",
        "2,1",
        [2.0 * PI, 9.68844822],
        &[
            ("energy", &[(0.05, 2.9613583), (0.1, 2.8845710), (0.5, 2.4500133), (1.0, 2.2622763), (3.0, 2.2214648)]),
            ("length", &[(0.1, 9.4972954), (0.5, 9.0771093), (3.0, 8.8857845)]),
        ],
    ),
    (
        "length",
        "2,1",
        [2.0 * PI, 9.68844822],
        &[
            ("energy", &[(0.05, 2.9071251), (0.1, 2.7941763), (0.5, 2.2808873), (1.0, 2.0898530), (3.0, 2.0374878)]),
            ("area", &[(0.1, 6.5766854), (0.5, 7.1753752), (3.0, 7.4695095)]),
        ],
    ),
    (
        "area,length",
        "2,1",
        [2.0 * PI, 9.68844822],
        &[("energy", &[(0.1, 3.0551520), (0.5, 3.0546492), (3.0, 3.0546492)])],
    ),
    // The biconcave vesicle.
    (
        "area,length",
        "3,1",
        [3.0 * PI, 13.36489322],
        &[("energy", &[(0.1, 3.272058), (1.0, 3.1346663), (3.0, 3.1346661)])],
    ),
];

#[test]
fn what_is_kept_is_kept_and_the_rest_converges_to_that_of_a_spectral_program() {
    for (kept, axes, sizes, courses) in SPECTRAL {
        let at: Vec<String> = kept.split(',').map(|of| sizes[usize::from(of == "length")].to_string()).collect();
        let flags = format!("--conserve {kept} --conserve-at {} --t-end 3", at.join(","));
        let runs = [50, 100, 200].map(|n| {
            let (_, series) = ellipse(axes, &flags, n);
            for row in &series[1..] {
                for of in kept.split(',') {
                    let off = number(row, of) / sizes[usize::from(of == "length")] - 1.0;
                    assert!(off.abs() < 1e-9, "{kept}: {of} off by {off:e} at {}", row["t"]);
                }
            }
            // It falls to rest, and then stays within the tolerance of the steps.
            let energies = column(&series, "energy");
            assert!(energies[1..].is_sorted_by(|before, after| *after <= before * (1.0 + 1e-6)), "{kept}");
            series
        });
        for (what, exact) in courses {
            let errors = [0, 1, 2].map(|i| {
                let off = exact.iter().map(|(t, exact)| {
                    let row = runs[i].iter().find(|row| (number(row, "t") - t).abs() < 1e-9).unwrap();
                    (number(row, what) / exact - 1.0).abs()
                });
                off.fold(0.0, f64::max)
            });
            let order = (errors[0] / errors[2]).log2() / 2.0;
            println!("{kept} of {axes}: {what}: {errors:.6?}, order {order:.2}");
            assert!(errors[2] < 4e-4 && order > 1.9, "{kept} of {axes}: {what}: {errors:?}, order {order}");
        }
    }
    // The control: with another area and length it is another energy.
    let (row, _) = ellipse("2,1", "--conserve area,length --conserve-at 6.2,9.7 --t-end 3", 100);
    assert!((number(&row, "energy_end") / 3.0546492 - 1.0).abs() > 5e-3, "{}", row["energy_end"]);
}

#[test]
fn a_mode_of_a_circle_decays_at_the_rate_of_theory() {
    for (kept, exact) in [("area", 15.0), ("length", 18.0)] {
        let done = run(&format!(
            "--shape flower:2:0.01 --flow willmore --conserve {kept} --amplitude 0 --curves 1 --adaptive=1e-5 --t-end auto"
        ));
        let (row, rates) = (&done.summary()[0], &done.rows("rates.csv")[0]);
        assert!((number(rates, "rate_theory") / exact - 1.0).abs() < 2e-3, "{kept}: {}", rates["rate_theory"]);
        assert!((number(rates, "rate_ratio") - 1.0).abs() < 0.02, "{kept}: {}", rates["rate_ratio"]);
        // It stopped when it was relaxed, at ln 100 over the rate.
        assert_eq!(row["status"], "relaxed");
        assert!((number(row, "t_relax") * exact / 100_f64.ln() - 1.0).abs() < 0.02, "{kept}: {}", row["t_relax"]);
        assert!(number(row, "t_end") < 1.5 * number(row, "t_relax"));
    }
}

#[test]
fn a_vesicle_is_relaxed_when_a_hundredth_of_the_way_of_its_energy_is_left() {
    let flags = "--conserve area,length --t-end 3 --series 0.001";
    let done = run(&format!(
        "--shape ellipse:3,1 --flow willmore {flags} --amplitude 0 --curves 1 --adaptive=1e-5 --pull auto"
    ));
    let row = &done.summary()[0];
    assert_eq!(row["status"], "relaxed");
    let [start, end] = ["energy_start", "energy_end"].map(|name| number(row, name));
    let series = done.rows("series.csv");
    for (name, share) in [("t_relax", 0.01), ("t_half", 0.5)] {
        let t = number(row, name);
        let level = end + share * (start - end);
        let later = series.iter().position(|row| number(row, "energy") <= level).unwrap();
        let [before, after] = [&series[later - 1], &series[later]].map(|row| number(row, "t"));
        assert!((before - 2e-4..=after + 2e-4).contains(&t), "{name}: {before} {t} {after}");
    }
    // Without enough time it is not known, and the curve is biconcave.
    let (early, _) = ellipse("3,1", "--conserve area,length --t-end 0.05", 100);
    assert_eq!((&*early["status"], &*early["t_relax"]), ("unfinished", ""));
    assert!(number(row, "k_min") < -0.1 && row["rate"].is_empty());
}

#[test]
fn when_a_vesicle_is_relaxed_has_a_limit_that_its_bar_holds() {
    let of = |flags: &str| {
        let start = "--shape ellipse:2.5,1 --amplitude 0.05 --decay 2 --curves 2 --seed 7";
        run(&format!("--accurate --flow willmore --conserve area,length {start} {flags}")).summary()
    };
    let [long, short] = ["f64", "f32"].map(|digits| of(&format!("--points 64 --precision {digits}")));
    let truth = of("--points 256 --adaptive=1e-4");
    let mut farthest = 0.0_f64;
    for (row, exact) in long.iter().chain(&short).zip(truth.iter().cycle()) {
        let [t, limit, error] = ["t_relax", "t_limit", "t_error"].map(|name| number(row, name));
        let exact = number(exact, "t_limit");
        println!("{:.1e}, bar {:.1e}, without a limit {:.1e}", limit / exact - 1.0, error / exact, t / exact - 1.0);
        assert!((limit - exact).abs() <= error && error < 5e-3 * limit, "{limit} ± {error}, {exact}");
        // The control: the time of the run itself is outside.
        assert!((t - exact).abs() > error, "{t} ± {error}, {exact}");
        farthest = farthest.max((limit - exact).abs() / error);
    }
    assert!(farthest > 1.0 / 30.0, "idle: {farthest}");
}

/// Rounded areas and lengths moved them until they were singular, or took ten times the steps.
#[test]
fn nearly_round_vesicles_rest_in_f32() {
    for (axes, points) in [("1.3,1", 64), ("1.3,1", 100), ("1.6,1", 100)] {
        let [long, short] = ["f64", "f32"].map(|digits| {
            let start = format!("--shape ellipse:{axes} --amplitude 0 --curves 1 --points {points} --t-end 1");
            let method = format!("--adaptive=1e-4 --pull auto --precision {digits}");
            run(&format!("--flow willmore --conserve area,length {start} {method}")).summary().remove(0)
        });
        assert_eq!(short["status"], "relaxed", "{axes} by {points}");
        let [off, steps] = ["t_relax", "steps"].map(|name| number(&short, name) / number(&long, name));
        // The energy of 1.3:1 falls by 2.4e-3 of itself, and by a hundredth of that is where it is relaxed.
        assert!((off - 1.0).abs() < 2e-3 && steps < 1.5, "{axes} by {points}: {off}, {steps} times the steps");
    }
}

#[test]
fn a_population_of_vesicles_has_the_reduced_areas_that_are_drawn() {
    let done = run(
        "--shape circle:1 --flow willmore --conserve area,length --reduced-area uniform(0.6..0.9) --amplitude 0.05 --curves 6 \
         --adaptive --pull auto --t-end auto",
    );
    let drawn = column(&done.rows("members.csv"), "reduced_area");
    for (row, drawn) in done.summary().iter().zip(&drawn) {
        assert!((number(row, "reduced_area") / drawn - 1.0).abs() < 2e-3, "{drawn}: {}", row["reduced_area"]);
        assert_eq!(row["status"], "relaxed");
        assert!(number(row, "t_relax") < number(row, "t_end"));
    }
}

#[test]
fn starts_far_from_what_is_kept_are_brought_there() {
    let of = |flags: &str| {
        let common = "--flow willmore --adaptive=1e-4 --pull auto --t-end auto --points 64";
        run(&format!("{common} --conserve {flags} {}", if flags.contains("curves") { "" } else { "--curves 4" }))
    };
    for (kept, at) in [
        ("area", "3"),
        ("area", "60"),
        ("length", "5"),
        ("length", "40"),
        ("area,length", "6,12"),
        ("area,length", "60,40"),
        ("area,length", "6.283185,9.68844822"),
    ] {
        for row in of(&format!("{kept} --conserve-at {at}")).summary() {
            for (name, at) in kept.split(',').zip(at.split(',').map(|at| at.parse::<f64>().unwrap())) {
                // The first step does the last 0.4 %.
                for (end, bound) in [("start", 4e-3), ("end", 1e-9)] {
                    let off = number(&row, &format!("{name}_{end}")) / at - 1.0;
                    assert!(off.abs() <= bound, "{kept} at {at}: {off:e} off at the {end}");
                }
            }
            assert_eq!(row["status"], "relaxed", "{kept} at {at}");
        }
    }
    let cells = of("area --curves 1 --sweep conserve-at=3,7").summary();
    assert_eq!(column(&cells, "area_start").iter().map(|area| area.round()).collect::<Vec<_>>(), [3.0, 7.0]);
    // A curve of another size has times that go as the square of the area.
    let [own, given] = ["area", "area --conserve-at 60"].map(|flags| of(flags).summary());
    for (own, given) in own.iter().zip(&given) {
        let ratio = number(given, "t_relax") / number(own, "t_relax") * (number(own, "area_start") / 60.0).powi(2);
        assert!((ratio - 1.0).abs() < 1e-4, "{ratio}");
    }
}

#[test]
fn a_start_that_is_never_so_round_is_refused_before_it_runs() {
    let flags =
        "--flow willmore --conserve area,length --conserve-at 3.14,6.3 --shape circle:1 --amplitude 0.1 --curves 2";
    let home = TempDir::new().unwrap();
    let output = curvelax(home.path(), &format!("run {flags} --out out"));
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && !home.path().join("out").exists(), "{error}");
    assert!(error.contains("--conserve-at 3.14,6.3: member "), "{error}");
    assert!(error.contains(" has at most 0.9426 as 4 pi A/L^2 whatever its stretch; use a longer L"), "{error}");
}

#[test]
fn a_stretched_vesicle_has_the_time_of_its_own_length() {
    // A circle of area π with 4πA/L² = 0.5 has (L/2π)⁴ = 4.
    let done = run(
        "--shape circle:1 --flow willmore --conserve area,length --reduced-area 0.5 --amplitude 0 --curves 1 --adaptive --pull auto \
         --t-end auto",
    );
    let t_end = number(&done.summary()[0], "t_end");
    assert!((t_end / 2.0 - 1.0).abs() < 1e-2, "{t_end}");
}

#[test]
fn area_and_length_can_be_given() {
    let (row, _) = ellipse("2,1", "--conserve area --conserve-at 6.5 --t-end 0.5", 60);
    assert!((number(&row, "area_end") / 6.5 - 1.0).abs() < 1e-9, "{}", row["area_end"]);
}

/// Half the bending energy is no energy of this flow: it falls below its end at once, and comes back slowly.
#[test]
fn a_vesicle_is_relaxed_when_its_energy_stays_near_its_end() {
    let flags = "--flow poly:0,0,0,1 --conserve area,length --shape ellipse:2,1 --amplitude 0 --curves 1 --points 64 \
                 --adaptive --pull auto --series 0.005";
    let done = run(flags);
    let (row, series) = (done.summary().remove(0), done.rows("series.csv"));
    let (t_relax, end) = (number(&row, "t_relax"), number(&row, "energy_end"));
    let off: Vec<[f64; 2]> = series.iter().map(|at| [number(at, "t"), number(at, "energy") - end]).collect();
    let farthest = off.iter().map(|[_, off]| off.abs()).fold(0.0, f64::max);
    let last = off.iter().rfind(|[_, off]| off.abs() > 0.01 * farthest).map(|[t, _]| *t).unwrap();
    assert!((last..last + 0.006).contains(&t_relax), "{t_relax}, near its end from {last} on");
    // The first time at which it was as near is much earlier.
    let passes = off.iter().find(|[_, off]| *off < 0.0).map(|[t, _]| *t).unwrap();
    assert!(passes < 0.2 * t_relax, "{passes}");
}
