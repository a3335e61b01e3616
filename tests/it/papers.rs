//! Pictures for papers: PNG and PDF from a finished run.

use std::{fs, path::Path};

use crate::common::{
    command::curvelax,
    program::{Done, run},
};

/// A run with two cells, whose first members are outlines of the same letters.
fn small() -> Done {
    run("--curves 4 --points 32 --adaptive=1e-3 --t-end 0.4 --sweep omega=1,2")
}

#[track_caller]
fn plotted(home: &Path, arguments: &str) -> String {
    let output = curvelax(home, &format!("plot {arguments}"));
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Names of the files in a folder with this extension, without it.
fn names(folder: &Path, extension: &str) -> Vec<String> {
    let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let stems = paths.filter(|path| path.extension().is_some_and(|own| own == extension));
    let mut stems: Vec<String> = stems.map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect();
    stems.sort();
    stems
}

/// Width and height of a PNG file.
fn size(png: &[u8]) -> [u32; 2] {
    assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n");
    [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()))
}

#[test]
fn every_picture_of_a_run_has_its_print() {
    let done = small();
    let (home, plots) = (done.home.path(), done.path().join("plots"));
    let (svg, page) = (fs::read(plots.join("survival.svg")).unwrap(), done.text("report.html"));
    let said = plotted(home, "out --format png,pdf --dpi 100");
    let all = names(&plots, "svg");
    assert!(all.len() >= 9, "{all:?}");
    assert_eq!((names(&plots, "png"), names(&plots, "pdf")), (all.clone(), all.clone()));
    assert!(
        said.starts_with("results    out: plots/relaxation.png, plots/relaxation.pdf, plots/distribution.png"),
        "{said}"
    );
    // What is for screens stays as it is.
    assert_eq!((fs::read(plots.join("survival.svg")).unwrap(), done.text("report.html")), (svg, page));
    // A column has 85 mm, and a page twice that.
    let width = |name: &str| size(&fs::read(home.join(name)).unwrap())[0];
    for name in &all {
        assert_eq!(width(&format!("out/plots/{name}.png")), 335, "{name}");
        assert!(fs::read(plots.join(format!("{name}.pdf"))).unwrap().starts_with(b"%PDF-1."), "{name}");
    }
    plotted(home, "out --format png --dpi 100 --width page --out wide --quiet");
    assert_eq!(width("wide/plots/survival.png"), 669);
    assert_eq!(names(&home.join("wide/plots"), "png"), all);
    assert!(names(&home.join("wide/plots"), "svg").is_empty() && !home.join("wide/report.html").exists());
    plotted(home, "out --format svg,pdf --width 90 --out both");
    assert_eq!((names(&home.join("both/plots"), "svg"), names(&home.join("both/plots"), "pdf")), (all.clone(), all));
    // Redrawn to the same bytes, over the earlier ones.
    let first = fs::read(plots.join("curves.pdf")).unwrap();
    fs::write(plots.join("curves.pdf"), "old").unwrap();
    plotted(home, "out --format pdf --quiet");
    assert!(fs::read(plots.join("curves.pdf")).unwrap() == first);
}

#[test]
fn the_next_run_in_the_folder_removes_the_prints_of_the_last() {
    let done = small();
    plotted(done.home.path(), "out --format png,pdf --dpi 72 --quiet");
    assert!(!names(&done.path().join("plots"), "pdf").is_empty());
    let again = curvelax(done.home.path(), "run --curves 2 --points 32 --t-end 0.01 --quiet --force --out out");
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    for extension in ["png", "pdf"] {
        assert_eq!(names(&done.path().join("plots"), extension), [""; 0]);
    }
}

