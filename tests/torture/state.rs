//! Damaged checkpoints: any bit, any length.

use std::{fs, path::Path, time::Instant};

use crate::{
    Found, Outcome,
    program::{Ended, HANGS},
    random::Random,
    study::{Attempt, Study},
};

const NEWEST: &str = ".curvelax.state";
const BEFORE: &str = ".curvelax.state.old";

/// An interrupted run with its two checkpoints.
fn with_two_states(study: &Study) -> Attempt<'_> {
    let since = Instant::now();
    // A run may end before it is asked to stop.
    while since.elapsed() < HANGS {
        let attempt = Attempt::interrupted(study);
        let mut running = attempt.resume();
        running.wait_until(|running| running.handles(15));
        running.signal("TERM");
        let ended = running.end();
        if ended.code == Some(75) && [NEWEST, BEFORE].iter().all(|name| attempt.out().join(name).is_file()) {
            return attempt;
        }
        eprintln!("{}: {ended:?} with {:?}", study.name, attempt.names());
    }
    panic!("{}: no run has two states", study.name);
}

/// Flips every `stride`-th bit of the newest checkpoint, and truncates it at every `cut`-th length.
pub fn damaged(study: &Study, stride: usize, cut: usize, seed: u64) -> Outcome {
    let mut random = Random::new(seed);
    let prepared = with_two_states(study);
    let whole = fs::read(prepared.out().join(NEWEST)).unwrap();
    let mut damages: Vec<(String, Vec<u8>)> = Vec::new();
    for bit in (random.below(stride)..8 * whole.len()).step_by(stride) {
        let mut flipped = whole.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        damages.push((format!("bit {bit} of {}", 8 * whole.len()), flipped));
    }
    for length in (random.below(cut)..whole.len()).step_by(cut) {
        damages.push((format!("{length} of {} bytes", whole.len()), whole[..length].to_vec()));
    }
    damages.push(("a byte more".into(), [&whole[..], &[0]].concat()));
    damages.push(("twice".into(), [&whole[..], &whole[..]].concat()));
    // Alone, it must be refused.
    let alone = prepared.fork();
    fs::remove_file(alone.out().join(BEFORE)).unwrap();
    let before = alone.names();
    for (what, bytes) in &damages {
        alone.write(NEWEST, bytes);
        let ended = alone.resume().end();
        must_be_refused(&ended, what);
        assert_eq!(fs::read(alone.out().join(NEWEST)).unwrap(), *bytes, "{what}: touched");
        assert_eq!(alone.names(), before, "{what}");
    }
    alone.write(NEWEST, &whole);
    alone.must_end_well(Ended { code: Some(2), signal: None, said: "the state is whole again".into() });
    // With the previous one it can be resumed; some damages are tested in separate folders.
    let mut used = 0;
    let few = damages.len().min(if stride == 1 { 2000 } else { 40 });
    for _ in 0..few {
        let (what, bytes) = &damages[random.below(damages.len())];
        let attempt = prepared.fork();
        attempt.write(NEWEST, bytes);
        let ended = attempt.resume().end();
        match ended.code {
            Some(0) => {
                used += 1;
                attempt.must_be_the_reference(&[format!("{what}: {ended:?}")]);
            }
            _ => must_be_refused(&ended, what),
        }
    }
    assert!(2 * used > few, "the state before was used {used} times of {few}");
    both_damaged(&prepared, &whole);
    let result = format!("all refused alone, 0 panics; the one before used in {used} of {few}, 0 differing bytes");
    Found::new(damages.len() + few, result)
}

fn both_damaged(prepared: &Attempt, whole: &[u8]) {
    let attempt = prepared.fork();
    attempt.write(NEWEST, &whole[..whole.len() / 2]);
    attempt.write(BEFORE, b"");
    must_be_refused(&attempt.resume().end(), "both");
}

#[track_caller]
fn must_be_refused(ended: &Ended, what: &str) {
    assert_eq!(ended.code, Some(2), "{what}: {ended:?}");
    assert!(ended.errors().len() == 1 && ended.said.contains(NEWEST), "{what}: {ended:?}");
}

/// A checkpoint next to foreign tables, and tables that were changed.
pub fn foreign_tables(study: &Study, other: &Study) -> Outcome {
    let (one, two) = (Attempt::interrupted(study), Attempt::interrupted(other));
    let tables = |path: &Path| -> Vec<String> {
        let names = fs::read_dir(path).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.ends_with(".csv.part")).collect()
    };
    let names = tables(&one.out());
    assert!(!names.is_empty(), "{:?}", one.names());
    let mut cases = 0;
    for name in &names {
        for text in [None, Some(Vec::new()), fs::read(two.out().join(name)).ok()] {
            let attempt = one.fork();
            let path = attempt.out().join(name);
            let own = fs::read(&path).unwrap();
            match &text {
                Some(text) => fs::write(&path, text).unwrap(),
                None => fs::remove_file(&path).unwrap(),
            }
            let ended = attempt.resume().end();
            cases += 1;
            match ended.code {
                // Nothing of it was in use yet.
                Some(0) => attempt.must_be_the_reference(&[format!("{name}: {ended:?}")]),
                _ => {
                    assert!(ended.code == Some(2) && ended.errors().len() == 1, "{name}: {ended:?}");
                    let known_as = name.trim_start_matches('.').trim_end_matches(".part");
                    assert!(ended.said.contains(known_as), "{name} is not named: {ended:?}");
                    fs::write(&path, own).unwrap();
                    attempt.must_end_well(ended);
                }
            }
        }
    }
    Found::new(cases, "refused by name, or 0 differing bytes")
}
