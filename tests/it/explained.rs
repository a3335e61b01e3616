//! What was drawn for members, their shape at the start, and what of it explains their times.

use std::f64::consts::TAU;

use crate::common::program::{Row, column, number, positions, run};
use glam::DVec2;

const SHAPE: &str = "excess_start,energy_start,k_min_start,k_max_start,descriptor_2,descriptor_3,descriptor_4,\
                     descriptor_5,descriptor_6,descriptor_7,descriptor_8,convex";

/// Relaxes 60 members in a moment.
const QUICK: &str = "--curves 60 --points 40 --modes 2..=4 --adaptive=1e-3 --stop-when-relaxed";

#[test]
fn the_features_are_those_of_the_spec() {
    let header = |flags: &str| run(flags).text("members.csv").lines().next().unwrap().to_owned();
    let short = "--curves 1 --points 40 --t-end 0.001";
    assert_eq!(header(&format!("{short} --modes 2..=3")), format!("member,cell,label,cos_2,sin_2,cos_3,sin_3,{SHAPE}"));
    assert_eq!(header(&format!("{short} --amplitude 0")), format!("member,cell,label,{SHAPE}"));
    let drawn = "--shape ellipse:uniform(1.2..3),1 --amplitude uniform(0.01..0.02) --modes 4..=4";
    assert_eq!(header(&format!("{short} {drawn}")), format!("member,cell,label,shape_1,amplitude,cos_4,sin_4,{SHAPE}"));
}

#[test]
fn cells_share_the_columns_and_leave_empty_what_they_have_not() {
    let done = run("--curves 2 --points 40 --t-end 0.001 --sweep amplitude=0,0.1 --sweep modes=2..=2,3..=3");
    let header = done.text("members.csv").lines().next().unwrap().to_owned();
    assert_eq!(header, format!("member,cell,label,cos_2,sin_2,cos_3,sin_3,{SHAPE}"));
    for row in done.rows("members.csv") {
        let has = |name: &str| !row[name].is_empty();
        let cell = row["cell"].as_str();
        assert_eq!((has("cos_2"), has("sin_2")), (cell == "2", cell == "2"), "{row:?}");
        assert_eq!((has("cos_3"), has("sin_3")), (cell == "3", cell == "3"), "{row:?}");
        assert!(SHAPE.split(',').all(has), "{row:?}");
    }
}

#[test]
fn coefficients_and_shape_are_those_of_the_nodes() {
    // Nodes at equal angles, whose radii are the perturbation.
    let n = 60;
    let done = run(&format!(
        "--curves 5 --points {n} --shape circle:1 --sampling parameter --amplitude 0.2 --modes 2..=4 --t-end 0.001 \
         --snapshots 0"
    ));
    let (members, summary, nodes) = (done.rows("members.csv"), done.summary(), done.rows("snapshots.csv"));
    let mut convex = Vec::new();
    for ((member, row), nodes) in members.iter().zip(&summary).zip(nodes.chunks(n)) {
        let points = positions(nodes);
        for m in 2..=4 {
            let wave = |of: fn(f64) -> f64| -> f64 {
                let term = |p: &DVec2| of(f64::from(m) * p.y.atan2(p.x)) * p.length();
                points.iter().map(term).sum::<f64>() * 2.0 / n as f64
            };
            for (name, value) in [(format!("cos_{m}"), wave(f64::cos)), (format!("sin_{m}"), wave(f64::sin))] {
                assert!((number(member, &name) - value).abs() < 1e-12, "{name}: {} {value}", member[&name]);
            }
        }
        assert_eq!((&member["excess_start"], &member["energy_start"]), (&row["excess_start"], &row["energy_start"]));
        let k = column(nodes, "k");
        let [low, high] = [f64::min, f64::max].map(|of| k.iter().copied().reduce(of).unwrap());
        for (name, value) in [("k_min_start", low), ("k_max_start", high)] {
            assert!((number(member, name) / value - 1.0).abs() < 1e-12, "{name}: {} {value}", member[name]);
        }
        let turn = |i: usize| {
            let [a, b, c] = [i, i + 1, i + 2].map(|i| points[i % n]);
            (b - a).perp_dot(c - b)
        };
        let is_convex = (0..n).all(|i| turn(i) >= 0.0);
        assert_eq!(member["convex"], u8::from(is_convex).to_string());
        convex.push(is_convex);
        for k in 2..=8 {
            let (own, found) = (descriptor(&points, f64::from(k)), number(member, &format!("descriptor_{k}")));
            assert!((own - found).abs() < 1e-4, "descriptor_{k}: {found}, by quadrature {own}");
        }
    }
    assert!(convex.contains(&true) && convex.contains(&false), "{convex:?}");
}

