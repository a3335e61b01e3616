//! A long run needs no more than a short one: memory and open files, sampled while it runs.
//!
//! The run would last for months and is stopped after enough samples, one each time its table has grown: samples are
//! equally far apart in work, however fast it is done. They begin when it has saved its state twice, and so has done
//! all that it will do again.

use std::fs;

use tempfile::TempDir;

use crate::{
    Found, Outcome,
    program::{Running, curvelax, status},
};

/// Permitted growth of the memory: what the allocator has not used yet, or not returned, among it that of a checkpoint,
/// which holds a state of 38 numbers a node for each resident member.
const SLACK_KIB: u64 = 4096;

/// Collects `samples` of a run whose members make `steps` steps each.
pub fn constant(samples: usize, steps: u64) -> Outcome {
    let home = TempDir::new().unwrap();
    let arguments = format!(
        "run --backend cpu --threads 2 --quiet --curves 100000000 --points 34 --solver direct --tau 1e-6 --t-end {} \
         --checkpoint-every 1s --out out",
        steps as f64 * 1e-6
    );
    let mut running = Running::start(&mut curvelax(home.path(), &arguments));
    let table = home.path().join("out/.summary.csv.part");
    let second_state = home.path().join("out/.curvelax.state.old");
    let (mut steady, mut length) = (Vec::new(), 0);
    running.wait_until(|running| {
        let now = fs::metadata(&table).map_or(0, |table| table.len());
        if now > length {
            length = now;
            steady.extend(sample(running.id()).filter(|_| second_state.exists()));
        }
        steady.len() >= samples
    });
    running.signal("TERM");
    let took = running.age();
    let ended = running.end();
    assert!(ended.code == Some(75) && ended.errors().len() == 1, "{ended:?}");
    let rows = fs::read_to_string(&table).unwrap().lines().count() as u64 - 1;
    let bounds = |values: Vec<u64>| (*values.iter().min().unwrap(), *values.iter().max().unwrap());
    // What a checkpoint needs for a moment is no growth: the least of the first quarter is compared with that of the
    // last.
    let memory: Vec<u64> = steady.iter().map(|sample| sample.0).collect();
    let least = |samples: &[u64]| *samples.iter().min().unwrap();
    let [before, after] = [&memory[..memory.len() / 4], &memory[memory.len() * 3 / 4..]].map(least);
    let most = *memory.iter().max().unwrap();
    let (fewest_files, most_files) = bounds(steady.iter().map(|sample| sample.1).collect());
    let told = format!(
        "{:.0e} steps in {:.0} s: from {before} to {after} KiB of memory, {most} for a moment, {fewest_files} to {most_files} files open",
        (rows * steps) as f64,
        took.as_secs_f64()
    );
    eprintln!("{told}");
    assert!(after.saturating_sub(before) <= SLACK_KIB, "{told}");
    // A checkpoint that is being written is open for a moment.
    assert!(most_files - fewest_files <= 3, "{told}");
    Found::new(steady.len(), told)
}

/// Writable memory in KiB, and the number of open files. How much of that memory is resident depends on the size of the
/// system's pages and on other work of the machine.
fn sample(process: u32) -> Option<(u64, u64)> {
    let kib = |name| status(process, name)?.trim_end_matches(" kB").parse::<u64>().ok();
    let files = fs::read_dir(format!("/proc/{process}/fd")).ok()?.count();
    Some((kib("VmData:")?, files as u64))
}
