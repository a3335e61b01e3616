//! The contents of a folder, byte for byte, and how two folders differ.

use std::{collections::BTreeMap, fs, path::Path};

/// Files by their path in the folder. Folders end in `/`.
pub type Content = BTreeMap<String, Vec<u8>>;

/// The contents of `folder`, without the clock times of its `run.json`.
pub fn content(folder: &Path) -> Content {
    let mut content = Content::new();
    collect(folder, "", &mut content);
    if let Some(text) = content.get_mut("run.json") {
        *text = without_clock_times(text);
    }
    content
}

fn collect(folder: &Path, prefix: &str, content: &mut Content) {
    for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.unwrap().path();
        let name = format!("{prefix}{}", path.file_name().unwrap().to_str().unwrap());
        if path.is_dir() && !path.is_symlink() {
            content.insert(format!("{name}/"), Vec::new());
            collect(&path, &format!("{name}/"), content);
        } else {
            content.insert(name, fs::read(&path).unwrap());
        }
    }
}

/// Removes the only two lines that may differ between equal runs.
fn without_clock_times(json: &[u8]) -> Vec<u8> {
    let is_time = |line: &[u8]| {
        [b"  \"started\": ".as_slice(), b"  \"wall_seconds\": "].iter().any(|begin| line.starts_with(begin))
    };
    json.split_inclusive(|byte| *byte == b'\n').filter(|line| !is_time(line)).flatten().copied().collect()
}

/// A line for every file that is missing, extra or different.
pub fn differences(expected: &Content, found: &Content) -> Vec<String> {
    let missing = expected.keys().filter(|name| !found.contains_key(*name)).map(|name| format!("{name} is missing"));
    let left = found.keys().filter(|name| !expected.contains_key(*name)).map(|name| format!("{name} is left over"));
    let other = expected.iter().filter_map(|(name, text)| {
        let now = found.get(name).filter(|now| *now != text)?;
        let place = text.iter().zip(now).take_while(|(a, b)| a == b).count();
        Some(format!("{name} differs from byte {place} on, of {} and {}", text.len(), now.len()))
    });
    missing.chain(left).chain(other).collect()
}

/// Copies `from` to `to`, which must not exist.
pub fn copy(from: &Path, to: &Path) {
    fs::create_dir(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        match path.is_dir() {
            true => copy(&path, &target),
            false => drop(fs::copy(&path, &target).unwrap()),
        }
    }
}
