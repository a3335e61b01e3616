//! Driving forces from outside, against circles, whose radius is known: R(t) = R(0) - F t under surface diffusion.

use std::f64::consts::PI;

use tempfile::TempDir;

use crate::common::{
    command,
    program::{Row, column, number, run},
};

/// One unperturbed curve with these flags.
fn one(flags: &str) -> Row {
    run(&format!("{flags} --amplitude 0 --curves 1 --adaptive=1e-4 --pull auto")).summary().remove(0)
}

#[test]
fn a_driven_circle_vanishes_at_its_radius_over_the_force() {
    for (flags, radius, force) in [
        ("--shape circle:1 --drive 0.5", 1.0, 0.5),
        ("--shape circle:1 --drive 0.5 --precision f32 --points 64", 1.0, 0.5),
        // The force is a velocity, whatever the mobility, and units of length change no digit.
        ("--shape circle:1 --drive 0.5 --mobility 10", 1.0, 0.5),
        ("--shape circle:3e-6 --drive 2e-4 --mobility 1e-20", 3e-6, 2e-4),
        ("--shape circle:1 --drive 2 --energy cos:4,0", 1.0, 2.0),
    ] {
        let row = one(&format!("{flags} --t-end auto"));
        let (t, end) = (number(&row, "t_vanish"), number(&row, "t_end"));
        assert_eq!(row["status"], "vanished", "{flags}");
        assert!((t * force / radius - 1.0).abs() < 2e-4, "{flags}: {t}");
        // It was followed to a tenth of its length, a crystal until it is at rest, and not much beyond.
        let left = number(&row, "length_end") / number(&row, "length_start");
        let level = if flags.contains("energy") { f64::cbrt(1.0 / 6.0) } else { 0.1 };
        assert!(end < t && (0.4 * level..=level).contains(&left), "{flags}: {end} {left}");
    }
}

#[test]
fn a_circle_that_does_not_vanish_in_time_is_unfinished_and_none_vanishes_without_a_force() {
    let row = one("--shape circle:1 --drive 0.5 --t-end 1.7 --relax-at 1e-12");
    assert_eq!((&*row["status"], &*row["t_vanish"], number(&row, "t_end")), ("relaxed", "", 1.7));
    let row = one("--shape flower:3:0.1 --drive 0.5 --t-end 0.01");
    assert_eq!((&*row["status"], &*row["t_vanish"]), ("unfinished", ""));
    let row = one("--shape circle:1 --drive -0.5 --t-end 0.5");
    let grown = number(&row, "length_end") / number(&row, "length_start");
    assert!((grown - 1.25).abs() < 1e-3 && row["t_vanish"].is_empty(), "{grown}");
    // Curvature flow shrinks curves, too, but no force drives them.
    let row = one("--shape ellipse:2,1 --flow poly:1 --t-end 2 --relax-to 1e-9");
    assert!(
        row["status"] != "vanished" && row["t_vanish"].is_empty() && number(&row, "t_end") < 2.0,
        "{}",
        row["status"]
    );
}

#[test]
fn a_circle_that_grows_in_f32_grows_as_in_f64_or_ends_where_its_coordinates_do() {
    let grown = |flags: &str| {
        let row = one(&format!("--shape circle:1 --drive -1 --relax-at 1e-12 {flags}"));
        let grown = number(&row, "length_end") / number(&row, "length_start");
        (row, grown)
    };
    for t in [2.0, 5.0, 20.0] {
        let (row, times) = grown(&format!("--precision f32 --t-end {t}"));
        assert_eq!(number(&row, "t_end"), t);
        assert!((times / (1.0 + t) - 1.0).abs() < 1e-3, "t = {t}: {times}");
    }
    // 16 times is made room for; beyond 60 units of a start whose radius is 1 to 2 there are no coordinates.
    let (row, times) = grown("--precision f32 --t-end 1000");
    assert!(number(&row, "t_end") < 1000.0 && number(&row, "steps") < 2000.0, "{row:?}");
    assert!((16.0..120.0).contains(&times) && (times / (1.0 + number(&row, "t_end")) - 1.0).abs() < 1e-3, "{times}");
    let (row, times) = grown("--t-end 1000");
    assert!(number(&row, "t_end") == 1000.0 && (times / 1001.0 - 1.0).abs() < 1e-3, "{row:?}");
    let never_round = "--shape ellipse:1.5,1 --drive -1 --relax-at 1e-12 --t-end 1000";
    let [short, long] = ["f32", "f64"].map(|precision| one(&format!("{never_round} --precision {precision}")));
    assert_eq!([&*short["status"], &*long["status"]], ["nonfinite", "unfinished"]);
}

