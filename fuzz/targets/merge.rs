//! What `merge` reads: `shard.state` with a right checksum round any body (behind a byte `s`), and the tables of two
//! shards (behind `t`, with a NUL between them), as they are or each with the length and the checksum that its shard
//! tells of (behind `c`).

#![no_main]

use std::{
    cell::RefCell,
    convert::Infallible,
    fs::{self, File},
    io::{Seek, Write},
    path::{Path, PathBuf},
    time::Duration,
};

use curvelax::{
    backend::DeviceKind,
    ensemble::{Shard, Spec, request::spec::Precision},
    files::{
        names,
        part_file::Mark,
        state::{
            checkpoint::{CheckpointHead, Origin},
            envelope::sealed,
            shard::{FinishedShard, Found, LAYOUT, Record, from_bytes, look, to_bytes},
        },
    },
    placement::Platform,
    report::merge::{Shards, join_rows},
    results::tally::TallySupplement,
};
use libfuzzer_sys::fuzz_target;

/// The tables of a shard.
const TABLES: [&str; 4] = [names::SUMMARY, names::MEMBERS, names::LEVELS, names::RATES];

thread_local! {
    static SHARDS: RefCell<[Folder; 2]> = RefCell::new([0, 1].map(Folder::new));
}

fuzz_target!(|data: &[u8]| {
    let Some((kind, rest)) = data.split_first() else { return };
    match kind {
        b's' => state(rest),
        b't' | b'c' => SHARDS.with_borrow_mut(|shards| tables(shards, rest, *kind == b'c')),
        _ => {}
    }
});

/// What is read is written and read back the same.
fn state(body: &[u8]) {
    let write = |mut bytes: Vec<u8>| {
        bytes.extend(body);
        Ok::<_, Infallible>(bytes)
    };
    let Ok(record) = from_bytes(&sealed(*LAYOUT, write).expect("no error can be made")) else { return };
    let again = to_bytes(&record.head, record.points, &record.warnings).expect("bytes");
    assert_eq!(format!("{record:?}"), format!("{:?}", from_bytes(&again).expect("its own bytes")));
    SHARDS.with_borrow_mut(|shards| {
        let [one, other] = shards;
        one.hold(names::SHARD, &again);
        // Beside a right one, which it may be of the same study with.
        let found = [&*one, other].into_iter().map(|shard| look(&shard.path)).collect::<Result<Vec<_>, _>>();
        one_line(found.and_then(Shards::new).map(|shards| shards.in_words()));
        let record = one.record.clone();
        one.hold(names::SHARD, &to_bytes(&record.head, record.points, &record.warnings).expect("bytes"));
    });
}

/// Rows come out in the order of the members, each as it was, or the answer is one line.
fn tables(shards: &mut [Folder; 2], text: &[u8], told: bool) {
    let end = text.iter().position(|byte| *byte == 0).unwrap_or(text.len());
    let texts = [&text[..end], text.get(end + 1..).unwrap_or_default()];
    let parts = [0, 1].map(|i| shards[i].part(texts[i], told));
    let mut joined = Vec::new();
    if one_line(join_rows(&parts, names::SUMMARY, &mut joined, Path::new("joined"))).is_some() {
        let lines = |text: &[u8]| text.split_inclusive(|byte| *byte == b'\n').skip(1).map(<[u8]>::to_vec).collect();
        let member = |line: &Vec<u8>| line.split(|byte| *byte == b',').next().map(<[u8]>::to_vec);
        let number = |line: &Vec<u8>| String::from_utf8(member(line)?).ok()?.parse::<u64>().ok();
        let mut expected: Vec<Vec<u8>> = texts.iter().flat_map(|text| -> Vec<Vec<u8>> { lines(text) }).collect();
        let found: Vec<Vec<u8>> = lines(&joined);
        assert!(found.iter().map(number).is_sorted());
        expected.sort_by_key(number);
        assert_eq!(found, expected);
    }
}

fn one_line<T>(done: curvelax::Result<T>) -> Option<T> {
    done.inspect_err(|error| {
        let message = error.to_string();
        assert!(error.exit_code() == 2 && message.len() < 5000 && !message.contains('\n'), "{message}");
    })
    .ok()
}

/// A shard's folder, in which files are written anew in their place.
struct Folder {
    path: PathBuf,
    record: Record,
    shard: Shard,
    spec: Spec,
    files: Vec<(&'static str, File)>,
}

impl Folder {
    fn new(index: u64) -> Folder {
        let path = std::env::temp_dir().join(format!("curvelax-fuzz-{}-{index}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        let shard = Shard::new(index, 2).unwrap();
        let spec = Spec { curves: 8, shard: Some(shard), ..Spec::default() }.validate().unwrap();
        let platform = Platform {
            backend: DeviceKind::Cpu,
            adapter: None,
            driver: None,
            device_type: None,
            precision: Precision::F64,
            reason: "asked for".into(),
            threads: Some(2),
        };
        let origin = Origin {
            spec: spec.to_toml().unwrap(),
            platform,
            moves: Vec::new(),
            base: String::new(),
            outlines: Vec::new(),
            started: Duration::ZERO,
        };
        let tables = TABLES.map(|name| Mark { name: name.into(), length: 0, crc: 0 }).into();
        let (wall, supplement) = (Duration::ZERO, TallySupplement::default());
        let head =
            CheckpointHead { origin, wall, stage: 0, tables, store: None, rows: None, supplement, films: Vec::new() };
        let files = [names::SHARD].into_iter().chain(TABLES);
        let files = files.map(|name| (name, File::create(path.join(name)).unwrap())).collect();
        let record = Record { head, points: 100, warnings: Vec::new() };
        let mut folder = Folder { path, record, shard, spec, files };
        let state = to_bytes(&folder.record.head, 100, &[]).unwrap();
        folder.hold(names::SHARD, &state);
        assert!(matches!(look(&folder.path), Ok(Found::Done(_))), "a right shard is not taken");
        folder
    }

    fn hold(&mut self, name: &str, content: &[u8]) {
        let (_, file) = self.files.iter_mut().find(|file| file.0 == name).unwrap();
        file.rewind().unwrap();
        file.write_all(content).unwrap();
        file.set_len(content.len() as u64).unwrap();
    }

    /// The shard with this table, of whose length and checksum it tells, or of others.
    fn part(&mut self, table: &[u8], told: bool) -> FinishedShard {
        self.hold(names::SUMMARY, table);
        let (path, shard, spec) = (self.path.clone(), self.shard, self.spec.clone());
        let mut record = self.record.clone();
        let crc = crc32c::crc32c(table) ^ u32::from(!told);
        record.head.tables = vec![Mark { name: names::SUMMARY.into(), length: table.len() as u64, crc }];
        FinishedShard { path, shard, spec, record }
    }
}
