//! What `plot` reads back from a run's folder: each file, changed, beside the others as a run wrote them (`fuzz/base`).
//!
//! An input is the content of files, each with the letter of its place first and a NUL between them.

#![no_main]

use std::{
    cell::RefCell,
    fs::{self, File},
    io::{Seek, Write},
    path::PathBuf,
};

use curvelax::{
    files::{names, reader::Finished},
    report::pictures::FinishedRun,
    results::EnsembleStatistics,
};
use libfuzzer_sys::fuzz_target;

/// The letter of each file, its place and what it holds unless the input says something else.
const FILES: [(u8, &str, &[u8]); 8] = [
    (b'r', names::RUN, include_bytes!("../base/run.json")),
    (b's', names::SUMMARY, include_bytes!("../base/summary.csv")),
    (b'f', names::MEMBERS, include_bytes!("../base/members.csv")),
    (b'l', names::LEVELS, include_bytes!("../base/levels.csv")),
    // Read only if the run has events.
    (b'e', names::EVENTS, b""),
    (b'v', names::EVENT_LEVELS, b""),
    (b'm', names::MEAN_EXCESS, include_bytes!("../base/mean_excess.csv")),
    (b'p', names::PORTRAITS, include_bytes!("../base/portraits.json")),
];

/// Of this many runs that could be read one is drawn: that takes a thousand times as long.
const DRAWN: u32 = 256;

thread_local! {
    static FOLDER: RefCell<Folder> = RefCell::new(Folder::new());
}

fuzz_target!(|data: &[u8]| FOLDER.with_borrow_mut(|folder| {
    let mut content = FILES.map(|(.., usual)| usual);
    for part in data.split(|byte| *byte == 0) {
        if let Some((letter, rest)) = part.split_first()
            && let Some(place) = FILES.iter().position(|file| file.0 == *letter)
        {
            content[place] = rest;
        }
    }
    folder.hold(content);
    match Finished::read(&folder.path) {
        // Words of the run may say anything.
        Ok(run) if checksum(data).is_multiple_of(DRAWN) => draw(run, data.windows(3).any(|word| word == b"NaN")),
        Ok(_) => {}
        Err(error) => {
            let message = error.to_string();
            assert!(error.exit_code() == 2 && message.len() < 3000 && !message.contains('\n'), "{message}");
        }
    }
}));

/// Draws all pictures, or says why that cannot be; `told`: the run itself speaks of NaN.
fn draw(run: Finished, told: bool) {
    let Finished { provenance, mut tally, excess, explained, films } = run;
    let drawn = EnsembleStatistics::new(&provenance.spec, &mut tally).and_then(|statistics| {
        let (provenance, tally, statistics, explained) = (&provenance, &tally, &statistics, &explained);
        FinishedRun { provenance, tally, statistics, excess: &excess, explained, films: &films }.pictures()
    });
    if let Ok(pictures) = drawn {
        for (name, text) in pictures {
            assert!(told || !text.contains("NaN") && !text.contains("\"inf"), "{name}");
        }
    }
}

/// The same for the same input, and as good as any number for another (FNV-1a).
fn checksum(data: &[u8]) -> u32 {
    data.iter().fold(0x811c_9dc5, |sum, byte| (sum ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

/// A run's folder, of which only the files are written anew that change.
struct Folder {
    path: PathBuf,
    files: [(File, Vec<u8>); 8],
}

impl Folder {
    fn new() -> Folder {
        let path = std::env::temp_dir().join(format!("curvelax-fuzz-{}", std::process::id()));
        let files = FILES.map(|(_, name, _)| {
            let place = path.join(name);
            fs::create_dir_all(place.parent().unwrap()).unwrap();
            (File::create(place).unwrap(), Vec::new())
        });
        Folder { path, files }
    }

    fn hold(&mut self, content: [&[u8]; 8]) {
        for ((file, held), new) in self.files.iter_mut().zip(content) {
            if held != new {
                file.rewind().unwrap();
                file.write_all(new).unwrap();
                file.set_len(new.len() as u64).unwrap();
                *held = new.to_vec();
            }
        }
    }
}
