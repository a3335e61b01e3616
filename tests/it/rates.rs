//! Decay rates and the mean excess of a run, from outside: against the definition and against theory.

use std::f64::consts::PI;

use crate::common::program::{Done, Row, column, number, run};

/// Fraction of all members whose rate is within 2 % of the theoretical one, which `theory` recomputes.
fn share_as_in_theory(done: &Done, theory: impl Fn(f64) -> f64) -> f64 {
    let (members, rates) = (done.summary(), done.rows("rates.csv"));
    for row in &rates {
        let member = &members[number(row, "member") as usize];
        let expected = theory(number(member, "area_start"));
        assert!((number(row, "rate_theory") / expected - 1.0).abs() < 1e-12, "{row:?}");
        assert_eq!((&row["rate"], &row["rate_r2"]), (&member["rate"], &member["rate_r2"]));
        assert!((number(row, "rate_ratio") - number(row, "rate") / number(row, "rate_theory")).abs() < 1e-12);
    }
    let near = rates.iter().filter(|row| (number(row, "rate_ratio") - 1.0).abs() < 0.02).count();
    near as f64 / members.len() as f64
}

#[test]
fn small_modes_of_a_circle_decay_as_linear_theory_has_it() {
    let common = "--shape circle:1.3 --amplitude 0.02 --adaptive=1e-4 --curves 100";
    let fourth = |area: f64| (area / PI).powi(2);
    let two = run(&format!("{common} --modes 2..=2 --t-end 3"));
    assert!(share_as_in_theory(&two, |area| 24.0 / fourth(area)) >= 0.95);
    let three = run(&format!("{common} --modes 3..=3 --t-end 1"));
    assert!(share_as_in_theory(&three, |area| 144.0 / fourth(area)) >= 0.95);
    let willmore = run(&format!("{common} --modes 2..=2 --flow willmore --t-end 9"));
    assert!(share_as_in_theory(&willmore, |_| 8.0) >= 0.95);
    let cell = &two.rows("ensemble.csv")[0];
    assert!((number(cell, "rate_ratio") - 1.0).abs() < 0.02 && number(cell, "rate_known") >= 95.0, "{cell:?}");
    // The control: steps that are too long are detected.
    let long = run("--shape circle:1 --amplitude 0.02 --modes 2..=2 --solver direct --t-end 1 --curves 20");
    assert!(share_as_in_theory(&long, |area| 24.0 / fourth(area)) < 0.5, "τ = 10⁻³ decays some 5 % too fast");
}

#[test]
fn in_elastic_flow_theory_is_that_of_the_radius_while_the_rate_is_fitted() {
    let common = "--pull auto --shape circle:1 --amplitude 0.02 --modes 2..=2 --adaptive=1e-4 --curves 50 --t-end 4";
    // At rest, growing and shrinking: the circle at rest has R⁴ = 1, 6.25 and 0.25.
    for (penalty, bound) in [(0.5_f64, 0.02), (0.2, 0.02), (1.0, 0.02)] {
        let done = run(&format!("{common} --flow elastic:{penalty}"));
        let rates = done.rows("rates.csv");
        let ratios = column(&rates, "rate_ratio");
        let near = ratios.iter().filter(|ratio| (**ratio - 1.0).abs() < bound).count();
        assert!(near as f64 >= 0.9 * 50.0, "{penalty}: {ratios:?}");
        // The rate at rest, 18/R⁴, is another one unless the circle is at rest.
        let at_rest = 18.0 * (2.0 * penalty).powi(2);
        let far = column(&rates, "rate").iter().filter(|rate| (**rate / at_rest - 1.0).abs() > 0.1).count();
        assert_eq!(far, if penalty == 0.5 { 0 } else { rates.len() }, "{penalty}: {:?}", column(&rates, "rate"));
        for row in &rates {
            let ratio = number(row, "rate") / number(row, "rate_theory");
            assert!((number(row, "rate_ratio") - ratio).abs() < 1e-12);
        }
        assert!(done.text("plots/excess.svg").contains(", for the radius at t = "));
    }
}

