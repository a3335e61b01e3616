//! Negative controls: a comparison that finds nothing must be able to find something.

use std::fs;

use crate::{
    Found, Outcome,
    folder::{content, copy, differences},
    study::{Attempt, Study},
};

/// One changed byte in any file, an extra file and a missing file are all detected; other clock times are not.
pub fn differences_are_seen(study: &Study) -> Outcome {
    let attempt = Attempt::new(study);
    assert_eq!(attempt.start().end().code, Some(0));
    let expected = &study.reference().files;
    let same = |attempt: &Attempt| differences(expected, &content(&attempt.out()));
    assert_eq!(same(&attempt), [""; 0]);
    let mut cases = 0;
    let files = expected.iter().filter(|(_, text)| !text.is_empty());
    for (name, _) in files {
        let path = attempt.out().join(name);
        let own = fs::read(&path).unwrap();
        for place in [own.len() / 2, own.len() - 1] {
            let mut other = own.clone();
            other[place] ^= 1;
            fs::write(&path, other).unwrap();
            let seen = same(&attempt);
            assert!(seen.len() == 1 && seen[0].starts_with(name.as_str()), "{name}: {seen:?}");
            cases += 1;
        }
        fs::remove_file(&path).unwrap();
        assert_eq!(same(&attempt), [format!("{name} is missing")]);
        fs::write(&path, own).unwrap();
        cases += 1;
    }
    for left in [".curvelax.state", ".curvelax.lock", "plots/.curves.svg.part", "other"] {
        attempt.write(left, b"");
        assert_eq!(same(&attempt), [format!("{left} is left over")]);
        fs::remove_file(attempt.out().join(left)).unwrap();
        cases += 1;
    }
    fs::create_dir(attempt.out().join(".snapshots.zarr.part")).unwrap();
    assert_eq!(same(&attempt), [".snapshots.zarr.part/ is left over"]);
    fs::remove_dir(attempt.out().join(".snapshots.zarr.part")).unwrap();
    let json = fs::read_to_string(attempt.out().join("run.json")).unwrap();
    for (line, seen) in
        [("  \"started\": \"", 0), ("  \"wall_seconds\": ", 0), ("  \"seed\": ", 1), ("  \"steps\": ", 1)]
    {
        let changed = json.replacen(line, &format!("{line}1"), 1);
        assert!(json != changed, "run.json has no {line}");
        attempt.write("run.json", changed.as_bytes());
        assert_eq!(same(&attempt).len(), seen, "{line}");
        cases += 1;
    }
    attempt.write("run.json", json.as_bytes());
    let copied = Attempt::new(study);
    copy(&attempt.out(), &copied.out());
    assert_eq!(same(&copied), [""; 0]);
    Found::new(cases + 1, "every one seen")
}
