//! Threads, subsets, order and interruptions change no row.

use std::fs;

use crate::{
    Found, Outcome,
    folder::{Content, content, differences},
    program::{Running, curvelax},
    study::{Attempt, Study},
};

const TABLES: [&str; 3] = ["summary.csv", "series.csv", "snapshots.csv"];

/// The tables of the reference.
fn tables(files: &Content) -> Content {
    files.iter().filter(|(name, _)| name.ends_with(".csv")).map(|(name, text)| (name.clone(), text.clone())).collect()
}

/// One, two, three and more threads, from the start and from the middle.
pub fn threads(study: &Study) -> Outcome {
    let expected = tables(&study.reference().files);
    let mut cases = 0;
    for threads in [1, 2, 3, 7] {
        let done = |attempt: &Attempt, arguments: &str| {
            let arguments = format!("{arguments} --threads {threads}");
            let ended = Running::start(&mut curvelax(attempt.home.path(), &arguments)).end();
            assert_eq!(ended.code, Some(0), "{ended:?}");
            content(&attempt.out())
        };
        let attempt = Attempt::new(study);
        let run = done(&attempt, &attempt.run().replace("--threads 1", ""));
        let found = differences(&expected, &tables(&run));
        assert!(found.is_empty(), "{threads} threads: {found:?}");
        // The number of threads at its end is in its files.
        let attempt = Attempt::interrupted(study);
        let found = differences(&run, &done(&attempt, "resume out --quiet"));
        assert!(found.is_empty(), "resumed with {threads} threads: {found:?}");
        cases += 2;
    }
    Found::new(cases, "0 differing bytes")
}

/// Members alone, in pairs and requested in another order.
pub fn subsets(study: &Study, subsets: &[&str]) -> Outcome {
    let expected = &study.reference().files;
    let text = |files: &Content, name: &str| {
        files.get(name).map_or_else(Vec::new, |text| {
            let text = String::from_utf8(text.clone()).unwrap();
            text.lines().map(str::to_owned).collect::<Vec<_>>()
        })
    };
    for subset in subsets {
        let attempt = Attempt::new(study);
        let run = format!("{} --only {subset}", attempt.run());
        let ended = Running::start(&mut curvelax(attempt.home.path(), &run)).end();
        assert_eq!(ended.code, Some(0), "{ended:?}");
        let found = content(&attempt.out());
        let asked = |line: &String| {
            let first = line.split(',').next().unwrap();
            first == "member" || subset.split(',').any(|member| member == first)
        };
        for name in TABLES {
            let rows: Vec<String> = text(expected, name).into_iter().filter(asked).collect();
            assert!(rows.len() != 1 || name != TABLES[0], "no row to compare");
            assert!(text(&found, name) == rows, "{name} of {subset}");
        }
    }
    Found::new(subsets.len(), "0 differing bytes")
}

/// The same run again.
pub fn repeats(study: &Study, times: usize) -> Outcome {
    for _ in 0..times {
        let attempt = Attempt::new(study);
        let ended = attempt.start().end();
        assert_eq!(ended.code, Some(0), "{ended:?}");
        attempt.must_be_the_reference(&["a repeat".into()]);
        assert!(fs::read_dir(attempt.home.path()).unwrap().count() >= 1);
    }
    Found::new(times, "0 differing bytes")
}