#[test]
fn a_feedback_brings_the_area_to_its_own() {
    let (gain, target) = (1.0, 0.81 * PI);
    let row = one(&format!("--shape circle:1 --drive feedback:{gain},{target} --t-end 1 --relax-at 1e-12"));
    // (R - R₀)/(R + R₀) falls as exp(-2π c R₀ t).
    let rest = 0.9;
    let share = (1.0 - rest) / (1.0 + rest) * f64::exp(-2.0 * PI * gain * rest);
    let radius = rest * (1.0 + share) / (1.0 - share);
    let (found, exact) = (number(&row, "area_end"), PI * radius * radius);
    assert!((found / exact - 1.0).abs() < 2e-4, "{found} {exact}");
    assert!(row["t_vanish"].is_empty());
}

#[test]
fn the_times_of_driven_members_have_statistics_of_their_own() {
    let common = "--shape circle:1 --amplitude 0 --points 40 --adaptive --pull auto --t-end auto";
    let done = run(&format!("{common} --curves 7 --drive uniform(0.4..0.8)"));
    let (rows, forces) = (done.summary(), column(&done.rows("members.csv"), "drive_1"));
    for (row, force) in rows.iter().zip(&forces) {
        assert!((number(row, "t_vanish") * force - 1.0).abs() < 2e-3, "{force}");
    }
    let cell = &done.rows("ensemble.csv")[0];
    let mut times = column(&rows, "t_vanish");
    times.sort_by(f64::total_cmp);
    assert_eq!(["vanished", "t_vanish_known", "members"].map(|name| number(cell, name)), [7.0; 3]);
    assert_eq!(number(cell, "t_vanish_median"), times[3]);
    assert!(number(cell, "t_vanish_median_low") < times[3] && times[3] < number(cell, "t_vanish_median_high"));
    let swept = run(&format!("{common} --curves 1 --sweep drive=0.25,0.5,1"));
    let medians = column(&swept.rows("ensemble.csv"), "t_vanish_median");
    for (median, force) in medians.iter().zip([0.25, 0.5, 1.0]) {
        assert!((median * force - 1.0).abs() < 2e-3, "{median}");
    }
}

#[test]
fn a_curve_vanishes_before_the_circle_of_its_area_and_its_events_are_seen() {
    let done = run(
        "--shape ellipse:2,1 --drive 0.5 --amplitude 0 --curves 1 --adaptive=1e-4 --pull auto --t-end auto --event small=length<=0.3*start",
    );
    let row = &done.summary()[0];
    let (t, circle) = (number(row, "t_vanish"), f64::sqrt(2.0) / 0.5);
    assert!(t < circle && t > 0.9 * circle, "{t} {circle}");
    // It relaxed before that.
    assert!((0.5..2.0).contains(&number(row, "t_relax")));
    let small = number(&done.rows("events.csv")[0], "t");
    assert!(small < number(row, "t_end"), "{small}");
    // It is round by then.
    let left = 0.3 * number(row, "length_start") / (2.0 * PI * 0.5);
    assert!(((t - small) / left - 1.0).abs() < 1e-3, "{t} {small} {left}");
    // The area falls at the rate F L, and theory has no rate.
    assert_eq!(done.rows("rates.csv")[0]["rate_theory"], "");
}

#[test]
fn a_curve_whose_sides_meet_before_it_is_round_is_singular_and_does_not_vanish() {
    let status = |force: f64| {
        let done = run(&format!(
            "--shape ellipse:5,1 --drive {force} --amplitude 0 --curves 1 --adaptive --pull auto --t-end auto"
        ));
        let row = &done.summary()[0];
        (row["status"].clone(), row["t_vanish"].is_empty(), row["self_crossing"].is_empty())
    };
    assert_eq!(status(0.2), ("vanished".into(), false, true));
    // It crosses itself for a while, and is round at the end.
    assert_eq!(status(2.0), ("vanished".into(), false, false));
    assert_eq!([3.0, 5.0].map(status), [("singular".into(), true, false), ("singular".into(), true, false)]);
}

#[test]
fn the_overview_says_that_members_that_relaxed_vanished_afterwards() {
    let home = TempDir::new().unwrap();
    let told = |drive: &str| {
        let rest = "--amplitude 0 --curves 3 --points 40 --adaptive --pull auto --t-end auto --backend cpu";
        command::done(home.path(), &format!("run {rest} --drive {drive} --out of_{drive}"))
    };
    let (vanished, grown) = (told("1"), told("-1"));
    assert!(vanished.contains("over 3 members that relaxed; all of them vanished later\n"), "{vanished}");
    assert!(grown.contains("over 3 members that relaxed\n"), "{grown}");
}