/// The descriptor of mode k, by sums over many points at equal distances along the polygon.
fn descriptor(points: &[DVec2], k: f64) -> f64 {
    const COUNT: u32 = 6000;
    let edges: Vec<(DVec2, DVec2)> = points.iter().copied().zip(points.iter().copied().cycle().skip(1)).collect();
    let length: f64 = edges.iter().map(|(a, b)| a.distance(*b)).sum();
    let mut z = Vec::new();
    let mut s = 0.0;
    for (a, b) in edges {
        let edge = a.distance(b);
        while z.len() < COUNT as usize {
            let at = length * (z.len() as f64 + 0.5) / f64::from(COUNT);
            if at > s + edge {
                break;
            }
            z.push(a.lerp(b, (at - s) / edge));
        }
        s += edge;
    }
    let size = |m: f64| {
        let term = |(i, z): (usize, &DVec2)| z.rotate(DVec2::from_angle(-m * TAU * i as f64 / f64::from(COUNT)));
        z.iter().enumerate().map(term).sum::<DVec2>().length()
    };
    size(1.0 + k).hypot(size(1.0 - k)) / size(1.0)
}

/// The rows of a time.
fn of_time(rows: &[Row], time: &str) -> Vec<Row> {
    rows.iter().filter(|row| row["time"] == time).cloned().collect()
}

#[test]
fn the_best_feature_is_named_first_with_the_share_it_explains() {
    let done = run(QUICK);
    let (members, times) = (done.rows("members.csv"), column(&done.summary(), "t_relax"));
    let rows = of_time(&done.rows("explained.csv"), "t_relax");
    assert_eq!(rows[0]["feature"], "cos_2");
    for row in &rows[..rows.len() - 1] {
        let r = correlation(&column(&members, &row["feature"]), &times);
        assert!((number(row, "r2") - r * r).abs() < 1e-12, "{row:?}: {}", r * r);
        assert_eq!((row["members"].as_str(), row["censored"].as_str()), ("60", "0"));
    }
    assert!(rows[..rows.len() - 1].windows(2).all(|pair| number(&pair[0], "r2") >= number(&pair[1], "r2")));
    assert!(number(&rows[0], "r2") > 0.9, "{:?}", rows[0]);
    let together = rows.last().unwrap();
    assert_eq!((together["feature"].as_str(), together["spearman"].as_str()), ("together", ""));
    assert!(number(together, "r2") > number(&rows[0], "r2"), "{together:?}");
    let chosen = rows.iter().filter(|row| row["feature"] != "together" && !row["chosen"].is_empty()).count();
    assert_eq!(chosen.to_string(), together["chosen"]);
    let svg = done.text("plots/features.svg");
    assert_eq!(svg.matches("<title>member 7: ").count(), 4);
    assert!(svg.contains(">cos_2<") && !svg.contains("ended without"), "{svg}");
    assert!(done.text("report.html").contains("What explains the times"));
}

fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (a, b) = (mean(x), mean(y));
    let sum = |of: &dyn Fn(f64, f64) -> f64| x.iter().zip(y).map(|(x, y)| of(x - a, y - b)).sum::<f64>();
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}

#[test]
fn members_that_did_not_relax_are_counted_and_beside_many_nothing_is_claimed() {
    let mut times = column(&run(QUICK).summary(), "t_relax");
    times.sort_by(f64::total_cmp);
    for (late, claims) in [(3, true), (9, false)] {
        // Between two times, so that so many members are late.
        let t_end = 0.5 * (times[59 - late] + times[60 - late]);
        let done = run(&format!("{QUICK} --t-end {t_end}"));
        let all = done.rows("explained.csv");
        let (relaxed, halved) = (of_time(&all, "t_relax"), of_time(&all, "t_half"));
        let counts = |row: &Row| [row["members"].clone(), row["censored"].clone()];
        assert!(relaxed.iter().all(|row| counts(row) == [(60 - late).to_string(), late.to_string()]), "{relaxed:?}");
        assert!(halved.len() > 1 && halved.iter().all(|row| counts(row) == ["60", "0"]), "{halved:?}");
        assert_eq!((relaxed.len() > 1, !relaxed.last().unwrap()["r2"].is_empty()), (claims, claims), "{relaxed:?}");
        let svg = done.text("plots/features.svg");
        assert_eq!(svg.contains("ended without t_relax"), claims);
        assert_eq!(svg.matches(", ended ").count(), if claims { 4 * late } else { 0 });
        assert_eq!(svg.contains("Nothing is said about a time"), !claims);
    }
    let few = run(&QUICK.replace("60", "19")).rows("explained.csv");
    assert!(few.len() == 2 && few.iter().all(|row| row["feature"] == "together" && row["r2"].is_empty()), "{few:?}");
    let none = run("--curves 30 --points 40 --amplitude 0 --adaptive=1e-3 --stop-when-relaxed");
    assert!(none.rows("explained.csv").is_empty());
    assert!(none.text("plots/features.svg").contains("do not differ in any feature"));
}

#[test]
fn many_modes_have_the_columns_of_the_lowest_and_the_page_says_so() {
    let done = run("--curves 25 --points 200 --modes 5..=40 --amplitude 0.02 --adaptive=1e-2 --stop-when-relaxed");
    let header = done.text("members.csv").lines().next().unwrap().to_owned();
    assert!(
        header.starts_with("member,cell,label,cos_5,sin_5,") && header.contains(",cos_36,sin_36,excess_start"),
        "{header}"
    );
    assert!(done.text("report.html").contains("The 4 highest modes of the perturbation are not among the features"));
}
