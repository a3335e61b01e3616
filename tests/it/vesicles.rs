//! Flows that keep area and length, from outside: against the energies of an independent spectral program, and circles.

use std::f64::consts::PI;

use crate::common::program::{Row, column, number, run};

/// One unperturbed ellipse of these half-axes under Willmore flow, with its series.
fn ellipse(axes: &str, flags: &str, n: usize) -> (Row, Vec<Row>) {
    let done = run(&format!(
        "--shape ellipse:{axes} --flow willmore {flags} --amplitude 0 --curves 1 --points {n} --adaptive=1e-4 --pull auto \
         --series 0.02"
    ));
    (done.summary().remove(0), done.rows("series.csv"))
}

#[test]
fn what_is_kept_is_kept_and_the_energy_is_that_of_the_spectral_program() {
    for (kept, axes, energy) in
        [("area", "2,1", 2.2214648), ("length", "2,1", 2.0374878), ("area,length", "2,1", 3.0546492)]
    {
        let errors = [50, 100].map(|n| {
            let (row, series) = ellipse(axes, &format!("--conserve {kept} --t-end 3"), n);
            for what in kept.split(',') {
                let [start, end] = ["start", "end"].map(|when| number(&row, &format!("{what}_{when}")));
                assert!((end / start - 1.0).abs() < 1e-7, "{kept}: {what} {start} {end}");
            }
            // It falls to rest, and then stays within the tolerance of the steps.
            let energies = column(&series, "energy");
            assert!(energies.is_sorted_by(|before, after| *after <= before * (1.0 + 1e-4)), "{kept}");
            let reduced = 4.0 * PI * number(&row, "area_end") / number(&row, "length_end").powi(2);
            assert!((number(&row, "reduced_area") - reduced).abs() < 1e-12);
            (number(&row, "energy_end") / energy - 1.0).abs()
        });
        // Order 2.
        assert!(errors[1] < 6e-3 && errors[1] < 0.3 * errors[0], "{kept}: {errors:?}");
    }
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
fn area_and_length_can_be_given() {
    let (row, _) = ellipse("2,1", "--conserve area --conserve-at 6.5 --t-end 0.5", 60);
    assert!((number(&row, "area_end") / 6.5 - 1.0).abs() < 1e-7, "{}", row["area_end"]);
}
