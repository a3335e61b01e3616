#[path = "../../../../draw/src/charts/tests/samples.rs"]
mod samples;

use std::f64::consts::TAU;

use glam::DVec2;

use base64::Engine as _;
use sha2::{Digest, Sha256};

use super::*;
use samples::pictures;

/// A perturbed ellipse whose modes decay as in theory, recorded often at first and rarely later.
fn member(j: usize) -> MovingMember {
    let nodes = |t: f64| -> Vec<DVec2> {
        let node = |i: usize| {
            let u = TAU * i as f64 / 100.0;
            let mode = |m: f64, a: f64| a * (-(m.powi(4) - m.powi(2)) * t).exp() * (m * u + (j * j) as f64).cos();
            let r =
                1.4 + 0.45 * (-12.0 * t).exp() * (2.0 * u).cos() + mode(3.0, 0.12) + mode(5.0, 0.06) + mode(8.0, 0.03);
            r * DVec2::from_angle(u)
        };
        (0..100).map(node).collect()
    };
    let times: Vec<f64> = (0..=40).map(|i| 0.5 * (i as f64 / 40.0).powi(2)).collect();
    let label = format!("member {j}: relaxed at t = {:.3}", 0.38 + 0.01 * j as f64);
    MovingMember { label, status: "relaxed", nodes: times.iter().map(|t| nodes(*t)).collect(), times }
}

fn table(rows: usize) -> PageTable {
    let row = |i: usize| {
        [
            format!("{}", 0.01 * i as f64),
            "512".into(),
            format!("{}", 500 - i % 100),
            "0.4121".into(),
            if i == 0 { "" } else { "0.41" }.into(),
        ]
    };
    PageTable {
        note: String::new(),
        caption: "Relaxation times by cell".into(),
        header: ["amplitude", "members", "relaxed", "median t_relax", "low"].map(String::from).into(),
        rows: (1..=rows).map(|i| row(i).into()).collect(),
        source: "ensemble.csv".into(),
    }
}

fn warnings() -> Vec<String> {
    vec![
        "12 of 4096 members failed (see status): unless the flow itself becomes singular, a smaller --tau or --adaptive, \
         or more --points, helps"
            .into(),
        "88 members are censored: the mean t_relax is biased low, so read the median".into(),
    ]
}

/// A page like that of a study.
fn page(warnings: &[String]) -> Page<'_> {
    let kinds = ["relaxation", "survival-8", "decay-3", "dependence", "mesh", "survival-20", "dependence-named-3"];
    let figure = |name: &&str| {
        let (_, svg) = pictures().iter().find(|(found, _)| found == name).unwrap();
        let caption = "Members without t_relax are censored at the end of the run.".into();
        PageFigure { name: "", title: (*name).into(), caption, svg: svg.clone() }
    };
    let headline = [
        ("median t_relax", "0.412 length⁴", "95 %: 0.407 to 0.418"),
        ("25 to 75 % of the members", "0.351 to 0.497", "length⁴"),
        ("rate / theory", "0.998", "median of 3996 fits"),
    ];
    let headline =
        headline.map(|(label, value, note)| Headline { label: label.into(), value: value.into(), note: note.into() });
    Page {
        head: PageHead {
            title: "4096 perturbed ellipses under surface diffusion".into(),
            what: "8 amplitudes from 0.01 to 0.2, 512 members each: ellipse:2,1, n = 100, adaptive 0.0001, t-end = 2, \
                   seed 1."
                .into(),
            statuses: vec![("relaxed", 3996), ("unfinished", 88), ("singular", 4), ("nonfinite", 0), ("stalled", 8)],
            relaxed_before: 0,
            headline: headline.into(),
        },
        clock: "",
        warnings,
        members: (0..6).map(member).collect(),
        is_list: false,
        units: Default::default(),
        legend: &[],
        plots: kinds.iter().map(figure).collect(),
        tables: vec![table(8)],
        spec: "curves = 512\nshape = \"ellipse:2,1\"\nflow = \"surface-diffusion\"\nadaptive = 0.0001\n\n[sweep]\namplitude = [0.01, 0.02]\n",
        provenance: vec![("version".into(), "curvelax 0.1.0".into()), ("seed".into(), "1".into())],
    }
}

