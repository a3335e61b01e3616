//! Events of one's own: found where a fine series of the same members has them, to the order of the steps.

use std::fs;

use crate::common::{
    command::program,
    program::{Done, Row, number, run},
};
use tempfile::TempDir;

/// Members whose shortest and largest curvature, length and excess pass levels at different times.
const MEMBERS: &str = "--shape nonconvex --curves 3 --points 64 --pull auto --t-end 0.06 --event convex=k_min>=0 \
                       --event bent=k_max<=2.6 --event half=excess<=0.5*start --event short=length<=7.5";

/// How far a row of the series is past the level of an event.
fn past(event: &str, row: &Row, start: &Row) -> f64 {
    let at = |column: &str| number(row, column);
    match event {
        "convex" => at("k_min"),
        "bent" => 2.6 - at("k_max"),
        "half" => 0.5 * number(start, "excess") - at("excess"),
        "short" => 7.5 - at("length"),
        _ => panic!("no event {event}"),
    }
}

/// When an event happens by the rows of a member's series.
fn by_series(event: &str, rows: &[Row]) -> f64 {
    let past: Vec<f64> = rows.iter().map(|row| past(event, row, &rows[0])).collect();
    let after = past.iter().position(|past| *past >= 0.0).expect("an event in the series");
    let [t0, t1] = [after - 1, after].map(|i| number(&rows[i], "t"));
    t0 + (t1 - t0) * past[after - 1] / (past[after - 1] - past[after])
}

fn series_of(done: &Done) -> Vec<Vec<Row>> {
    let rows = done.rows("series.csv");
    rows.chunk_by(|a, b| a["member"] == b["member"]).map(<[Row]>::to_vec).collect()
}

/// The largest relative distance of the events from those in the series of `other`.
fn farthest(done: &Done, other: &Done) -> f64 {
    let series = series_of(other);
    let events = done.rows("events.csv");
    assert_eq!(events.len(), 12);
    let apart = |row: &Row| {
        assert_eq!(row["censored"], "0", "{row:?}");
        let member: usize = row["member"].parse().unwrap();
        (number(row, "t") / by_series(&row["event"], &series[member]) - 1.0).abs()
    };
    events.iter().map(apart).fold(0.0, f64::max)
}

#[test]
fn events_are_where_a_fine_series_of_the_same_members_has_them() {
    for pace in ["--tau 1e-5 --solver direct", "--adaptive=1e-3", "--adaptive=1e-5"] {
        // Not a multiple of τ.
        let done = run(&format!("{MEMBERS} {pace} --series 3.7e-6"));
        let error = farthest(&done, &done);
        eprintln!("{pace}: {error:.1e}");
        assert!(error < 1e-5, "{pace}: {error:e}");
        let steps = number(&done.summary()[0], "steps");
        // Adaptive steps are so long that the end of one would be far away.
        assert!(!pace.contains("adaptive") || 0.06 / steps > 5e-4, "{steps} steps");
    }
    // Negative control: other members.
    let [one, other] = [1, 2].map(|seed| run(&format!("{MEMBERS} --adaptive=1e-3 --series 1e-4 --seed {seed}")));
    assert!(farthest(&one, &other) > 1e-3);
}

#[test]
fn events_converge_with_the_steps_as_their_order_promises() {
    let times = |pace: &str| -> Vec<f64> {
        run(&format!("{MEMBERS} {pace}")).rows("events.csv").iter().map(|row| number(row, "t")).collect()
    };
    let error = |pace: &str, exact: &[f64]| -> f64 {
        times(pace).iter().zip(exact).map(|(t, exact)| (t / exact - 1.0).abs()).fold(0.0, f64::max)
    };
    let exact = times("--adaptive=1e-8 --omega 1");
    let adaptive = ["1e-3", "1e-5"].map(|tolerance| error(&format!("--adaptive={tolerance} --omega 1"), &exact));
    eprintln!("adaptive {adaptive:?}");
    // The curves inside the longest steps are less exact than those at their ends.
    assert!(adaptive[0] < 5e-4 && adaptive[1] < 1e-4, "{adaptive:?}");
    let fixed = ["2e-5", "1e-5", "5e-6"].map(|tau| error(&format!("--tau {tau} --omega 1 --solver direct"), &exact));
    eprintln!("fixed {fixed:?}");
    for pair in fixed.windows(2) {
        assert!((1.8..2.2).contains(&(pair[0] / pair[1])), "{fixed:?}");
    }
}

