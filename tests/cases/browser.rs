//! `report.html` in a real headless browser, if there is one; otherwise these tests are reported as ignored.
//!
//! The browser is Chromium or Chrome, without a network.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::common::{
    browser::{browser, headless},
    program::{Done, run},
};
use libtest_mimic::{Completion, Trial};

/// Members that move for a while, one that never relaxes, a series and two cells: a page with everything that a page
/// can have.
const RUN: &str = "--curves 4 --points 40 --adaptive=1e-3 --t-end 0.5 --series 0.05 --sweep omega=1,2";

/// A name and a test.
type Test = (&'static str, fn(&Path));

/// The tests; without a browser they are ignored.
pub fn trials() -> Vec<Trial> {
    let tests: [Test; 4] = [
        ("the_slider_moves_the_members_and_nothing_is_said_on_the_console", the_slider_moves_the_members),
        ("a_run_that_does_not_move_has_no_slider", a_run_that_does_not_move),
        ("a_page_whose_script_is_broken_is_found_out", a_broken_page_is_found_out),
        ("a_page_that_asks_for_the_network_is_found_out", a_request_is_found_out),
    ];
    tests.map(|(name, test)| in_browser(name, test)).into()
}

/// A test that is ignored without a browser.
pub fn in_browser(name: &str, test: fn(&Path)) -> Trial {
    Trial::ignorable_test(name, move || match browser() {
        Ok(browser) => {
            test(browser);
            Ok(Completion::Completed)
        }
        Err(missing) => Ok(Completion::ignored_with(missing)),
    })
}

/// A page after its script has run.
struct Shown {
    dom: String,
    /// Messages on the console.
    console: Vec<String>,
}

impl Shown {
    /// Opens `page`, with `fragment` after its name.
    #[track_caller]
    fn new(browser: &Path, page: &Path, fragment: &str) -> Shown {
        let (mut command, _profile) = headless(browser);
        let output = command
            .args(["--disable-gpu", "--virtual-time-budget=3000", "--dump-dom"])
            .arg(format!("file://{}{fragment}", page.display()))
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{}: {said}", browser.display());
        let console = said.lines().filter(|line| line.contains("CONSOLE")).map(str::to_owned).collect();
        Shown { dom: String::from_utf8(output.stdout).unwrap(), console }
    }

    /// The data of the members' paths with this class.
    fn paths(&self, class: &str) -> Vec<&str> {
        let begin = format!("<path class=\"{class}\" d=\"");
        self.dom.split(&begin).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
    }

    /// Whether the slider is enabled, which the script does last.
    fn has_slider(&self) -> bool {
        let controls = self.dom.split("id=\"controls\"").nth(1).map(|rest| rest.split('>').next().unwrap());
        controls.is_some_and(|attributes| !attributes.contains("hidden"))
    }
}

fn page(done: &Done) -> PathBuf {
    done.path().join("report.html")
}

/// Whether a path is closed and has `nodes` points of two integers.
fn is_polygon(path: &str, nodes: usize) -> bool {
    let inside = path.strip_prefix('M').and_then(|rest| rest.strip_suffix('Z'));
    let is_point = |point: &str| {
        point.split(' ').count() == 2 && point.split(' ').all(|v| v.parse::<u32>().is_ok_and(|value| value < 4096))
    };
    inside.is_some_and(|inside| inside.split('L').count() == nodes && inside.split('L').all(is_point))
}

fn the_slider_moves_the_members(browser: &Path) {
    let done = run(RUN);
    let [start, later, end] = ["#t=0.0", "#t=0.1", "#t=0.5"].map(|at| Shown::new(browser, &page(&done), at));
    for (shown, clock) in [(&start, "t = 0<"), (&later, "t = 0.1<"), (&end, "t = 0.5<")] {
        assert!(shown.console.is_empty(), "{:?}", shown.console);
        assert!(shown.has_slider() && shown.dom.contains(clock), "no slider at {clock}");
        assert_eq!(shown.paths("now").len(), 6);
        assert!(shown.paths("now").iter().all(|path| is_polygon(path, 40)), "{:?}", shown.paths("now"));
        assert_eq!(shown.paths("start"), start.paths("start"));
    }
    assert_eq!(start.paths("now"), start.paths("start"));
    for (a, b) in [(&start, &later), (&later, &end)] {
        for (a, b) in a.paths("now").iter().zip(b.paths("now")) {
            assert_ne!(*a, b, "a member does not move");
        }
        assert_ne!(a.paths("nodes"), b.paths("nodes"));
    }
    assert!(!is_polygon("M1 2L3 4Z", 3) && !is_polygon("M1 NaNL3 4Z", 2) && is_polygon("M1 2L3 4Z", 2));
    // Charts and their text are there with or without the script.
    for words in ["Relaxation times", "Members not yet relaxed", "Mean excess", "Mesh quality at the end"] {
        assert!(start.dom.contains(words), "no {words:?}");
    }
}

fn a_run_that_does_not_move(browser: &Path) {
    let done = run("--curves 2 --points 32 --t-end 0.001 --shape circle:1 --amplitude 0 --stop-when-relaxed");
    let shown = Shown::new(browser, &page(&done), "#t=0.1");
    assert!(shown.console.is_empty(), "{:?}", shown.console);
    assert!(!shown.has_slider() && shown.paths("now").len() == 2);
}

fn a_broken_page_is_found_out(browser: &Path) {
    let done = run(RUN);
    let text = fs::read_to_string(page(&done)).unwrap();
    let policy = text.split("<meta http-equiv=").nth(1).unwrap().split('>').next().unwrap();
    let unguarded = text.replace(&format!("<meta http-equiv={policy}>"), "");
    let spoiled = |text: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let path = done.path().join("spoiled.html");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
        Shown::new(browser, &path, "#t=0.1")
    };
    let whole = spoiled(&unguarded, "</h1>", "</h1>");
    assert!(whole.console.is_empty() && whole.has_slider(), "{:?}", whole.console);
    // The policy refuses any script but the one it names; without the policy, the script fails.
    for text in [&text, &unguarded] {
        let broken = spoiled(text, "\"use strict\";", "\"use strict\"; undefined_function();");
        assert!(!broken.console.is_empty() && !broken.has_slider(), "{:?}", broken.console);
        assert_eq!(broken.paths("now"), broken.paths("start"));
    }
    let noisy = spoiled(&unguarded, "\"use strict\";", "\"use strict\"; console.error(1);");
    assert!(!noisy.console.is_empty() && noisy.has_slider());
}

fn a_request_is_found_out(browser: &Path) {
    let done = run(RUN);
    let text = fs::read_to_string(page(&done)).unwrap();
    for request in
        ["<img src=\"https://example.org/a.png\">", "<link rel=\"stylesheet\" href=\"https://example.org/a.css\">"]
    {
        let path = done.path().join("spoiled.html");
        fs::write(&path, text.replacen("</h1>", &format!("</h1>{request}"), 1)).unwrap();
        assert!(!Shown::new(browser, &path, "").console.is_empty(), "{request}");
    }
}
