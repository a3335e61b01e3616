//! Pages that can be read: in a browser, by what is on the page, at the width of a desk and of a phone, light and dark.
//!
//! A page is opened in a frame of the width; a script around it measures. Each thing that it finds has a page with that
//! fault, in which it must find it.

use std::{fs, path::Path};

use crate::common::{
    browser::headless,
    program::{Done, run, run_with},
};
use libtest_mimic::Trial;

/// The pages that were hard to read: one cell, two swept keys, few outlines, units.
const RUNS: [&str; 3] = [
    "--curves 24 --points 64 --accurate",
    "--curves 6 --points 40 --adaptive=1e-3 --t-end auto --stop-when-relaxed --sweep amplitude=0.02,0.05,0.1 \
     --sweep flow=surface-diffusion,willmore",
    "--curves 24 --points 40 --adaptive=1e-3 --t-end auto --mobility 2.5e-3 --units um,h",
];

/// Measures the page in the frame; a line for each fault, `done` at the end.
const MEASURE: &str = r##"
addEventListener("load", () => {
    const page = document.querySelector("iframe").contentDocument;
    const faults = [];
    const rect = (element) => element.getBoundingClientRect();
    const words = (element) => element.textContent.trim();
    const root = page.documentElement;
    if (root.scrollWidth > root.clientWidth) faults.push(`scroll: ${root.scrollWidth} > ${root.clientWidth}`);
    // Boxes of text in a picture: none outside it, none over another.
    for (const svg of page.querySelectorAll("figure svg")) {
        const texts = [...svg.querySelectorAll("text")].filter((text) => words(text) !== "");
        const boxes = texts.map(rect);
        const all = rect(svg);
        texts.forEach((text, i) => {
            const box = boxes[i];
            if (box.left < all.left - 1 || box.right > all.right + 1 || box.top < all.top - 1 || box.bottom > all.bottom + 1)
                faults.push(`cut: ${words(text)}`);
            for (let j = 0; j < i; j++) {
                const other = boxes[j];
                // Fonts have air above and below.
                const air = 0.15 * Math.min(box.height, other.height) + 0.5;
                const wide = Math.min(box.right, other.right) - Math.max(box.left, other.left);
                const high = Math.min(box.bottom, other.bottom) - Math.max(box.top, other.top);
                if (wide > 0.5 && high > air) faults.push(`over: ${words(text)} over ${words(texts[j])}`);
            }
        });
        // Names of rows and panels stand for different things.
        const names = texts.filter((text) => text.classList.contains("y") && text.classList.contains("tick"));
        const named = names.map(words).filter((name) => !/^[\d.\s\u2212\u00b7\u2070-\u209f\u00b2\u00b3\u00b9]+$/.test(name));
        named.filter((name, i) => named.indexOf(name) < i).forEach((name) => faults.push(`equal: ${name}`));
        texts.filter((text) => words(text).endsWith("\u2026")).forEach((text) => faults.push(`cut: ${words(text)}`));
    }
    for (const list of page.querySelectorAll(".legend, .headline, .members")) {
        const names = [...list.querySelectorAll("li, dt, figcaption")].map(words);
        names.filter((name, i) => names.indexOf(name) < i).forEach((name) => faults.push(`equal: ${name}`));
    }
    for (const element of page.querySelectorAll("h1, h2, p, li, dt, dd, figcaption, summary"))
        if (element.scrollWidth > element.clientWidth + 1 && element.clientWidth > 1) faults.push(`cut: ${words(element)}`);
    // Contrast, by WCAG 2.
    const numbers = (colour) => colour.match(/[\d.]+/g).map(Number);
    const level = (colour) => {
        const [r, g, b] = numbers(colour).slice(0, 3).map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05;
    };
    const style = (element) => page.defaultView.getComputedStyle(element);
    const behind = (element) => {
        const svg = element.closest("svg");
        const back = svg && svg.querySelector(".back");
        if (back) return style(back).fill;
        for (let at = element; at; at = at.parentElement) {
            const own = numbers(style(at).backgroundColor);
            if (own.length < 4 || own[3] > 0) return style(at).backgroundColor;
        }
        return "rgb(255, 255, 255)";
    };
    for (const element of page.querySelectorAll("text, h1, h2, p, li, dt, dd, figcaption, td, th, summary, a, button")) {
        const ink = element.closest("svg") ? style(element).fill : style(element).color;
        const [a, b] = [level(ink), level(behind(element))];
        const contrast = Math.max(a, b) / Math.min(a, b);
        if (words(element) !== "" && contrast < 4.5) faults.push(`faint: ${words(element)}: ${contrast.toFixed(1)}`);
    }
    // Figures with nothing in them, and halves of the page that stay blank.
    for (const svg of page.querySelectorAll(".plots svg"))
        if (svg.querySelectorAll("path:not(.grid):not(.ticks), .panel").length === 0) faults.push("empty: " + svg.getAttribute("aria-label"));
    document.body.innerHTML = "<pre></pre>";
    document.querySelector("pre").textContent = faults.concat("done").join("\n");
});
"##;