#[test]
fn names_in_letters_that_the_font_lacks_are_noted() {
    for (name, is_told) in [("長", true), ("čáß", false)] {
        let home = tempfile::tempdir().unwrap();
        for name in [name, "other"] {
            fs::write(home.path().join(format!("{name}.csv")), "0,0\n1,0\n1,1\n0,1\n").unwrap();
        }
        let ran = curvelax(home.path(), "run --shape files:*.csv --points 32 --t-end 0.01 --quiet --out out");
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        let said = String::from_utf8(curvelax(home.path(), "plot out --format pdf").stderr).unwrap();
        let expected = "note: 1 letter not in the font of png and pdf, drawn as empty boxes: 長\n";
        assert_eq!(said.contains(expected), is_told, "{name}: {said}");
    }
}

#[test]
fn what_no_picture_can_use_is_refused_before_anything_is_written() {
    let done = small();
    let home = done.home.path();
    for (arguments, said) in [
        ("--format pngg", "tip: a similar value exists: 'png'"),
        ("--format", "a value is required for '--format <FORMAT,...>'"),
        (
            "--format pdf --width colum",
            "--width colum: not a width (did you mean `column`?); use column (85 mm), page (170",
        ),
        ("--format pdf --width 20", "--width 20: out of range; use column (85 mm), page (170 mm) or 80 to 300 mm"),
        ("--format png --dpi 20", "--dpi 20: out of range; use 72 to 1200 dots per inch"),
        ("--format png --dpi -20", "--dpi -20: out of range; use 72 to 1200 dots per inch"),
        ("--format pdf --dpi 300", "--dpi 300: no picture uses it; add --format png, or leave it out"),
        ("--width page", "--width page: no picture uses it; add --format png, or pdf, or leave it out"),
        ("--format svg --width page", "--width page: no picture uses it"),
    ] {
        let output = curvelax(home, &format!("plot out --out new {arguments}"));
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && message.contains(said), "{arguments}: {message}");
        assert!(!home.join("new").exists(), "{arguments}");
    }
}

#[test]
fn figures_and_the_work_diagram_have_prints() {
    let home = tempfile::TempDir::new().unwrap();
    let done = |arguments: &str| {
        let output = curvelax(home.path(), arguments);
        assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    };
    let read = |name: &str| fs::read(home.path().join(name)).unwrap();
    done("figure fig1a fig2 --out plain --quiet");
    done("figure fig1a fig2 --out all --quiet --format svg,png,pdf --dpi 100");
    done("figure fig1a fig2 --out page --quiet --format png --dpi 100 --width page");
    // Again, over the files of before.
    done("figure fig1a fig2 --out page --quiet --format png --dpi 100 --width page --force");
    for name in ["fig1a", "fig2"] {
        assert!(read(&format!("plain/{name}.svg")) == read(&format!("all/{name}.svg")), "{name} for screens");
        assert!(read(&format!("plain/{name}.csv")) == read(&format!("page/{name}.csv")), "data of {name}");
        assert!(read(&format!("all/{name}.pdf")).starts_with(b"%PDF-1."), "{name}");
        let [column, page] = ["all", "page"].map(|folder| size(&read(&format!("{folder}/{name}.png")))[0]);
        assert_eq!([column, page], [335, 669], "{name}");
    }
    assert_eq!(names(&home.path().join("page"), "svg"), [""; 0]);
    done("convergence --work-precision --solver direct --backend cpu --out work --quiet --format png --dpi 100");
    assert_eq!(size(&read("work/work_precision.png"))[0], 335);
    assert_eq!(names(&home.path().join("work"), "svg"), [""; 0]);
    for (arguments, said) in [
        ("figure fig1a --out none --width 90", "--width 90: no picture uses it; add --format png, or pdf"),
        ("figure fig1a --out none --format pdf --dpi 300", "--dpi 300: no picture uses it; add --format png"),
        ("figure fig1a --out none --format png --dpi 9", "--dpi 9: out of range"),
        ("convergence --out none --format png", "only --work-precision draws a picture"),
        ("convergence --work-precision --format png", "only --work-precision draws a picture"),
    ] {
        let output = curvelax(home.path(), arguments);
        let words = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && words.contains(said), "{arguments}: {words}");
        assert!(!home.path().join("none").exists(), "{arguments}");
    }
}