#[test]
fn when_a_member_vanishes_has_a_limit_that_its_bar_holds() {
    // A circle of radius 1 vanishes at 1/F.
    let circles = "--shape circle:1 --amplitude 0 --points 48 --accurate --curves 4 --drive uniform(0.4..0.8)";
    let done = run(circles);
    for (row, force) in done.summary().iter().zip(column(&done.rows("members.csv"), "drive_1")) {
        let [limit, error] = ["t_vanish_limit", "t_vanish_error"].map(|name| number(row, name));
        assert!((limit * force - 1.0).abs() <= error * force && error * force < 1e-4, "{limit} ± {error}, F = {force}");
    }
    // One that relaxes first has both limits, and the median is that of the limits.
    let ellipses = |points: usize| {
        run(&format!("--shape ellipse:1.6,1 --amplitude 0.03 --curves 6 --drive 0.5 --accurate --points {points}"))
    };
    let (few, many) = (ellipses(64), ellipses(200));
    for (row, truth) in few.summary().iter().zip(&many.summary()) {
        for [limit, error] in [["t_limit", "t_error"], ["t_vanish_limit", "t_vanish_error"]] {
            let off = number(row, limit) - number(truth, limit);
            assert!(off.abs() <= number(row, error) + number(truth, error), "{limit}: {row:?} {truth:?}");
        }
        // The control: what 64 nodes give is outside.
        assert!((number(row, "t_vanish") - number(truth, "t_vanish_limit")).abs() > number(row, "t_vanish_error"));
    }
    let cell = &few.rows("ensemble.csv")[0];
    let mut limits = column(&few.summary(), "t_vanish_limit");
    limits.sort_by(f64::total_cmp);
    assert_eq!(number(cell, "t_vanish_limit_known"), 6.0);
    assert_eq!(number(cell, "t_vanish_limit_median"), 0.5 * limits[2] + 0.5 * limits[3]);
    assert!(few.text("report.html").contains("median t_vanish_limit"));
    let levels = few.rows("levels.csv");
    assert!(levels.len() >= 18 && levels.iter().all(|row| number(row, "t_vanish") > number(row, "t_relax")));
    // Under a strong force it is not round at the end, and has no limit.
    let strong = run("--shape ellipse:2,1 --amplitude 0.05 --points 100 --curves 2 --accurate --drive 150");
    for row in strong.summary() {
        assert!(number(&row, "excess_end") > 0.01 && number(&row, "t_vanish") > 0.0, "{row:?}");
        assert_eq!((&*row["t_vanish_limit"], &*row["t_vanish_error"]), ("", ""));
    }
    // Tables that disagree are refused.
    let (path, told) = (few.path().join("summary.csv"), few.text("summary.csv"));
    let limit = &few.summary()[2]["t_vanish_limit"];
    let other = (1.01 * limit.parse::<f64>().unwrap()).to_string();
    std::fs::write(&path, told.replace(limit, &other)).unwrap();
    let told = command::curvelax(few.home.path(), "plot out");
    let said = String::from_utf8_lossy(&told.stderr);
    assert_eq!(told.status.code(), Some(2));
    assert!(said.contains(&format!("column t_vanish_limit: expected {limit}")), "{said}");
}

#[test]
fn each_member_ends_where_its_own_force_takes_it() {
    let done = run("--drive uniform(-1..1) --curves 8 --adaptive --pull auto --t-end auto --points 64");
    let forces = column(&done.rows("members.csv"), "drive_1");
    let rows = done.summary();
    for (row, force) in rows.iter().zip(&forces) {
        let expected = if *force > 0.0 { "vanished" } else { "relaxed" };
        assert_eq!((&*row["status"], row["t_vanish"].is_empty()), (expected, *force <= 0.0), "{force}");
    }
    assert!(forces.iter().any(|force| *force > 0.0) && forces.iter().any(|force| *force < 0.0));
}

#[test]
fn a_slow_force_takes_few_steps_and_a_driven_member_that_fails_is_not_at_rest() {
    let row = one("--shape circle:1 --drive 1e-3 --t-end auto");
    assert!(row["status"] == "vanished" && number(&row, "steps") < 300.0, "{} {}", row["status"], row["steps"]);
    let row = one("--shape circle:1 --drive 1 --t-end 0.95");
    assert!((number(&row, "length_end") / (2.0 * PI * 0.05) - 1.0).abs() < 2e-3 && number(&row, "steps") < 1000.0);
    // No step is short enough for this force.
    let done =
        run("--shape circle:1 --amplitude 0 --curves 1 --adaptive --pull auto --t-end auto --sweep drive=1,1e20");
    let statuses: Vec<String> = done.summary().iter().map(|row| row["status"].to_string()).collect();
    assert_eq!(statuses[0], "vanished");
    assert!(["singular", "stalled", "nonfinite"].contains(&&*statuses[1]), "{statuses:?}");
}