/// Rows for which an observable that has turned round stays away from the level: longer than a step.
const AWAY: usize = 100;

/// A level that an observable of a member reaches and leaves again.
struct Turn {
    member: usize,
    condition: String,
    /// The times of the first and the last row there.
    from: f64,
    to: f64,
}

/// A level just short of each turning point of the series of a member that is farther than all before, by `depth` of
/// the whole way of the observable.
fn turns(member: usize, rows: &[Row], depth: f64) -> Vec<Turn> {
    let mut turns = Vec::new();
    for name in ["length", "excess", "energy", "k_min", "k_max", "mesh_ratio"] {
        let of: Vec<f64> = rows.iter().map(|row| number(row, name)).collect();
        let way = of.iter().fold(f64::MIN, |a, b| a.max(*b)) - of.iter().fold(f64::MAX, |a, b| a.min(*b));
        for (sign, sense) in [(1.0, ">="), (-1.0, "<=")] {
            let mut farthest = sign * of[0];
            for at in 1..of.len() - 1 {
                let level = sign * of[at] - depth * way;
                let is_there = |place: &usize| sign * of[*place] >= level;
                let turns_here = sign * of[at] > sign * of[at - 1] && sign * of[at] > sign * of[at + 1];
                let to = (at..of.len()).take_while(is_there).last().unwrap();
                // One that is soon there again may turn round twice within a step.
                let stays = (to + 1..of.len().min(to + AWAY)).all(|place| !is_there(&place));
                if turns_here && level > farthest && to + 1 < of.len() && stays {
                    let from = (0..of.len()).find(is_there).unwrap();
                    let [from, to] = [from, to].map(|place| number(&rows[place], "t"));
                    turns.push(Turn { member, condition: format!("{name}{sense}{:e}", sign * level), from, to });
                }
                farthest = farthest.max(sign * of[at]);
            }
        }
    }
    turns
}

#[test]
fn a_level_that_is_reached_and_left_again_within_a_step_is_found() {
    for (shape, least) in [("--shape nonconvex --pull auto", 6), ("--shape flower:5:0.3 --amplitude 0.1", 4)] {
        let members = format!("{shape} --curves 4 --points 48 --adaptive=1e-3 --t-end 0.02");
        let series = series_of(&run(&format!("{members} --series 1e-5")));
        let all = |member: usize| turns(member, &series[member], 1e-3);
        let turns: Vec<Turn> = (0..series.len()).flat_map(all).collect();
        assert!((least..=32).contains(&turns.len()), "{} turning points", turns.len());
        let named = |(i, turn): (usize, &Turn)| format!(" --event e{i}={}", turn.condition);
        let done = run(&format!("{members}{}", turns.iter().enumerate().map(named).collect::<String>()));
        let rows = done.rows("events.csv");
        let mut late = Vec::new();
        for (i, Turn { member, condition, from, to }) in turns.iter().enumerate() {
            let row = &rows[member * turns.len() + i];
            assert_eq!((&row["event"], &row["member"]), (&format!("e{i}"), &member.to_string()));
            // The row of the series is the first one past the level.
            let found = row["censored"] == "0" && (from - 1.1e-5..=from + 1e-9).contains(&number(row, "t"));
            if !found {
                late.push(format!("{condition} from {from} to {to}: {} ({})", row["t"], row["censored"]));
            }
        }
        eprintln!("{shape}: {} turning points, {} not found", turns.len(), late.len());
        assert!(late.is_empty(), "{shape}: {} of {} not found:\n{}", late.len(), turns.len(), late.join("\n"));
    }
}