/// Elements are opened and closed in order, attributes are quoted.
fn is_well_formed(html: &str) -> bool {
    const VOID: [&str; 4] = ["!DOCTYPE", "meta", "link", "input"];
    let mut open: Vec<&str> = Vec::new();
    let mut rest = html;
    while let Some((_, after)) = rest.split_once('<') {
        let Some((tag, after)) = after.split_once('>') else { return false };
        rest = after;
        let name = tag.split([' ', '\n']).next().unwrap_or_default();
        if tag.matches('"').count() % 2 == 1 {
            return false;
        }
        if let Some(name) = name.strip_prefix('/') {
            if open.pop() != Some(name) {
                return false;
            }
        } else if name == "script" || name == "style" {
            let Some((_, after)) = rest.split_once(&format!("</{name}>")) else { return false };
            rest = after;
        } else if !tag.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
        }
    }
    open.is_empty()
}

#[test]
fn a_page_is_one_well_formed_file_with_equal_bytes() {
    let warnings = warnings();
    let html = page(&warnings).html();
    assert!(is_well_formed(&html));
    assert!(html == page(&warnings).html());
    assert!(!is_well_formed(&html.replacen("</section>", "", 1)));
    if let Some(folder) = std::env::var_os("CURVELAX_CHARTS") {
        std::fs::write(std::path::Path::new(&folder).join("report.html"), &html).unwrap();
    }
    assert!(html.len() < 1_000_000, "{}", html.len());
}

#[test]
fn the_first_screen_answers_the_four_questions_in_order() {
    let warnings = warnings();
    let html = page(&warnings).html();
    let places: Vec<usize> = [
        "<h1>4096 perturbed ellipses under surface diffusion</h1>",
        "<strong>3996</strong> of 4096 members relaxed (97.6 %)",
        "unfinished 88 (2.1 %)",
        "median t_relax",
        "0.412 length⁴",
        "12 of 4096 members failed",
        "member 0: relaxed at t = 0.380",
        "<h2 id=\"plots\">",
    ]
    .map(|part| html.find(part).unwrap_or_else(|| panic!("{part}")))
    .into();
    assert!(places.is_sorted(), "{places:?}");
}

#[test]
fn nothing_is_asked_of_the_network_and_only_the_script_may_run() {
    let warnings = warnings();
    let html = page(&warnings).html();
    let policy = html.split("Content-Security-Policy\" content=\"").nth(1).unwrap().split('"').next().unwrap();
    let script = html.split("<script>").nth(1).unwrap().split("</script>").next().unwrap();
    let digest = base64::prelude::BASE64_STANDARD.encode(Sha256::digest(script));
    assert_eq!(SCRIPT_DIGEST, format!("sha256-{digest}"), "the script has changed, and its digest must follow");
    assert!(policy.starts_with("default-src 'none';") && policy.contains(SCRIPT_DIGEST), "{policy}");
    for word in ["src=", "@import", "url(", "fetch(", "https:", "<iframe", "<object"] {
        assert!(!html.contains(word), "{word}");
    }
    assert_eq!(html.matches("http:").count(), html.matches("xmlns=\"http://www.w3.org/2000/svg\"").count());
    let still = Page::default().html();
    assert!(still.contains("script-src 'none'") && !still.contains("<script"), "{still}");
}

