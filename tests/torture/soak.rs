//! A long run takes no more than a short one: memory and open files, sampled while it runs.

use std::{fs, thread::sleep, time::Duration};

use tempfile::TempDir;

use crate::{
    Found, Outcome,
    program::{Running, curvelax},
};

/// Growth of the resident memory after the start-up that is still none: pages that the allocator had not touched.
const SLACK_KIB: u64 = 2048;

/// `curves` members make `steps` steps each.
pub fn constant(curves: u64, steps: u64, every: Duration) -> Outcome {
    let home = TempDir::new().unwrap();
    let arguments = format!(
        "run --backend cpu --quiet --curves {curves} --points 34 --solver direct --tau 1e-6 --t-end {} \
         --checkpoint-every 1s --out out",
        steps as f64 * 1e-6
    );
    let mut running = Running::start(&mut curvelax(home.path(), &arguments));
    let mut samples: Vec<(u64, usize)> = Vec::new();
    while !running.is_over() {
        samples.extend(sample(running.id()));
        sleep(every);
    }
    let took = running.age();
    let ended = running.end();
    assert_eq!((ended.code, &*ended.said), (Some(0), ""));
    let json: serde_json::Value = serde_json::from_slice(&fs::read(home.path().join("out/run.json")).unwrap()).unwrap();
    assert_eq!(json["steps"].as_u64(), Some(curves * steps), "{json}");
    // The first fifth is the start-up; the end draws the pictures.
    let steady = &samples[samples.len() / 5..samples.len() - samples.len() / 20 - 1];
    assert!(steady.len() >= 10, "{} samples", samples.len());
    let bounds = |values: Vec<u64>| (*values.iter().min().unwrap(), *values.iter().max().unwrap());
    let (least, most) = bounds(steady.iter().map(|sample| sample.0).collect());
    let (fewest_files, most_files) = bounds(steady.iter().map(|sample| sample.1 as u64).collect());
    let told = format!(
        "{:.0e} steps in {:.0} s: {least} to {most} KiB resident, {fewest_files} to {most_files} files open",
        (curves * steps) as f64,
        took.as_secs_f64()
    );
    eprintln!("{told}");
    assert!(most - least <= SLACK_KIB, "{told}");
    // A state that is being written is open for a moment.
    assert!(most_files - fewest_files <= 3, "{told}");
    Found::new(steady.len(), told)
}

/// Resident memory in KiB and the number of open files.
fn sample(process: u32) -> Option<(u64, usize)> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let files = fs::read_dir(format!("/proc/{process}/fd")).ok()?.count();
    Some((resident.trim().trim_end_matches(" kB").parse().ok()?, files))
}