/// The excess falls to 1.56e-4 and rises again within a few steps, since the flow makes one mode grow.
#[test]
fn a_member_relaxes_where_its_excess_dips_below_the_threshold() {
    let member =
        "--amplitude 0 --curves 1 --points 96 --flow poly:-6 --shape flower:2:0.01,5:0.05 --t-end 0.4 --pull auto";
    // The first is at the end of a step, too. A threshold below the dip is reached by nothing.
    for (level, dips) in [("0.000158", true), ("0.0001565", true), ("0.00015635", true), ("0.00015625", false)] {
        let done = run(&format!("{member} --adaptive=0.001 --relax-at {level} --event e=excess<={level}"));
        let (event, member) = (&done.rows("events.csv")[0], &done.summary()[0]);
        if !dips {
            assert_eq!((event["censored"].as_str(), member["t_relax"].as_str()), ("1", ""), "{level}");
            continue;
        }
        let (event, t_relax) = (number(event, "t"), number(member, "t_relax"));
        // By the logarithm of the excess in the one, by the curves in the other.
        assert!((t_relax / event - 1.0).abs() < 1e-3, "{level}: {t_relax} and {event}");
    }
}

#[test]
fn an_event_does_not_depend_on_what_else_is_watched() {
    let members = "--shape nonconvex --pull auto --curves 4 --points 48 --adaptive=1e-3 --t-end 0.02";
    // The largest curvature of a member turns round twice within a step, beyond the first level and short of the
    // second.
    let level = "--event level=k_max<=4.96";
    let of_level = |events: &str| -> Vec<Row> {
        let rows = run(&format!("{members} {events}")).rows("events.csv");
        rows.into_iter().filter(|row| row["event"] == "level").collect()
    };
    assert_eq!(of_level(level), of_level(&format!("{level} --event other=k_max<=5 --event third=energy<=10")));
}

#[test]
fn half_of_the_excess_is_an_event_like_the_one_that_every_member_has() {
    for (pace, bound) in [("--tau 1e-5 --solver direct", 0.0), ("--tau 3e-5", 0.0), ("--adaptive=1e-3", 1e-5)] {
        let done = run(&format!("--curves 11 --points 48 --t-end 0.1 {pace} --event half=excess<=0.5*start"));
        for (event, member) in done.rows("events.csv").iter().zip(done.summary()) {
            if member["t_half"].is_empty() {
                assert_eq!((&event["censored"], &event["t"]), (&"1".to_string(), &member["t_end"]));
                continue;
            }
            let error = (number(event, "t") / number(&member, "t_half") - 1.0).abs();
            assert!(error <= bound, "{pace}: {error:e}");
        }
    }
}

#[test]
fn single_precision_finds_the_events_of_double_precision() {
    for (pace, bound) in [("--tau 1e-5 --solver direct", 3e-4), ("--adaptive=1e-3", 3e-3)] {
        let times = |precision: &str| -> Vec<f64> {
            let done = run(&format!("{MEMBERS} {pace} --precision {precision}"));
            done.rows("events.csv").iter().map(|row| number(row, "t")).collect()
        };
        let (double, single) = (times("f64"), times("f32"));
        assert_eq!((double.len(), double == single), (12, false));
        let error = double.iter().zip(&single).map(|(a, b)| (b / a - 1.0).abs()).fold(0.0, f64::max);
        eprintln!("{pace}: {error:.1e}");
        assert!(error < bound, "{pace}: {error:e}");
    }
}