#[test]
fn everything_is_escaped() {
    let evil = "</script></style></title><script>alert(\"1\")</script>";
    let warnings = [evil.to_owned()];
    let owned = || evil.to_owned();
    let html = Page {
        head: PageHead {
            title: owned(),
            what: owned(),
            statuses: vec![(evil, 3)],
            relaxed_before: 0,
            headline: vec![Headline { label: owned(), value: owned(), note: owned() }],
        },
        clock: "",
        warnings: &warnings,
        members: vec![MovingMember { label: owned(), ..member(0) }],
        is_list: false,
        units: Default::default(),
        legend: &[],
        plots: vec![PageFigure { name: "", title: owned(), caption: owned(), svg: "<svg></svg>".into() }],
        tables: vec![PageTable {
            note: String::new(),
            caption: owned(),
            header: vec![owned()],
            rows: vec![vec![owned()]; 300],
            source: owned(),
        }],
        spec: evil,
        provenance: vec![(owned(), owned())],
    }
    .html();
    assert!(!html.contains("alert(\""));
    assert_eq!(html.matches("<script>").count(), 1);
    assert!(html.matches("alert(&quot;1&quot;)").count() > 200 && is_well_formed(&html));
}

#[test]
fn an_empty_page_says_so_and_holds_no_number_that_is_none() {
    let html = Page { head: PageHead { title: "nothing".into(), ..PageHead::default() }, ..Page::default() }.html();
    assert!(is_well_formed(&html));
    assert!(html.contains("There are no members.") && html.contains("Nothing: there are no warnings."), "{html}");
    let statuses = vec![("relaxed", 0), ("unfinished", 1)];
    let censored = Page {
        head: PageHead { statuses, ..PageHead::default() },
        members: vec![MovingMember::default()],
        tables: vec![PageTable::default()],
        ..Page::default()
    };
    let censored = censored.html();
    assert!(censored.contains("<strong>0</strong> of 1 member relaxed (0.0 %)"), "{censored}");
    assert!(censored.contains("1 member had not relaxed when time was up"), "{censored}");
    for html in [html, censored] {
        assert!(!html.contains("NaN") && !html.contains("inf ") && !html.contains("id=\"play\""));
    }
}

#[test]
fn long_tables_are_cut_and_say_so() {
    let html = table(10_000).html();
    assert_eq!(html.matches("<tr>").count(), 1 + MAX_ROWS);
    let link = "The first 200 of 10\u{a0}000 rows. All numbers: <a href=\"ensemble.csv\">ensemble.csv</a>";
    assert!(html.contains(link), "{html}");
    assert!(html.contains("<th scope=\"row\" class=\"number\">0.01</th>"), "{html}");
    assert!(table(3).html().matches("<tr>").count() == 4 && !table(3).html().contains("The first"));
}

#[test]
fn tables_of_few_rows_and_many_columns_are_turned() {
    let wide = |rows: usize| PageTable {
        header: (0..9).map(|j| format!("column {j}")).collect(),
        rows: vec![(0..9).map(|j| format!("{j}.5")).collect(); rows],
        ..table(0)
    };
    let turned = wide(2).html();
    assert_eq!(turned.matches("<tr>").count(), 9);
    let row = "<tr><th scope=\"row\">column 3</th><td class=\"number\">3.5</td><td class=\"number\">3.5</td></tr>";
    assert!(turned.contains(row) && turned.contains("href=\"ensemble.csv\""), "{turned}");
    assert_eq!(wide(4).html().matches("<tr>").count(), 1 + 4);
}

#[test]
fn shares_are_0_and_100_only_where_they_are() {
    let shares = [(0, 7), (7, 7), (1, 100_000), (99_999, 100_000), (1, 3), (0, 0)].map(|(part, all)| share(part, all));
    assert_eq!(shares, ["0.0 %", "100.0 %", "< 0.1 %", "> 99.9 %", "33.3 %", "0.0 %"]);
}

#[test]
fn the_page_of_a_large_study_stays_small() {
    let figure = |(name, svg): &(String, String)| PageFigure {
        name: "",
        title: name.clone(),
        caption: name.clone(),
        svg: svg.clone(),
    };
    let mut long = member(0);
    long.times = (0..200).map(f64::from).collect();
    long.nodes = vec![long.nodes[0].repeat(10); 200];
    let warnings = warnings();
    let html = Page {
        members: vec![long; 8],
        plots: pictures().iter().map(figure).collect(),
        tables: vec![table(10_000); 10],
        ..page(&warnings)
    }
    .html();
    assert!(html.len() < 3_000_000 && is_well_formed(&html), "{}", html.len());
}
