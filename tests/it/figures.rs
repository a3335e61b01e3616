//! The paper's figures: their files, that they show the data, and that the pictures in the docs are the same.

use std::{fs, path::Path, process::Output};

use curvelax::{
    ensemble::{Ended, Spec, request::spec::Solver},
    figures::{FIGURES, Figure, POINTS},
    report::progress::Progress,
};
use glam::DVec2;
use tempfile::TempDir;

use crate::common::{
    command::curvelax,
    program::{Row, column, positions},
};

fn named(name: &str) -> &'static Figure {
    FIGURES.iter().find(|figure| figure.name == name).unwrap()
}

fn figure(folder: &Path, arguments: &str) -> Output {
    curvelax(folder, &format!("figure {arguments}"))
}

/// Writes the files of these figures to `out` below the folder returned.
#[track_caller]
fn made(names: &str) -> TempDir {
    let home = TempDir::new().unwrap();
    let output = figure(home.path(), &format!("{names} --out out --quiet"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stdout.is_empty() && output.stderr.is_empty(), "not quiet");
    home
}

fn text(home: &TempDir, name: &str) -> String {
    fs::read_to_string(home.path().join("out").join(name)).unwrap()
}

fn listing(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = entries.collect();
    names.sort();
    names
}

fn rows(csv: &str) -> Vec<Row> {
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let header = reader.headers().unwrap().clone();
    let row = |record: csv::StringRecord| header.iter().zip(&record).map(|(k, v)| (k.into(), v.into())).collect();
    reader.records().map(|record| row(record.unwrap())).collect()
}

/// Whether elements are opened and closed in order, quotes paired and text escaped: the first checks of any XML parser.
fn is_well_formed(svg: &str) -> bool {
    let mut open = Vec::new();
    let mut rest = svg;
    while let Some((between, after)) = rest.split_once('<') {
        let Some((tag, after)) = after.split_once('>') else { return false };
        if between.contains('>') || between.replace("&amp;", "").replace("&lt;", "").replace("&gt;", "").contains('&') {
            return false;
        }
        if tag.matches('"').count() % 2 == 1 {
            return false;
        }
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop() != Some(name) {
                return false;
            }
        } else if !tag.ends_with('/') {
            open.push(tag.split(' ').next().unwrap_or_default());
        }
        rest = after;
    }
    open.is_empty() && rest.trim().is_empty()
}

/// An attribute of a line of SVG.
fn attribute<'a>(line: &'a str, name: &str) -> &'a str {
    let start = line.find(&format!(" {name}=\"")).expect(name) + name.len() + 3;
    line[start..].split('"').next().unwrap()
}

/// `(value, pixel)` of the ticks of an axis, in the order drawn, panel by panel.
fn ticks(svg: &str, axis: &str) -> Vec<(f64, f64)> {
    let class = format!("<text class=\"{axis} tick ");
    let tick = |line: &str| {
        let label = line.split('>').nth(1).unwrap().split('<').next().unwrap();
        (label.replace('\u{2212}', "-").parse().unwrap(), attribute(line, axis).parse().unwrap())
    };
    svg.lines().filter(|line| line.starts_with(&class)).map(tick).collect()
}

/// Pixels per unit (signed) and pixel of 0, from the first and the last tick of a panel.
fn axis(ticks: &[(f64, f64)]) -> (f64, f64) {
    let ((a, at), (b, bt)) = (ticks[0], ticks[ticks.len() - 1]);
    let scale = (bt - at) / (b - a);
    (scale, at - scale * a)
}

/// The dots of each curve, in pixels.
fn dots(svg: &str) -> Vec<Vec<DVec2>> {
    let curves = svg.split("<g class=\"curve ").skip(1);
    let dot = |step: &str| {
        let (x, y) = step.trim_end_matches("h0").split_once(' ').unwrap();
        DVec2::new(x.parse().unwrap(), y.parse().unwrap())
    };
    curves
        .map(|curve| {
            let line = curve.lines().find(|line| line.contains("class=\"nodes")).unwrap();
            attribute(line, "d").split('M').skip(1).map(dot).collect()
        })
        .collect()
}

/// Whether `svg` has axes of equal scale, with `data` drawn at the right places, all in one panel.
fn shows(svg: &str, data: &[Row]) -> bool {
    let ((x_scale, x_zero), (y_scale, y_zero)) = (axis(&ticks(svg, "x")), axis(&ticks(svg, "y")));
    // y grows downwards; a label's baseline is below its tick.
    if (x_scale + y_scale).abs() > 1e-3 * x_scale {
        return false;
    }
    let dots = dots(svg).concat();
    let place = |p: DVec2| DVec2::new(x_zero + p.x * x_scale, y_zero - 4.0 + p.y * y_scale);
    dots.len() == data.len() && positions(data).iter().zip(dots).all(|(p, dot)| place(*p).distance(dot) < 0.05)
}