#[test]
fn an_event_at_the_start_is_warned_of_and_one_that_does_not_happen_is_censored() {
    let home = TempDir::new().unwrap();
    let mut command = program(home.path());
    command.args(["run", "--backend", "cpu", "--curves", "5", "--points", "48", "--adaptive=1e-3", "--t-end", "0.3"]);
    command.args([
        "--event",
        "never = length <= 1",
        "--event",
        "soon = length <= start",
        "--event",
        "wide = area >= 4",
    ]);
    let output = command.args(["--stop-when-relaxed", "--relax-to", "0.5", "--out", "out"]).output().unwrap();
    let (said, told) = (String::from_utf8(output.stderr).unwrap(), String::from_utf8(output.stdout).unwrap());
    for (event, all) in [("soon", 5), ("wide", 5)] {
        let warning =
            format!("warning: the event {event} holds from the start in {all} of 5 members: its time is 0 there");
        assert_eq!(said.matches(&warning).count(), 1, "{said}");
    }
    assert!(!said.contains("never"), "{said}");
    assert!(told.contains("event      never: none of 5 members reached it\n"), "{told}");
    assert!(told.contains("event      soon: median 0, mean 0 "), "{told}");

    let done = Done { home };
    let (events, summary) = (done.rows("events.csv"), done.summary());
    for (member, rows) in events.chunks(3).enumerate() {
        let row = |i: usize| ["member", "event", "t", "censored"].map(|name| &rows[i][name][..]);
        let member_name = member.to_string();
        assert_eq!(row(0), [&member_name, "never", &summary[member]["t_end"], "1"]);
        assert_eq!((row(1), row(2)), ([&member_name, "soon", "0.0", "0"], [&member_name, "wide", "0.0", "0"]));
    }
    assert!(summary.iter().any(|row| number(row, "t_end") < 0.3), "no member stops early");
    let statistics = done.rows("event_statistics.csv");
    let known: Vec<_> =
        statistics.iter().map(|row| (&row["event"][..], &row["members"][..], &row["known"][..])).collect();
    assert_eq!(known, [("never", "5", "0"), ("soon", "5", "5"), ("wide", "5", "5")]);
}

#[test]
fn events_get_the_statistics_that_relaxation_gets() {
    // The same condition as that of t_relax.
    let done =
        run("--curves 40 --points 64 --pull auto --adaptive=1e-3 --t-end 0.83 --event relaxed=excess<=0.01*start \
                    --sweep amplitude=0.02,0.1");
    let (cells, events) = (done.rows("ensemble.csv"), done.rows("event_statistics.csv"));
    assert_eq!((cells.len(), events.len()), (2, 2));
    for (cell, event) in cells.iter().zip(&events) {
        assert_eq!(event["known"], cell["t_relax_known"]);
        let known = number(event, "known");
        assert!((10.0..40.0).contains(&known), "some are censored: {known}");
        for name in ["mean", "sd", "se", "restricted_to", "q05", "q25", "q75", "median", "median_low", "median_high"] {
            let (own, other) = (&event[name], &cell[&format!("t_relax_{name}")]);
            assert_eq!(own.is_empty(), other.is_empty(), "{name}: {own} {other}");
            if !own.is_empty() {
                let ratio = number(event, name) / number(cell, &format!("t_relax_{name}"));
                assert!((ratio - 1.0).abs() < 1e-3, "{name}: {own} {other}");
            }
        }
        assert_eq!(event["discretisation_known"], cell["discretisation_known"]);
        let ratio = |name: &str| number(event, name) / number(cell, name);
        let [own, other] = ["discretisation_mean", "discretisation_error"].map(ratio);
        assert!((own - 1.0).abs() < 0.02 && (other - 1.0).abs() < 0.2, "{own} {other}");
    }
    let page = fs::read_to_string(done.path().join("report.html")).unwrap();
    assert!(page.contains("share without the event") && page.contains("relaxed, amplitude = 0.1"));
    assert!(done.path().join("plots/events.svg").exists());
}

#[test]
fn events_do_not_change_the_members() {
    for pace in ["--tau 1e-4", "--adaptive=1e-3"] {
        let all = format!("--curves 7 --points 40 --t-end 0.05 {pace} --series 0.007 --snapshots 0.02");
        let (with, without) =
            (run(&format!("{all} --event a=k_max<=3 --event b=k_max<=2.5 --event c=excess<=0.2")), run(&all));
        assert!(with.texts() == without.texts());
        assert!(!without.path().join("events.csv").exists() && !without.path().join("event_levels.csv").exists());
        assert!(with.rows("events.csv").iter().any(|row| row["censored"] == "0" && row["t"] != "0.0"));
    }
}

