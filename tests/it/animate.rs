//! Movies of finished runs.

use std::{fs, path::Path, process::Output};

use crate::common::{
    command::{curvelax, done},
    program::{Done, column, run},
};
use gif::{DisposalMethod, Repeat};

/// Members that relax at different times.
const RUN: &str = "--curves 5 --points 40 --adaptive=1e-3 --t-end 2";
const SECOND: &str = "--seconds 1";
/// Twenty frames a second and the last one.
const FRAMES: usize = 21;

#[track_caller]
fn animate(home: &Path, arguments: &str) -> Output {
    curvelax(home, &format!("animate {arguments}"))
}

/// What the program prints; it must succeed with nothing on stderr.
#[track_caller]
fn animated(home: &Path, arguments: &str) -> String {
    let output = animate(home, arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.is_empty(), "{arguments}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

/// A GIF as a viewer shows it: size, and delay and colours of each frame.
struct Shown {
    width: usize,
    height: usize,
    frames: Vec<(u16, Vec<[u8; 3]>)>,
}

impl Shown {
    fn read(path: &Path) -> Shown {
        let mut decoder = gif::Decoder::new(fs::File::open(path).unwrap()).unwrap();
        assert_eq!(decoder.repeat(), Repeat::Infinite);
        let (width, height) = (usize::from(decoder.width()), usize::from(decoder.height()));
        let palette: Vec<[u8; 3]> = decoder.global_palette().unwrap().as_chunks().0.to_vec();
        let mut canvas = vec![[0; 3]; width * height];
        let mut frames = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            assert_eq!(frame.dispose, DisposalMethod::Keep);
            for (i, index) in frame.buffer.iter().enumerate().filter(|(_, index)| Some(**index) != frame.transparent) {
                let (x, y) = (i % usize::from(frame.width), i / usize::from(frame.width));
                canvas[(y + usize::from(frame.top)) * width + x + usize::from(frame.left)] =
                    palette[usize::from(*index)];
            }
            frames.push((frame.delay, canvas.clone()));
        }
        Shown { width, height, frames }
    }

    /// The darkest of the pixels around a point.
    fn darkest(&self, frame: usize, [x, y]: [f64; 2]) -> [u8; 3] {
        let near = |v: f64| [v - 1.0, v, v + 1.0].map(|v| v.round() as usize);
        let pixels = near(x).into_iter().flat_map(|x| near(y).map(|y| (x, y)));
        pixels.map(|(x, y)| self.frames[frame].1[y * self.width + x]).min_by_key(|c| c[0]).unwrap()
    }
}

/// The nodes of path data `M…l…z` in tenths of a pixel, in pixels.
fn nodes(data: &str) -> Vec<[f64; 2]> {
    let spaced = data.replace('-', " -").replace(['M', 'l', 'z'], " ");
    let numbers: Vec<f64> = spaced.split_whitespace().map(|word| word.parse().unwrap()).collect();
    let mut at = [0.0; 2];
    let node = |step: &[f64; 2]| {
        at = [at[0] + 0.1 * step[0], at[1] + 0.1 * step[1]];
        at
    };
    numbers.as_chunks().0.iter().map(node).collect()
}

/// The states of each member in an SVG.
fn states(svg: &str) -> Vec<Vec<Vec<[f64; 2]>>> {
    let values = svg.split("attributeName=\"d\" values=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    values.map(|values| values.split(";\n").map(nodes).collect()).collect()
}

#[test]
fn a_gif_shows_all_members_from_start_to_end() {
    let done = run(RUN);
    let said = animated(done.home.path(), &format!("out {SECOND}"));
    assert!(said.starts_with("results    out/movie.gif: 5 members, 2 s, 21 frames, "), "{said}");
    let size = fs::metadata(done.path().join("movie.gif")).unwrap().len();
    // As other sizes are told.
    assert!(said.ends_with(&format!(", {:.0} KB\n", size as f64 / 1024.0)), "{said}");
    let shown = Shown::read(&done.path().join("movie.gif"));
    let delays: Vec<u16> = shown.frames.iter().map(|(delay, _)| *delay).collect();
    assert_eq!((shown.width, delays.len(), delays.iter().sum::<u16>()), (800, FRAMES, 200));
    assert_eq!(delays[FRAMES - 1], 100, "the last frame is held");
    assert!(shown.height > 200 && shown.height < 800, "{}", shown.height);
    assert!(shown.frames.windows(2).all(|pair| pair[0].1 != pair[1].1), "every frame moves");

    // The SVG has the same layout, so its nodes tell where the lines of the GIF are.
    animated(done.home.path(), &format!("out {SECOND} --out movie.svg"));
    let svg = fs::read_to_string(done.home.path().join("movie.svg")).unwrap();
    let members = states(&svg);
    assert_eq!(members.len(), 5);
    let is_blue = |[r, g, b]: [u8; 3]| r < 90 && g < 170 && b > 150;
    for states in &members {
        assert_eq!(states[0].len(), 40);
        let start = |frame: usize| states[0].iter().filter(|node| is_blue(shown.darkest(frame, **node))).count();
        assert_eq!(start(0), 40, "the curve is at its start");
        assert!(start(FRAMES - 1) < 30, "it has left it: {}", start(FRAMES - 1));
        let end = states.last().unwrap();
        assert!(end.iter().all(|node| is_blue(shown.darkest(FRAMES - 1, *node))), "the curve is at its end");
        // Its start remains in grey.
        let left = states[0].iter().map(|node| shown.darkest(FRAMES - 1, *node));
        assert!(left.clone().all(|c| c[0] < 200), "{:?}", left.collect::<Vec<_>>());
    }
}

#[test]
fn movie_and_report_tell_the_limit_and_that_their_clock_is_raw() {
    let raw = "t is that of the run, not the limit";
    let of = |more: &str| {
        let done = run(&format!("--curves 2 --points 64 --accurate --units um,h --mobility 2 {more}"));
        animated(done.home.path(), &format!("out {SECOND} --out movie.svg"));
        let movie = fs::read_to_string(done.home.path().join("movie.svg")).unwrap();
        (movie, done.text("report.html"), done.summary())
    };
    let (movie, report, members) = of("");
    assert!(movie.contains(raw) && report.contains(raw));
    for limit in column(&members, "t_limit") {
        let digits = 3 - limit.log10().floor() as i32;
        let words = format!("relaxed, t_limit = {limit:.*} h", digits as usize);
        assert!(movie.contains(&words) && report.contains(&words), "{words}");
    }
    let (movie, report, _) = of("--refine=false");
    assert!(!movie.contains(raw) && !report.contains(raw) && movie.contains(">relaxed at t = "));
}

#[test]
fn an_svg_is_xml_with_a_moving_path_for_each_member() {
    let done = run(&format!("{RUN} --units um,h --mobility 2 --sweep amplitude=0.05,0.1"));
    animated(done.home.path(), "out --out new/movie.svg --members 4 --width 500");
    let text = fs::read_to_string(done.home.path().join("new/movie.svg")).unwrap();
    assert_eq!(text.matches("<path class=\"moving\"").count(), 4);
    assert_eq!(text.matches("<path class=\"before\"").count(), 4);
    assert!(text.contains("width=\"500\"") && text.contains(" h</text>") && text.contains(" µm</text>"), "{text}");
    assert!(!text.contains("<script"));
    for member in ["member 0", "member 9", "amplitude = 0.05", "amplitude = 0.1"] {
        assert!(text.contains(&format!(">{member}</text>")), "{member}");
    }
    let mut open: Vec<&str> = Vec::new();
    for tag in text.split('<').skip(1).map(|rest| rest.split('>').next().unwrap()) {
        let name = tag.split_whitespace().next().unwrap();
        match name.strip_prefix('/') {
            Some(name) => assert_eq!(open.pop(), Some(name)),
            None if !tag.ends_with('/') => open.push(name),
            None => {}
        }
        assert!(tag.matches('"').count().is_multiple_of(2), "{tag}");
    }
    assert_eq!(open, [""; 0], "every element is closed");
    for states in states(&text) {
        assert_eq!(states.len(), 62);
        assert!(states.iter().all(|nodes| nodes.len() == 40));
        let way = |i: usize| {
            let pairs = states[i].iter().zip(&states[i + 1]);
            pairs.map(|(a, b)| (a[0] - b[0]).abs() + (a[1] - b[1]).abs()).sum::<f64>() / 40.0
        };
        let moved = (0..20).map(|i| way(3 * i) + way(3 * i + 1) + way(3 * i + 2)).filter(|way| *way > 0.05).count();
        assert!(moved >= 15, "it moves throughout: {moved} of 20 parts");
    }
}

#[test]
fn the_same_folder_gives_the_same_bytes() {
    let done = run(RUN);
    let made = |name: &str| {
        animated(done.home.path(), &format!("out --out {name} {SECOND} --quiet"));
        fs::read(done.home.path().join(name)).unwrap()
    };
    assert!(made("a.gif") == made("b.gif") && made("a.svg") == made("b.svg"));
    let moved = done.home.path().join("moved");
    fs::rename(done.path(), &moved).unwrap();
    animated(done.home.path(), &format!("moved {SECOND} --quiet"));
    assert!(fs::read(moved.join("movie.gif")).unwrap() == fs::read(done.home.path().join("a.gif")).unwrap());
    assert_eq!(fs::read_dir(done.home.path()).unwrap().count(), 5, "nothing else is left");
}

#[test]
fn twelve_members_stay_below_two_megabytes() {
    let done = run("--curves 12 --points 100 --adaptive=1e-3 --t-end 2");
    for (name, most) in [("movie.gif", 2_000_000), ("movie.svg", 1_000_000)] {
        animated(done.home.path(), &format!("out --out {name}"));
        let size = fs::metadata(done.home.path().join(name)).unwrap().len();
        assert!(size > 50_000 && size < most, "{name}: {size}");
    }
}

/// Checks that `arguments` are refused with the words `said`, and nothing is written.
#[track_caller]
fn refused(home: &Path, arguments: &str, said: &str) {
    let names = || {
        let mut names: Vec<_> = fs::read_dir(home).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let before = names();
    let output = animate(home, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
    assert!(message.starts_with("error: ") && message.contains(said), "{arguments}: {message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(output.stdout.is_empty() && names() == before, "{arguments}");
}

#[test]
fn what_cannot_be_made_is_refused_with_its_reason() {
    let done = run("--curves 2 --points 32 --adaptive=1e-3 --t-end 0.4");
    let home = done.home.path();
    fs::write(home.join("old.gif"), "old").unwrap();
    fs::create_dir_all(home.join("folder.gif")).unwrap();
    fs::create_dir_all(home.join("empty")).unwrap();
    refused(home, "none", "none: no such folder; give that of a run");
    refused(home, "empty", "empty: no run there; give its folder (no run.json)");
    refused(home, "out --out movie.mp4", "--out movie.mp4: unknown extension; write .gif or .svg");
    refused(home, "out --out movie", "--out movie: no extension; write .gif or .svg");
    refused(home, "out --seconds 0", "--seconds 0: out of range; use 0.5 to 60");
    refused(home, "out --seconds nan", "--seconds NaN: out of range; use 0.5 to 60");
    refused(home, "out --width 9", "--width 9: out of range; use 160 to 1920 pixels");
    refused(home, "out --members 0", "--members 0: out of range; use 1 to 12");
    refused(home, "out --members 13", "--members 13: out of range; use 1 to 12");
    refused(home, "out --out old.gif", "--out old.gif: already exists; name another file, or add --force");
    refused(home, "out --out folder.gif --force", "folder.gif is a folder; move it away");
    refused(home, "out --out old.gif/movie.gif", "--out old.gif: exists but is not a folder");
    assert_eq!(fs::read(home.join("old.gif")).unwrap(), b"old");
    animated(home, &format!("out --out old.gif --force {SECOND}"));
    assert_eq!(Shown::read(&home.join("old.gif")).frames.len(), FRAMES);
    unfinished(&done);
}

/// Takes away what makes a run complete.
fn unfinished(done: &Done) {
    let home = done.home.path();
    let portraits = done.path().join("plots/portraits.json");
    let kept = fs::read_to_string(&portraits).unwrap();
    fs::write(&portraits, &kept[..kept.len() - 40]).unwrap();
    refused(home, "out", "out/plots/portraits.json: it ends inside");
    fs::write(&portraits, "{\"members\":[]}").unwrap();
    refused(home, "out", "out/plots/portraits.json: no members to show: the run could not save them");
    fs::remove_file(&portraits).unwrap();
    refused(home, "out --out new/movie.gif", "out/plots/portraits.json: no members to show: the run could not save");
    fs::remove_file(done.path().join("run.json")).unwrap();
    fs::rename(done.path().join("summary.csv"), done.path().join(".summary.csv.part")).unwrap();
    refused(home, "out", "out: the run there has not finished; curvelax resume out continues it");
}

#[test]
fn a_new_run_in_the_folder_takes_the_movie_of_the_old_one_away() {
    let old = run("--curves 1 --points 32 --adaptive=1e-3 --t-end 0.1");
    animated(old.home.path(), &format!("out {SECOND}"));
    animated(old.home.path(), &format!("out {SECOND}"));
    assert!(old.path().join("movie.gif").exists());
    done(old.home.path(), "run --curves 2 --points 32 --t-end 0.1 --backend cpu --quiet --out out --force");
    assert!(!old.path().join("movie.gif").exists());
}
