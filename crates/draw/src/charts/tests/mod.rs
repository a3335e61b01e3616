//! Properties of every chart, whatever its data.
//!
//! To look at the pictures: `CURVELAX_CHARTS=FOLDER cargo test charts`.

mod reading;
mod samples;

use super::Setting;
use crate::medium::Medium;
use reading::{attribute, commands, complaint, paths, scale, texts};
use samples::{amplitudes, decay, draw_all, pictures, survival};

#[test]
fn no_text_of_any_chart_is_cut_off_or_over_another() {
    for (name, svg) in pictures() {
        if let Some(complaint) = complaint(svg) {
            panic!("{name}: {complaint}\n{svg}");
        }
        assert!(texts(svg).iter().any(|text| text.class == "head"), "{name}");
    }
    // The check detects a difference.
    let (_, svg) = &pictures()[0];
    let labels: Vec<&str> = svg.lines().filter(|line| line.contains("x tick")).collect();
    let moved = svg.replace(labels[0], labels[1]);
    assert!(complaint(&moved).is_some_and(|complaint| complaint.contains("is over")));
    let (title, outside) = ("x=\"20\" y=\"26\"", "x=\"620\" y=\"26\"");
    assert!(complaint(&svg.replace(title, outside)).is_some_and(|complaint| complaint.contains("cut off")));
}

#[test]
fn no_text_is_cut_off_or_over_another_on_paper_of_any_width() {
    // 80 mm, a column, a page and 300 mm, with 7 points for 12 pixels.
    for width in [388.0, 413.0, 826.0, 1458.0] {
        for (name, svg) in draw_all(Medium::Paper(width)) {
            // Hostile names are as long as they like.
            if let Some(complaint) = complaint(&svg).filter(|_| name != "hostile") {
                panic!("{name}: {complaint}\n{svg}");
            }
            assert!(!svg.contains("@media") && attribute(&svg, "width") == width.to_string(), "{name}");
            assert!(!texts(&svg).iter().any(|text| text.class == "head" || text.content.contains("seed 1")), "{name}");
            // What a legend says is not shortened.
            let cut = texts(&svg).into_iter().find(|text| text.class == "label" && text.content.ends_with('…'));
            assert!(cut.is_none(), "{name}: {}", cut.unwrap().content);
        }
    }
    // The charts of a screen would not fit.
    let narrow = |svg: &str| svg.replacen("width=\"560\"", "width=\"413\"", 1);
    assert!(pictures().iter().all(|(_, svg)| complaint(&narrow(svg)).is_some()));
}

#[test]
fn equal_data_give_equal_bytes_and_no_number_is_unknown() {
    for ((name, svg), (_, twin)) in pictures().iter().zip(draw_all(Medium::Screen)) {
        assert!(*svg == twin, "{name}: two drawings differ");
        let drawing = svg.split("</style>").nth(1).unwrap();
        for word in ["NaN", "inf", "-0 ", "e-", "null"] {
            let found = drawing.split('"').skip(1).step_by(2).any(|attribute| attribute.contains(word));
            assert!(!found, "{name}: {word} in {svg}");
        }
        assert!(!drawing.contains("NaN") && !drawing.contains("inf<"), "{name}: {svg}");
    }
}

#[test]
fn every_picture_is_small_whatever_its_data() {
    for (name, svg) in pictures() {
        assert!(svg.len() < 100_000, "{name}: {} bytes", svg.len());
        if let Some(folder) = std::env::var_os("CURVELAX_CHARTS") {
            std::fs::write(std::path::Path::new(&folder).join(format!("{name}.svg")), svg).unwrap();
        }
    }
}

#[test]
fn nothing_is_drawn_outside() {
    for (name, svg) in pictures() {
        let [width, height] = ["width", "height"].map(|name| attribute(svg, name).parse::<f64>().unwrap());
        for data in svg.lines().filter(|line| line.starts_with("<path ")).map(|line| attribute(line, "d")) {
            for (command, numbers) in commands(data) {
                let inside = match (command, &numbers[..]) {
                    ('M' | 'L', [x, y]) => (0.0..=width).contains(x) && (0.0..=height).contains(y),
                    ('H', [x]) => (0.0..=width).contains(x),
                    ('V', [y]) => (0.0..=height).contains(y),
                    ('h' | 'v', [_]) | ('l' | 'm', [_, _]) | ('a', _) | ('Z', []) => true,
                    _ => false,
                };
                assert!(inside, "{name}: {command}{numbers:?} in {data}");
            }
        }
    }
}