#[test]
fn an_event_before_which_members_were_stopped_has_no_statistics() {
    // Members relax at 0.01 times their own excess at the start: some before it is 0.0018, some after.
    let late = "--curves 12 --points 64 --adaptive=1e-3 --event late=excess<=0.0018 --event early=excess<=0.3*start";
    let stopped = run(&format!("{late} --t-end 2 --stop-when-relaxed"));
    let whole = run(&format!("{late} --t-end 2"));
    let median = |done: &Done, event: &str| {
        let rows = done.rows("event_statistics.csv");
        rows.iter().find(|row| row["event"] == event).unwrap()["median"].clone()
    };
    // The slowest members are seen for longest, and may still have it.
    assert!(stopped.rows("events.csv").iter().any(|row| row["event"] == "late" && row["censored"] == "1"));
    assert_eq!(median(&stopped, "late"), "");
    assert!(stopped.rows("events.csv").iter().any(|row| row["event"] == "late" && row["censored"] == "0"));
    assert!(median(&whole, "late").parse::<f64>().unwrap() > 0.4);
    let [one, other] = [&stopped, &whole].map(|done| median(done, "early").parse::<f64>().unwrap());
    assert!(one == other && one > 0.0, "{one} {other}");
    let page = stopped.text("report.html");
    assert!(page.contains("were stopped when they relaxed, before the event late"));
    assert!(!whole.text("report.html").contains("were stopped when they relaxed"));
}

#[test]
fn events_have_a_limit_for_each_member_with_refine() {
    let arguments =
        "--curves 8 --points 64 --adaptive=1e-3 --t-end 1 --event half=excess<=0.5*start --event late=excess<=1e-9";
    let (refined, plain) = (run(&format!("{arguments} --refine")), run(arguments));
    let (rows, summary) = (refined.rows("events.csv"), refined.summary());
    for (row, member) in rows.iter().filter(|row| row["event"] == "half").zip(&summary) {
        let (t, limit, error) = (number(row, "t"), number(row, "t_limit"), number(row, "t_error"));
        assert!(limit != t && (limit / t - 1.0).abs() < 0.05 && error > 0.0 && error < 0.1 * t, "{row:?}");
        // Half the excess is one event: t_half by another name, at the nodes of the run. Inside a step, each is found
        // by its own interpolation.
        assert!((t / number(member, "t_half") - 1.0).abs() < 1e-5, "{row:?} {member:?}");
    }
    assert!(rows.iter().filter(|row| row["event"] == "late").all(|row| row["t_limit"].is_empty()));
    assert!(plain.rows("events.csv").iter().all(|row| row["t_limit"].is_empty() && row["t_error"].is_empty()));
    let statistics = &refined.rows("event_statistics.csv")[0];
    let mut limits: Vec<f64> =
        rows.iter().filter(|row| row["event"] == "half").map(|row| number(row, "t_limit")).collect();
    limits.sort_by(f64::total_cmp);
    assert_eq!((number(statistics, "t_limit_known"), number(statistics, "t_limit_median")), {
        (8.0, 0.5 * limits[3] + 0.5 * limits[4])
    });
    assert!(refined.rows("explained.csv").iter().any(|row| row["time"] == "half"));

    // What was changed by hand does not pass for what the levels say.
    let path = refined.path().join("events.csv");
    let text = fs::read_to_string(&path).unwrap();
    let limit = &rows[0]["t_limit"];
    fs::write(&path, text.replace(limit.as_str(), "0.5")).unwrap();
    let output = crate::common::command::curvelax(refined.home.path(), "plot out");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.code() == Some(2) && said.contains("the limit") && said.contains("event half of member 0"),
        "{said}"
    );
}