#[test]
fn events_late_in_the_life_of_a_circle_are_seen() {
    let events = "--event short=length<=0.2*start --event bent=k_max>=5 --event tiny=area<=0.03*start";
    let done =
        run(&format!("--shape circle:1 --drive 1 --amplitude 0 --curves 1 --adaptive --pull auto --t-end 2 {events}"));
    let times = column(&done.rows("events.csv"), "t");
    let exact = [0.8, 0.8, 1.0 - f64::sqrt(0.03)];
    let off = times.iter().zip(exact).map(|(t, exact)| (t - exact).abs()).fold(0.0, f64::max);
    assert!(times.len() == 3 && off < 1e-3, "{times:?}");
}

#[test]
fn members_that_vanish_before_they_relax_are_censored_then() {
    // An excess of 1e-9 is reached by none, since the mesh of a curve that shrinks is not that even.
    let common = "--shape ellipse:2,1 --curves 8 --adaptive --pull auto --t-end auto --points 64";
    let done = run(&format!("{common} --drive uniform(4..20) --sweep relax-to=0.01,1e-8"));
    let rows = done.summary();
    assert!(rows.iter().all(|row| row["status"] == "vanished"));
    let relaxed = [0, 1].map(|cell| rows[8 * cell..][..8].iter().filter(|row| !row["t_relax"].is_empty()).count());
    assert_eq!(relaxed, [8, 0]);
    let known = column(&done.rows("ensemble.csv"), "t_relax_known");
    assert_eq!(known, [8.0, 0.0]);
}

#[test]
fn a_mode_of_a_growing_circle_decays_as_theory_says_with_order_two() {
    // ln(a(0)/a(t)) = m²(m²-1)/(3|F|) (1/R(0)³ - 1/R(t)³) for m = 3.
    let (force, end) = (0.5, 0.02_f64);
    let exact = 72.0 / (3.0 * force) * (1.0 - (1.0 + force * end).powi(-3));
    let errors = [50, 100, 200].map(|n| {
        let done = run(&format!(
            "--shape flower:3:0.001 --drive -{force} --amplitude 0 --curves 1 --points {n} --adaptive=1e-6 --t-end {end} --snapshots 0,{end}"
        ));
        let rows = done.rows("snapshots.csv");
        let [first, last] = [&rows[..n], &rows[n..]].map(|rows| {
            // The part cos 3θ of the radii, over the area between the nodes.
            let radii: Vec<[f64; 2]> =
                rows.iter().map(|row| [number(row, "x"), number(row, "y")]).map(|[x, y]| [y.atan2(x), x.hypot(y)]).collect();
            2.0 * radii.iter().map(|[angle, radius]| radius * (3.0 * angle).cos()).sum::<f64>() / n as f64
        });
        (first / last).ln() / exact - 1.0
    });
    let order = (errors[0] / errors[2]).abs().log2() / 2.0;
    println!("{errors:.6?}, order {order:.2}");
    assert!(errors[2].abs() < 3e-3 && order > 1.9, "{errors:?}, order {order}");
}

#[test]
fn a_slowly_driven_crystal_vanishes_as_its_shape_at_rest_does() {
    // Its area falls at the rate F L, and L/√A is that of the Wulff shape: a circle of area π lasts c/F, c = √(1 +
    // ε²(1-m²)/2).
    for (force, epsilon, n, bound) in [(0.02, 0.03, 100, 4e-4), (0.002, 0.03, 100, 4e-4), (0.05, 0.0, 64, 1e-4)] {
        let row = one(&format!("--shape circle:1 --drive {force} --energy cos:4,{epsilon} --points {n} --t-end auto"));
        let exact = f64::sqrt(1.0 - 7.5 * epsilon * epsilon);
        assert_eq!(row["status"], "vanished", "{force}");
        let off = number(&row, "t_vanish") * force / exact - 1.0;
        assert!(off.abs() < bound && number(&row, "steps") < 6000.0, "{force}: {off:e} {}", row["steps"]);
        // It was at rest, and its excess was seen.
        assert!(number(&row, "t_end") * force > 1e-3 && !row["t_relax"].is_empty());
    }
}

#[test]
fn energies_can_be_swept_from_that_of_no_direction_on() {
    let done = run("--curves 1 --amplitude 0 --points 32 --adaptive --t-end 0.1 --sweep energy=1;cos:4,0.03");
    let cells: Vec<String> = done.rows("ensemble.csv").iter().map(|row| row["energy"].to_string()).collect();
    assert_eq!(cells, ["1", "cos:4,0.03"]);
    let plain = run("--curves 1 --amplitude 0 --points 32 --adaptive --t-end 0.1 --form geometric").summary();
    let rows = done.summary();
    assert_eq!(rows[0]["length_end"], plain[0]["length_end"]);
    assert_ne!(rows[1]["length_end"], plain[0]["length_end"]);
}