#[test]
fn labels_are_escaped() {
    let pictures = pictures();
    let (_, svg) = pictures.last().unwrap();
    assert!(svg.contains("&lt;script&gt;alert(&quot;a &amp; b&quot;)&lt;/script&gt;"), "{svg}");
    assert!(!svg.contains("<script") && !svg.contains('\0'));
}

#[test]
fn where_there_is_nothing_to_draw_the_picture_says_why() {
    let pictures = pictures();
    let text = |name: &str| {
        let (_, svg) = pictures.iter().find(|(found, _)| found == name).unwrap();
        texts(svg).iter().map(|text| text.content.clone()).collect::<Vec<_>>().join(" ")
    };
    for (name, sentence) in [
        ("relaxation", "412 of 512 members relaxed; 100 have no t_relax (88 unfinished, 12 stalled)."),
        ("relaxation-none", "No member relaxed, so there are no relaxation times to count."),
        ("relaxation-none", "0 of 100 members relaxed; 100 have no t_relax"),
        ("relaxation-empty", "There are no members."),
        ("relaxation-one", "The only member relaxed."),
        ("survival-none", "There are no members"),
        ("survival-1000", "24 of 1000 cells are drawn, spread over all."),
        ("decay-none", "There is no positive mean excess to draw."),
        ("decay-zero", "There is no positive mean excess to draw."),
        ("decay-one", "The mean excess is known at one time only"),
        ("dependence", "fit: t_relax ∝ amplitudeᵖ, p = \u{2212}0.312 (95 %: \u{2212}0.330 to \u{2212}0.294)"),
        ("dependence-partial", "1 cell without a median"),
        ("dependence-none", "There are no cells to compare."),
        ("dependence-unreached", "In no cell did enough members relax for a median."),
        ("dependence-names", "The first 40 of 60 settings are drawn."),
        ("scatter", "ended without t_relax, at its last time"),
        ("scatter-none", "Nothing is claimed."),
        ("scatter-unknown", "2 dots out of range."),
        ("mesh", "members with metric_drift above 0.1."),
        ("mesh-none", "No member has a mesh_ratio."),
        ("mesh-zero", "1 member with metric_drift 0 left out."),
        ("mesh-unknown", "members without mesh_ratio."),
    ] {
        let text = text(name);
        assert!(text.contains(sentence), "{name}: {text}");
    }
}

fn picture(name: &str) -> &'static str {
    &pictures().iter().find(|(found, _)| found == name).unwrap().1
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 2e-3 * b.abs()
}

#[test]
fn medians_are_where_the_ticks_say() {
    let svg = picture("dependence");
    let (x, y) = (scale(svg, "x", true), scale(svg, "y", true));
    let series = amplitudes(0.12, 8);
    // The first of each kind belongs to the legend.
    let dots = &paths(svg, "dots")[1..];
    assert_eq!(dots.len(), series.levels.len());
    for (dot, level) in dots.iter().zip(&series.levels) {
        let Setting::Number(at) = level.at else { panic!("a name") };
        assert!(near(x(dot[0][0]), at) && near(y(dot[0][1]), level.median.unwrap().value), "{dot:?} {level:?}");
    }
    let law = &paths(svg, "dashed")[1];
    assert_eq!(law.len(), 2);
    for (end, at) in law.iter().zip([0.01, 0.01 * 1.6_f64.powi(7)]) {
        assert!(near(x(end[0]), at) && near(y(end[1]), 0.12 * at.powf(-0.312)), "{law:?}");
    }
}

#[test]
fn members_are_where_the_ticks_say_and_tell_their_numbers() {
    let svg = picture("scatter-one");
    let (x, y) = (scale(svg, "x", false), scale(svg, "y", false));
    let dot = svg.lines().find(|line| line.contains("<title>member 0: ")).unwrap();
    let (told, at) = (dot.split(['>', '<']).nth(4).unwrap(), commands(attribute(dot, "d")));
    let numbers: Vec<f64> =
        told["member 0: ".len()..].replace('−', "-").split(", ").map(|number| number.parse().unwrap()).collect();
    let (_, place) = &at[0];
    assert!((x(place[0]) - numbers[0]).abs() < 1e-3 && near(y(place[1]), numbers[1]), "{dot}: {at:?}");
    let all = picture("scatter");
    assert_eq!(all.matches("<title>member ").count(), 4 * 256);
    assert_eq!(all.matches(", ended ").count(), 4 * 15);
}