/// The tests; without a browser they are ignored.
pub fn trials() -> Vec<Trial> {
    type Test = fn(&Path);
    let tests: [(&str, Test); 2] = [
        ("pages_can_be_read_at_a_desk_and_on_a_phone", pages_can_be_read),
        ("each_fault_of_a_page_is_found", faults_are_found),
    ];
    tests.map(|(name, test)| crate::browser::in_browser(name, test)).into()
}

/// The faults of `page` at a width in pixels.
#[track_caller]
fn faults(browser: &Path, page: &str, width: u32, dark: bool) -> Vec<String> {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("frame.html");
    let inside = page.replace('&', "&amp;").replace('"', "&quot;");
    let frame = format!("<iframe width=\"{width}\" height=\"900\" style=\"border: 0\" srcdoc=\"{inside}\"></iframe>");
    fs::write(&path, format!("<!doctype html><meta charset=\"utf-8\"><body><script>{MEASURE}</script>{frame}"))
        .unwrap();
    let (mut command, _profile) = headless(browser);
    if dark {
        command.arg("--blink-settings=preferredColorScheme=0");
    }
    let output = command
        .args(["--disable-gpu", "--virtual-time-budget=5000", "--window-size=1600,1200", "--dump-dom"])
        .arg(format!("file://{}", path.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8(output.stdout).unwrap();
    let said = dom.split("<pre>").nth(1).and_then(|rest| rest.split("</pre>").next());
    let mut lines: Vec<String> = said.unwrap_or_default().lines().map(str::to_owned).collect();
    assert_eq!(lines.pop().as_deref(), Some("done"), "{}", String::from_utf8_lossy(&output.stderr));
    lines
}

fn text(done: &Done) -> String {
    fs::read_to_string(done.path().join("report.html")).unwrap()
}

/// Three outlines with names that begin alike.
fn outlines() -> Done {
    let outline = |a: f64| {
        let point = |i: u32| {
            let u = std::f64::consts::TAU * f64::from(i) / 48.0;
            format!("{},{}\n", a * u.cos(), u.sin() * (1.0 + 0.2 * (3.0 * u).cos()))
        };
        (0..48).map(point).collect::<String>()
    };
    let texts = [1.2, 1.5, 2.0].map(outline);
    let names = ["a-long-common-beginning-of-islands-1.csv", "a-long-common-beginning-of-islands-2.csv", "b.csv"];
    let files: Vec<(&str, &str)> = names.into_iter().zip(texts.iter().map(String::as_str)).collect();
    run_with(&files, "--shape files:*.csv --points 40 --accurate")
}

fn pages_can_be_read(browser: &Path) {
    let pages = RUNS.iter().map(|arguments| run(arguments)).chain([outlines()]);
    for (i, done) in pages.enumerate() {
        let page = text(&done);
        for (width, dark) in [(1280, false), (390, false), (1280, true), (390, true)] {
            let found = faults(browser, &page, width, dark);
            assert!(found.is_empty(), "page {i} at {width}, dark {dark}: {found:#?}");
        }
    }
}

fn faults_are_found(browser: &Path) {
    let page = text(&run(RUNS[1]));
    let found = |from: &str, to: &str, fault: &str| {
        assert!(page.contains(from), "{from}");
        let spoiled = page.replacen(from, to, 1);
        let found = faults(browser, &spoiled, 390, false);
        assert!(found.iter().any(|line| line.starts_with(fault)), "{fault}: {found:?}");
    };
    let row = ">0.05, surface-diffusion</text>";
    found(row, ">0.02, surface-diffusion</text>", "equal: 0.02, surface-diffusion");
    found(row, ">0.05, surface-di…</text>", "cut: 0.05, surface-di…");
    found(row, &format!(">{}</text>", "a long name ".repeat(8)), "cut: a long name");
    let label = page.lines().find(|line| line.contains("class=\"x tick middle\"")).unwrap();
    found(label, &format!("{label}\n{label}"), "over: ");
    found("<li><svg", "<li>flow = willmore</li><li><svg", "equal: flow = willmore");
    found("</h1>", "</h1><div style=\"width: 500px\">wide</div>", "scroll: ");
    found("--ink: #24292f; --note: #57606a", "--ink: #24292f; --note: #b0b8c0", "faint: ");
    let figure = "<div class=\"plots\">";
    found(figure, &format!("{figure}<figure><svg aria-label=\"hollow\"></svg></figure>"), "empty: hollow");
    assert!(faults(browser, &page, 390, false).is_empty(), "the control");
}
