//! The page and the plots of a run, from outside.

use std::fs;

use crate::common::program::{Done, run, run_with};

const RUN: &str = "--curves 7 --points 40 --adaptive=1e-3 --t-end 1";

fn plots(done: &Done) -> Vec<String> {
    let entries = fs::read_dir(done.path().join("plots")).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_run_leaves_a_page_with_what_a_reader_asks_first() {
    let done = run(RUN);
    let page = done.text("report.html");
    let names = [
        "curves.svg",
        "distribution.svg",
        "excess.svg",
        "features.svg",
        "mesh.svg",
        "portraits.json",
        "rate.svg",
        "relaxation.svg",
        "survival.svg",
    ];
    assert_eq!(plots(&done), names);
    for part in ["7 members", "ellipse:2,1, surface-diffusion", "median t_relax", "relaxed", "seed", "Kaplan-Meier"] {
        assert!(page.contains(part), "no {part:?}");
    }
    let elsewhere = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!page.contains("NaN") && !elsewhere.contains("://"), "the page asks for more");
    assert!(page.len() < 1_000_000, "{} bytes", page.len());
    for name in plots(&done).into_iter().filter(|name| name.ends_with("svg")) {
        let svg = done.text(&format!("plots/{name}"));
        assert!(svg.starts_with("<svg") && !svg.contains("NaN") && !svg.contains("inf\""), "{name}");
    }
}

/// Words in place of numbers.
fn none_of(text: &str) -> Vec<&str> {
    let words = text.split(|c: char| !c.is_alphanumeric());
    words.filter(|word| word.contains("NaN") || ["inf", "Infinity"].contains(word)).collect()
}

#[test]
fn runs_of_one_member_of_none_in_a_cell_and_of_none_that_relaxed_leave_no_number_that_is_none() {
    let none_relaxed = "no member relaxed before its final time";
    for (arguments, said) in [
        ("--curves 1 --points 40 --adaptive=1e-3", "The only member relaxed."),
        ("--curves 1 --points 40 --adaptive=1e-3 --t-end 0.01 --series 0.01", none_relaxed),
        ("--curves 5 --points 40 --adaptive=1e-3 --t-end 0.01 --series 0.002", none_relaxed),
        ("--curves 2 --points 40 --adaptive=1e-3 --t-end 0.1 --sweep omega=1,2 --only 1 --series 0.01", none_relaxed),
        ("--curves 2 --points 40 --shape circle:1 --amplitude 0 --stop-when-relaxed", "All 2 members relaxed."),
        (
            "--curves 4 --points 32 --tau 0.05 --amplitude 0.4 --t-end 0.5 --solver direct --series 0.1",
            "failed (see `status`)",
        ),
    ] {
        let done = run(arguments);
        assert!(done.text("report.html").contains(said), "{arguments}: no {said:?}");
        let names = plots(&done).into_iter().map(|name| format!("plots/{name}"));
        for name in names.chain(["report.html", "summary.csv", "ensemble.csv", "run.json"].map(String::from)) {
            // Two words of base64 may spell anything.
            let text = done.text(&name);
            let text = text.split("id=\"trajectories\"").next().unwrap();
            let bad = if name.ends_with("portraits.json") { vec![] } else { none_of(text) };
            assert!(bad.is_empty(), "{arguments}: {name}: {bad:?}");
        }
    }
    assert_eq!(none_of("<path d=\"MNaN 3\"/>-inf, information"), ["MNaN", "inf"]);
}

#[test]
fn equal_runs_leave_equal_plots_and_statistics_whatever_the_threads() {
    let (one, two) = (run(&format!("{RUN} --threads 1")), run(&format!("{RUN} --threads 2")));
    for name in plots(&one).iter().map(|name| format!("plots/{name}")).chain(["ensemble.csv".to_string()]) {
        assert_eq!(one.text(&name), two.text(&name), "{name}");
    }
    assert_ne!(one.text("plots/relaxation.svg"), run(&format!("{RUN} --seed 2")).text("plots/relaxation.svg"));
}

#[test]
fn a_study_compares_its_cells() {
    let done =
        run(&format!("{RUN} --stop-when-relaxed --sweep amplitude=0.02,0.1 --sweep flow=surface-diffusion,willmore"));
    assert!(plots(&done).contains(&"dependence.svg".to_string()));
    let rows = done.rows("ensemble.csv");
    assert_eq!(rows.len(), 4);
    assert_eq!((rows[3]["amplitude"].as_str(), rows[3]["flow"].as_str()), ("0.1", "willmore"));
    for (cell, row) in rows.iter().enumerate() {
        let members: Vec<_> = done.summary().into_iter().filter(|member| member["cell"] == cell.to_string()).collect();
        assert_eq!((row["members"].as_str(), members.len()), ("7", 7));
        let mut times: Vec<f64> = members.iter().filter_map(|member| member["t_relax"].parse().ok()).collect();
        times.sort_by(f64::total_cmp);
        assert_eq!(row["t_relax_known"], times.len().to_string());
        // The fourth of seven, with censored ones last.
        let median = times.get(3).map_or(String::new(), f64::to_string);
        assert_eq!(row["t_relax_median"].parse::<f64>().ok(), median.parse().ok(), "cell {cell}");
    }
    assert!(done.text("report.html").contains("over 4 cells"));
}

#[test]
fn the_mean_excess_is_drawn_with_its_slope() {
    let svg = run(RUN).text("plots/excess.svg");
    assert!(svg.contains("exp(−24 t/R⁴)") && svg.contains("5 to 95 % of the members"), "{svg}");
    let svg = run("--curves 7 --points 40 --adaptive=1e-3 --t-end 6 --flow willmore").text("plots/excess.svg");
    assert!(svg.contains("(1 + 2t/R⁴)^−8<"), "{svg}");
    let study = run(&format!("{RUN} --sweep amplitude=0.02,0.1"));
    let svg = study.text("plots/excess.svg");
    assert!(svg.contains("amplitude = 0.1") && !svg.contains("exp("), "{svg}");
}

#[test]
fn the_page_tells_what_was_rounded_off() {
    let wedge = [("wedge.csv", "0,0\n3,-1\n3,1\n")];
    let rounded = run_with(&wedge, "--curves 2 --shape file:wedge.csv --tau 1e-7 --t-end 2e-7 --solver direct");
    let page = rounded.text("report.html");
    assert!(page.contains("Corners were rounded off in 2 members, in at most ") && page.contains(" % and put back."));
    let untouched = run("--curves 2 --tau 1e-7 --t-end 2e-7 --solver direct").text("report.html");
    assert!(!untouched.contains("Corners were"));
}

#[test]
fn members_of_the_page_move() {
    let page = run(RUN).text("report.html");
    assert!(page.contains("type=\"range\"") && page.contains("member 0: relaxed at t = "), "no slider");
    // A member that is round from the start only shows its circle, and the page says so.
    let round = run("--curves 1 --shape circle:1 --amplitude 0 --stop-when-relaxed").text("report.html");
    assert!(round.contains("member 0: relaxed at t = 0") && !round.contains("NaN"), "a member at rest");
}