/// Abscissae and ordinates of the points in the window, and the slope of the line through them.
fn slope(rows: &[&Row], low: f64, high: f64) -> (usize, f64) {
    let start = number(rows[0], "excess");
    let inside = |row: &&&Row| (low * start..=high * start).contains(&number(row, "excess"));
    let points: Vec<(f64, f64)> =
        rows.iter().filter(inside).map(|row| (number(row, "t"), number(row, "excess").ln())).collect();
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
    let xy: f64 = points.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    let xx: f64 = points.iter().map(|(x, _)| (x - mx).powi(2)).sum();
    (points.len(), -xy / xx)
}

#[test]
fn a_rate_is_the_slope_of_the_line_through_the_steps_in_the_window() {
    for precision in ["f64", "f32"] {
        let done =
            run(&format!("--curves 4 --points 40 --solver direct --precision {precision} --series 0.001 --t-end 1.5"));
        let (series, members) = (done.rows("series.csv"), done.summary());
        for member in &members {
            let rows: Vec<&Row> = series.iter().filter(|row| row["member"] == member["member"]).collect();
            let (points, expected) = slope(&rows, 1e-3, 1e-1);
            let rate = number(member, "rate");
            let bound = if precision == "f64" { 1e-10 } else { 1e-4 };
            assert!(points >= 8 && (rate / expected - 1.0).abs() < bound, "{rate} and {expected} from {points} points");
            let other = slope(&rows, 5e-2, 5e-1).1;
            assert!((rate / other - 1.0).abs() > 10.0 * bound, "{rate}: another window has the same slope");
        }
    }
}

#[test]
fn the_mean_excess_is_that_of_the_series_and_counts_who_is_left() {
    let common = "--curves 5 --points 40 --solver direct --tau 0.002 --t-end 1";
    let done = run(&format!("{common} --series 0.002"));
    let (series, rows) = (done.rows("series.csv"), done.rows("mean_excess.csv"));
    assert_eq!(rows.len(), 33);
    for (part, row) in rows.iter().enumerate() {
        let t = (part as f64 / 32.0).powi(3);
        assert_eq!((number(row, "t"), row["members"].as_str()), (t, "5"));
        // The series has every step, so a straight line between its rows is the step itself.
        let at = t / 0.002;
        let of_member = |member: usize| {
            let value = |step: usize| number(&series[member * 501 + step.min(500)], "excess");
            value(at as usize) + at.fract() * (value(at as usize + 1) - value(at as usize))
        };
        let values: Vec<f64> = (0..5).map(of_member).collect();
        let mean = values.iter().sum::<f64>() / 5.0;
        let sd = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 4.0).sqrt();
        assert!((number(row, "mean") - mean).abs() < 1e-12, "t = {t}: {} and {mean}", row["mean"]);
        assert!((number(row, "sd") - sd).abs() < 1e-9, "t = {t}: {} and {sd}", row["sd"]);
    }
    assert!(number(&rows[16], "mean") < 0.9 * number(&rows[0], "mean"), "it does not fall");
    let stopped = run(&format!("{common} --relax-to 0.1 --stop-when-relaxed")).rows("mean_excess.csv");
    let left = column(&stopped, "members");
    assert!(left[0] == 5.0 && left.len() < 33 && left.is_sorted_by(|a, b| a >= b), "{left:?}");
}

#[test]
fn a_rate_needs_eight_points() {
    let few = run("--curves 2 --points 40 --solver direct --tau 0.1 --t-end 0.6");
    assert!(few.rows("rates.csv").is_empty() && few.summary().iter().all(|member| member["rate"].is_empty()));
    let cell = &few.rows("ensemble.csv")[0];
    assert_eq!((cell["rate_known"].as_str(), cell["rate_mean"].as_str()), ("0", ""));
    assert!(few.text("plots/rate.svg").contains("No member was followed closely enough"));
    assert_eq!(run("--curves 2 --points 40 --solver direct --tau 0.01 --t-end 1").rows("rates.csv").len(), 2);
}