#[test]
fn survival_falls_to_what_is_left() {
    let svg = picture("survival-1");
    let (x, y) = (scale(svg, "x", false), scale(svg, "y", false));
    let curve = survival(256, 0.3, 1.4);
    let end = curve.t.iter().chain(&curve.censored).copied().fold(0.0, f64::max);
    let line = &paths(svg, "series")[1];
    let (first, last) = (line[0], line[line.len() - 1]);
    assert!((y(first[1]) - 1.0).abs() < 1e-3, "{line:?}");
    assert!((y(last[1]) - curve.survival[curve.survival.len() - 1]).abs() < 1e-3, "{line:?}");
    assert!(near(x(last[0]), end), "{line:?}");
    assert_eq!(paths(svg, "band").len(), 1);
}

#[test]
fn the_histogram_and_the_share_count_every_member() {
    let svg = picture("relaxation");
    // Two panels, one below the other, whose ticks come in this order.
    let below = svg.rfind("<text class=\"y tick end\"").unwrap();
    let below = svg[..below].rfind(">0.0</text>").map(|at| svg[..at].rfind('\n').unwrap() + 1).unwrap();
    let (members, share) = (scale(&svg[..below], "y", false), scale(&svg[below..], "y", false));
    let bars = &paths(svg, "bars")[0];
    let counted: f64 = bars.chunks(4).map(|bar| members(bar[1][1])).sum();
    assert!((counted - 412.0).abs() < 1.0, "{counted}");
    let steps = &paths(svg, "series")[0];
    let relaxed = share(steps[steps.len() - 1][1]);
    assert!((relaxed - 412.0 / 512.0).abs() < 1e-3, "{relaxed}");
}

#[test]
fn cells_have_a_curve_each_and_many_are_coloured_by_their_value() {
    for name in ["relaxation", "rates"] {
        for (cells, panels) in [(2, 1), (8, 1), (20, 1)] {
            let svg = picture(&format!("{name}-cells-{cells}"));
            let panels = if name == "relaxation" { 2 * panels } else { panels };
            // Entries of the legend are lines, too.
            let entries = if cells <= 8 { cells } else { 0 };
            assert_eq!(paths(svg, "series").len(), entries + panels * cells, "{name} {cells}");
            assert_eq!(svg.contains("amplitude = 1"), cells <= 8, "{name} {cells}");
            assert_eq!(svg.contains("<g class=\"r0\">"), cells > 8, "{name} {cells}");
        }
        let many = picture(&format!("{name}-cells-300"));
        assert!(many.contains("24 of 300 cells are drawn"), "{many}");
    }
    // The share of each cell is that of its own members.
    let svg = picture("relaxation-cells-2");
    let below = svg.rfind("<text class=\"y tick end\"").unwrap();
    let below = svg[..below].rfind(">0.0</text>").map(|at| svg[..at].rfind('\n').unwrap() + 1).unwrap();
    let share = scale(&svg[below..], "y", false);
    let lines = paths(svg, "series");
    for line in &lines[lines.len() - 2..] {
        assert!((share(line[line.len() - 1][1]) - 512.0 / 519.0).abs() < 2e-3, "{line:?}");
    }
}

#[test]
fn the_mean_excess_and_its_theory_fall_as_they_should() {
    let svg = picture("decay-1");
    let (x, y) = (scale(svg, "x", false), scale(svg, "y", true));
    let close = |a: f64, b: f64| (a / b - 1.0).abs() < 0.01;
    let line = &paths(svg, "series")[1];
    let [t, excess] = line[line.len() - 1];
    let curve = decay(6.0, 60);
    assert!(near(x(t), 1.5) && close(y(excess), curve.mean[59]), "{} {}", x(t), y(excess));
    for [t, excess] in &paths(svg, "dashed")[1] {
        assert!(close(y(*excess), 0.06 * (-6.0 * x(*t)).exp()), "{} {}", x(*t), y(*excess));
    }
}