#[test]
fn a_figure_shows_its_data_in_axes_of_one_scale() {
    let home = made("fig1b fig1a fig1b");
    assert_eq!(listing(&home.path().join("out")), ["fig1a.csv", "fig1a.svg", "fig1b.csv", "fig1b.svg"]);
    let [a, b] =
        ["fig1a", "fig1b"].map(|name| (text(&home, &format!("{name}.csv")), text(&home, &format!("{name}.svg"))));
    for ((csv, svg), name) in [(&a, "fig1a"), (&b, "fig1b")] {
        assert_eq!(csv.lines().next().unwrap(), "member,t,i,x,y,k,r");
        let (rows, times) = (rows(csv), named(name).times);
        assert_eq!(rows.len(), times.len() * POINTS);
        for (chunk, t) in rows.chunks(POINTS).zip(times) {
            assert!(column(chunk, "t").iter().all(|found| found == t));
            assert!(svg.contains(&format!(">t = {t}</text>")), "{t} is not in the legend");
        }
        assert!(is_well_formed(svg));
        assert!(shows(svg, &rows));
    }
    // The checks detect a difference: other data, other scales, a broken file.
    assert!(!shows(&a.1, &rows(&b.0)));
    assert!(!shows(&a.1.replace(">2.0</text>", ">2.1</text>"), &rows(&a.0)));
    assert!(!is_well_formed(&a.1.replacen("</g>", "", 1)) && !is_well_formed(&a.1.replace("Figure 1a.", "&")));
}

/// Longest over shortest edge of the last curve.
fn mesh_ratio(name: &str) -> f64 {
    let figure = named(name);
    figure.simulate(&figure.spec().unwrap(), Progress::Quiet).unwrap().outcome.end.mesh_ratio
}

#[test]
fn without_redistribution_nodes_gather_and_with_it_they_spread() {
    let (without, with) = (mesh_ratio("fig1a"), mesh_ratio("fig1b"));
    assert!(without > 3.5 && with < 1.3, "{without} {with}");
}

/// Runs to the last time but one: at rest, sweeps need long to agree on tiny increments.
fn ended(figure: &Figure, solver: Solver) -> Ended {
    let times = &figure.times[..figure.times.len() - 1];
    let spec = Spec {
        solver: solver.into(),
        t_end: Some(times[times.len() - 1].into()),
        snapshots: times.into(),
        ..figure.spec().unwrap()
    };
    figure.simulate(&spec.validate().unwrap(), Progress::Quiet).unwrap()
}

/// Largest distance between nodes of the same index.
fn distance(a: &Ended, b: &Ended) -> f64 {
    let pairs = a.rows.snapshots.iter().zip(&b.rows.snapshots);
    let differences = pairs.flat_map(|(a, b)| {
        let x = a.x.iter().zip(&b.x).map(|(a, b)| a - b);
        x.zip(a.y.iter().zip(&b.y).map(|(a, b)| a - b))
    });
    differences.map(|(x, y)| x.hypot(y)).fold(0.0, f64::max)
}

#[test]
fn sweeps_would_draw_the_same_picture() {
    let [a, b] = ["fig1a", "fig1b"].map(named);
    for figure in [a, b] {
        let apart = distance(&ended(figure, Solver::Direct), &ended(figure, Solver::GaussSeidel));
        eprintln!("{}: {apart:e}", figure.name);
        // A hundredth of a pixel, to which coordinates are written, is 7e-5.
        assert!(apart > 0.0 && apart < 7e-5, "{}: {apart:e}", figure.name);
    }
    assert!(distance(&ended(a, Solver::Direct), &ended(b, Solver::Direct)) > 0.03);
}

#[test]
fn the_pictures_in_the_docs_are_those_that_the_program_draws() {
    let names: Vec<&str> = FIGURES.iter().map(|figure| figure.name).collect();
    let home = made(&names.join(" "));
    let again = made("fig1a");
    for name in names {
        let file = format!("{name}.svg");
        let kept = fs::read_to_string(Path::new("docs/images").join(&file)).unwrap();
        assert!(
            kept == text(&home, &file),
            "docs/images/{file} is old: curvelax figure {name} --out docs/images --force"
        );
        assert!(is_well_formed(&kept) && kept.len() < 150_000, "{file}");
    }
    assert!(text(&home, "fig1a.csv") == text(&again, "fig1a.csv"), "two runs differ");
}

#[test]
fn a_wrong_request_writes_nothing() {
    let home = TempDir::new().unwrap();
    fs::write(home.path().join("file"), "mine").unwrap();
    fs::create_dir(home.path().join("old")).unwrap();
    for (arguments, parts) in [
        ("fig1 --out new", &["invalid value 'fig1'", "fig1a, fig1b, fig1c, fig2", "similar value"][..]),
        ("fig1a fig3 --out new", &["invalid value 'fig3'"]),
        ("--out new", &["<NAME>"]),
        ("fig1a", &["--out <DIR>"]),
        ("fig1a --out old", &["--out old: already exists; ", "--force"]),
        ("fig1a --out file --force", &["--out file: exists but is not a folder"]),
        ("fig1a --tau 1 --out new", &["unexpected argument '--tau'"]),
    ] {
        let output = figure(home.path(), arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(message.starts_with("error: ") && output.stdout.is_empty(), "{arguments}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments}: {message}");
        assert_eq!(listing(home.path()), ["file", "old"], "{arguments}");
        assert_eq!(listing(&home.path().join("old")), [""; 0], "{arguments}");
    }
}

#[test]
fn a_second_figure_joins_the_first_with_force() {
    let home = made("fig1a");
    fs::write(home.path().join("out/notes.txt"), "mine").unwrap();
    let output = figure(home.path(), "fig1b --out out --force");
    let [said, notes] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success(), "{notes}");
    assert!(said.contains("fig1b   ellipse:2,1  surface-diffusion") && said.contains("fig1b.svg, fig1b.csv"), "{said}");
    assert!(notes.contains("solved directly"), "{notes}");
    let all = ["fig1a.csv", "fig1a.svg", "fig1b.csv", "fig1b.svg", "notes.txt"];
    assert_eq!(listing(&home.path().join("out")), all);
}
