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
fn pages_of_very_small_runs_have_no_nan() {
    let none_relaxed = "no member relaxed before its final time";
    for (arguments, said) in [
        ("--curves 1 --points 40 --adaptive=1e-3", "<strong>1</strong> of 1 member relaxed"),
        ("--curves 1 --points 40 --adaptive=1e-3 --t-end 0.01 --series 0.01", none_relaxed),
        ("--curves 5 --points 40 --adaptive=1e-3 --t-end 0.01 --series 0.002", none_relaxed),
        ("--curves 2 --points 40 --adaptive=1e-3 --t-end 0.1 --sweep omega=1,2 --only 1 --series 0.01", none_relaxed),
        ("--curves 2 --points 40 --shape circle:1 --amplitude 0 --stop-when-relaxed", "All 2 members relaxed."),
        (
            "--curves 4 --points 32 --tau 0.05 --amplitude 0.4 --t-end 0.5 --solver direct --series 0.1",
            "failed (see <code>status</code>)",
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
    assert!(done.text("report.html").contains("over 2 of 4 cells; the others have no median"));
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

/// The number with so many significant digits, as the page and the overview have it.
fn shown(value: &str, digits: i32) -> String {
    let value: f64 = value.parse().unwrap();
    format!("{value:.*}", (digits - 1 - value.log10().floor() as i32) as usize)
}

#[test]
fn one_time_is_shown_everywhere_the_limit_where_there_is_one() {
    let run_of = |more: &str| run(&format!("--curves 24 --points 64 --adaptive=1e-3 --t-end 2 {more}"));
    let (refined, plain) = (run_of("--refine"), run_of(""));
    for (done, time, other) in [(&refined, "t_limit", "t_relax"), (&plain, "t_relax", "t_limit")] {
        let ensemble = &done.rows("ensemble.csv")[0];
        let page = done.text("report.html");
        assert!(page.contains(&format!("<dt>median {time}</dt><dd class=\"value\">{}</dd>", {
            shown(&ensemble[&format!("{time}_median")], 4)
        })));
        for name in ["relaxation", "distribution", "survival", "features"] {
            let svg = done.text(&format!("plots/{name}.svg"));
            assert!(svg.contains(&format!("{time} (length⁴)")) && !svg.contains(other), "{name}: {svg}");
        }
        assert!(page.contains(&format!("statistics of {time} (Kaplan-Meier)")));
        let member = &done.summary()[0];
        let told = if time == "t_limit" { ", t_limit = " } else { " at t = " };
        assert!(page.contains(&format!("member 0: relaxed{told}{}", &shown(&member[time], 4)[..4])), "{member:?}");
        let explained = done.rows("explained.csv");
        assert_eq!(explained[0]["time"], time);
    }
    // The raw times are there, behind.
    let raw = shown(&refined.rows("ensemble.csv")[0]["t_relax_median"], 4);
    assert!(
        refined.text("report.html").contains(&format!("<dt>raw median t_relax</dt><dd class=\"value\">{raw}</dd>"))
    );
}

#[test]
fn few_outlines_are_listed_by_name_and_have_no_statistics() {
    let square = "0,0\n1,0\n1,1\n0,1\n";
    let bar = "0,0\n3,0\n3,1\n0,1\n";
    let done = run_with(&[("bar.csv", bar), ("square.csv", square)], "--shape files:*.csv --points 40 --accurate");
    let (page, summary) = (done.text("report.html"), done.summary());
    assert!(page.contains("<h1>bar, square under surface-diffusion</h1>"));
    assert_eq!(plots(&done), ["curves.svg", "members.svg", "portraits.json"]);
    for row in &summary {
        let entry = format!("<dt>{}</dt><dd class=\"value\">t_limit = {}", row["label"], &row["t_limit"][..5]);
        assert!(page.contains(&entry), "{entry}");
    }
    for word in ["median", "not known", "Kaplan-Meier", "quantile"] {
        assert!(!page.contains(word), "{word}");
    }
    let text = String::from_utf8(
        crate::common::command::curvelax(done.home.path(), {
            "run --shape files:*.csv --points 40 --accurate --backend cpu --out again"
        })
        .stdout,
    )
    .unwrap();
    for row in &summary {
        let line = text.lines().find(|line| line.contains(&row["label"])).unwrap();
        assert!(line.contains(&row["t_limit"][..5]) && line.contains(" ± ") && line.ends_with("relaxed"), "{text}");
    }
    assert!(!text.contains("median") && !text.contains("not known"), "{text}");
    // The control: many members have statistics.
    let many = run_with(
        &[("bar.csv", bar), ("square.csv", square)],
        "--shape files:*.csv --curves 11 --modes 2..=3 \
                        --amplitude 0.05 --points 40 --adaptive=1e-3 --t-end 1",
    );
    assert!(many.text("report.html").contains("median t_relax") && plots(&many).contains(&"survival.svg".into()));
}

#[test]
fn cells_of_one_member_are_listed_by_what_varies() {
    let done = run("--curves 1 --amplitude 0 --points 40 --adaptive=1e-3 --t-end 2 --stop-when-relaxed \
                    --sweep shape=ellipse:2,1;circle:1;ellipse:3,1 --event half=excess<=0.5*start");
    let page = done.text("report.html");
    for name in ["shape = ellipse:2,1", "shape = circle:1", "shape = ellipse:3,1"] {
        assert!(page.contains(&format!("<dt>{name}</dt>")), "{name}");
    }
    assert!(page.contains("<th scope=\"col\" class=\"number\">half</th>"), "{page}");
}

#[test]
fn one_legend_names_what_varies_between_cells() {
    let done = run(&format!("{RUN} --sweep amplitude=0.02,0.1 --sweep flow=surface-diffusion,willmore"));
    let page = done.text("report.html");
    let legend = page.split("<ul class=\"legend\"").nth(1).unwrap().split("</ul>").next().unwrap();
    assert_eq!(legend.matches("<li>").count(), 4);
    for name in ["amplitude = 0.02", "amplitude = 0.1", "flow = surface-diffusion", "flow = willmore"] {
        assert!(legend.contains(&format!("{name}</li>")), "{legend}");
    }
    let survival = done.text("plots/survival.svg");
    // A file has a legend of its own, with two entries for each key, and a curve for each cell.
    for class in ["s0 d0", "s1 d0", "faint d0", "faint d1", "s0 d1", "s1 d1"] {
        assert!(survival.contains(&format!("<g class=\"{class}\">")), "{class}: {survival}");
    }
    assert!(survival.contains(">flow = willmore</text>") && page.matches(">flow = willmore</text>").count() < 5);
    let distribution = done.text("plots/distribution.svg");
    assert!(distribution.contains(">0.1, willmore</text>") && distribution.contains(">amplitude, flow</text>"));
    assert!(page.contains("member 0 (0.02, surface-diffusion)"), "{page}");
}

#[test]
fn captions_speak_of_what_is_drawn() {
    let page = |more: &str| run(&format!("--points 40 --adaptive=1e-3 {more}")).text("report.html");
    let (all, some) = (page("--curves 7 --t-end 1"), page("--curves 7 --t-end 0.82"));
    let many = page("--curves 2 --t-end 1 --sweep amplitude=0.01,0.02,0.03,0.04,0.05");
    let band = "Greenwood's 95 % band";
    assert!(all.contains(band) && some.contains(band) && !many.contains(band));
    let stroke = "a stroke marks";
    assert!(!all.contains(stroke) && some.contains(stroke), "censored members are marked");
    let slope = "the slope that linear theory gives";
    assert!(all.contains(slope) && !many.contains(slope));
}

#[test]
fn units_are_everywhere_and_micrometres_are_written_with_their_sign() {
    let units = "--curves 7 --points 40 --adaptive=1e-3 --t-end auto --mobility 2.5e-3 --units um,h";
    let done = run(units);
    let (page, curves) = (done.text("report.html"), done.text("plots/curves.svg"));
    for part in ["B = 0.0025 µm⁴/h", "Times are in h.", " h</dd>", "data-unit=\" h\"", "the bar has length 1 µm"] {
        assert!(page.contains(part), "{part}");
    }
    let spec = page.split("<pre>").nth(1).unwrap().split("</pre>").next().unwrap();
    assert!(!page.replace(spec, "").contains(" um") && !page.contains("length⁴"), "um is for keyboards");
    assert!(curves.contains(" µm</text>") && curves.contains(" h</text>"), "{curves}");
    let plain = run("--curves 7 --points 40 --adaptive=1e-3 --t-end 1").text("report.html");
    assert!(plain.contains("Times are in length⁴, in the unit of length of the coordinates."));
    let unnamed = run(&units.replace(" --units um,h", "")).text("report.html");
    assert!(unnamed.contains("t_relax (time of B)") && !unnamed.contains("length⁴"));
}

#[test]
fn long_tables_are_folded() {
    let done = run("--curves 24 --points 40 --adaptive=1e-3 --t-end 1 --sweep omega=1,2");
    let page = done.text("report.html");
    let folded = page.split("<details>").nth(1).unwrap();
    assert!(folded.starts_with("\n<summary>What explains the times"), "{folded}");
    assert_eq!(page.matches("<details>").count(), 1, "short tables are open");
}

#[test]
fn the_page_says_which_members_were_smoothed() {
    let wedge = [("wedge.csv", "0,0\n3,-1\n3,1\n")];
    let rounded = run_with(&wedge, "--curves 2 --shape file:wedge.csv --tau 1e-7 --t-end 2e-7 --solver direct");
    let page = rounded.text("report.html");
    assert!(page.contains("corners of 2 members were rounded further") && page.contains(" % and was restored."));
    let untouched = run("--curves 2 --tau 1e-7 --t-end 2e-7 --solver direct").text("report.html");
    assert!(!untouched.contains("rounded further"));
}

#[test]
fn members_of_the_page_move() {
    let page = run(RUN).text("report.html");
    assert!(page.contains("type=\"range\"") && page.contains("member 0: relaxed at t = "), "no slider");
    // A member that is round from the start only shows its circle, and the page says so.
    let round = run("--curves 1 --shape circle:1 --amplitude 0 --stop-when-relaxed").text("report.html");
    assert!(round.contains("member 0: relaxed at t = 0") && !round.contains("NaN"), "a member at rest");
}

#[test]
fn driven_members_have_relaxed_and_vanished_each_at_its_own_time() {
    let done = run("--curves 3 --points 40 --accurate --refine=false --drive 0.2");
    let (page, members) = (done.text("report.html"), done.summary());
    assert!(page.contains("<strong>3</strong> of 3 members relaxed") && !page.contains("failed"), "{page}");
    let [relaxed, vanished] = ["t_relax", "t_vanish"].map(|column| shown(&members[0][column], 3));
    assert_ne!(relaxed, vanished, "the control: another time");
    assert!(page.contains(&format!("member 0: vanished at t = {vanished}")), "{vanished}");
    assert!(page.contains("<dt>median t_vanish</dt>"), "{page}");
    // A curve that is not driven vanishes nowhere.
    assert!(!run(RUN).text("report.html").contains("vanished at t"));
}

#[test]
fn a_page_says_once_what_ran_and_a_file_says_it_too() {
    let done = run(RUN);
    let what = "surface-diffusion, amplitude 0.05, n = 40, adaptive 0.001";
    assert_eq!(done.text("report.html").matches(what).count(), 1);
    for name in plots(&done).into_iter().filter(|name| name.ends_with("svg") && name != "curves.svg") {
        assert_eq!(done.text(&format!("plots/{name}")).matches(what).count(), 1, "{name}");
    }
}

#[test]
fn cells_without_quartiles_have_no_panel_of_quantiles() {
    let of = |end: &str| {
        let sweep = "--sweep amplitude=0.05,0.1 --sweep flow=surface-diffusion,willmore";
        run(&format!("--curves 7 --points 40 --adaptive=1e-3 --t-end {end} {sweep}")).text("plots/distribution.svg")
    };
    let (some, all) = (of("1.5"), of("4"));
    assert!(!some.contains("quartiles are not known"), "{some}");
    let panels = |text: &str| text.matches(">standard normal quantile</text>").count();
    assert_eq!((panels(&some), panels(&all)), (2, 4), "the control: both flows have quartiles later");
    assert!(all.contains(">standardised quantile</text>") && all.contains(">standardised quantile of ln</text>"));
}

#[test]
fn many_cells_that_no_number_orders_are_named_next_to_their_colours() {
    let shapes: Vec<String> = (2..11).map(|lobes| format!("flower:{lobes}:0.05")).collect();
    let sweep = |values: &str| run(&format!("--curves 2 --points 64 --adaptive=1e-2 --t-end 0.2 --sweep {values}"));
    let survival = sweep(&format!("shape={}", shapes.join(";"))).text("plots/survival.svg");
    assert!(shapes.iter().all(|shape| survival.contains(&format!(">{shape}</text>"))), "{survival}");
    assert!(survival.contains(">shape</text>") && !survival.contains(">cell</text>"), "{survival}");
    // Names too long to be told apart in the room that there is give way to numbers.
    let alike: Vec<String> = (1..9).map(|i| format!("ellipse:2.000000000000{i},1")).collect();
    let long = format!("circle:1;{}", alike.join(";"));
    let numbered = sweep(&format!("shape={long}")).text("plots/survival.svg");
    assert!(numbered.contains(">cell</text>") && !numbered.contains(">shape</text>"), "{numbered}");
    let numbers = sweep("amplitude=0.011,0.022,0.033,0.044,0.055,0.066,0.077,0.088,0.099").text("plots/survival.svg");
    assert!(
        numbers.contains(">amplitude</text>") && !numbers.contains(">0.077</text>"),
        "the control: an axis of numbers"
    );
}
