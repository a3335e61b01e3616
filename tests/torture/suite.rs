//! The tests at their two scales, and the table of their results.

use std::{
    env,
    process::ExitCode,
    sync::{Arc, Mutex},
    time::Instant,
};

use libtest_mimic::{Arguments, Failed, Trial};
use tempfile::TempDir;

use crate::{
    attacks,
    calls::{self, From},
    controls, differential, hostile, kills, order, program, races, signals, sizes, soak, space, state,
    study::Study,
    surroundings, threads,
};

/// The cases of a test, and its observations.
pub struct Found {
    cases: usize,
    result: String,
}

pub type Outcome = Result<Found, Failed>;

impl Found {
    pub fn new(cases: usize, result: impl Into<String>) -> Outcome {
        Ok(Found { cases, result: result.into() })
    }
}

// One thread each, so that two tests use two cores.

/// Adaptive steps with both tables, about two seconds.
static ADAPTIVE: Study = Study::new(
    "adaptive, csv",
    "--backend cpu --threads 1 --points 40 --curves 1200 --adaptive=2e-6 --stop-when-relaxed --series 0.1 --snapshots 0,0.1",
);
/// The same for some seven seconds, so that it is not done before a stop is noticed, however busy the machine is.
static LONG: Study = Study::new(
    "adaptive, csv, long",
    "--backend cpu --threads 1 --points 40 --curves 4000 --adaptive=2e-6 --stop-when-relaxed --series 0.1 --snapshots 0,0.1",
);
/// Fixed steps by sweeps, with arrays.
static FIXED: Study = Study::new(
    "fixed, zarr",
    "--backend cpu --threads 1 --points 34 --curves 150 --tau 5e-5 --t-end 1 --series 0.2 --snapshots 0,0.5,1 --store zarr",
);
/// Two numbers of nodes give two cohorts, and each three levels; adaptive and fixed steps would be two runs.
static COHORTS: Study = Study::new(
    "two cohorts",
    "--backend cpu --threads 1 --curves 250 --adaptive=2e-6 --stop-when-relaxed --series 0.2 --snapshots 0.1 \
     --modes 2..=4 --sweep points=34,52 --refine",
);
/// On the software GPU.
static GPU: Study = Study::new(
    "lavapipe, adaptive",
    "--backend gpu --points 34 --curves 60 --adaptive=1e-5 --stop-when-relaxed --series 0.1 --snapshots 0,0.1",
);
static GPU_ZARR: Study = Study::new(
    "lavapipe, fixed, zarr, two cohorts",
    "--backend gpu --curves 60 --tau 1e-3 --t-end 0.5 --solver direct --snapshots 0,0.1 --series 0.1 --sweep points=34,52",
);
/// So short that it can be repeated for every system call.
static SHORT: Study = Study::new(
    "short, csv",
    "--backend cpu --threads 1 --curves 5 --adaptive=1e-3 --stop-when-relaxed --series 0.2 --snapshots 0.1 \
     --sweep points=34,52",
);
static SHORT_ZARR: Study = Study::new(
    "short, zarr",
    "--backend cpu --threads 1 --curves 5 --points 34 --adaptive=1e-3 --stop-when-relaxed --snapshots 0,0.1 --store zarr",
);
/// Another seed, for files that must not be mixed up.
static OTHER: Study = Study::new(
    "short, another seed",
    "--backend cpu --threads 1 --curves 7 --seed 5 --adaptive=1e-3 --stop-when-relaxed --points 34 --series 0.1 --store zarr \
     --snapshots 0.2",
);
/// Few members, and long enough to be interrupted in the middle.
static TINY: Study = Study::new(
    "tiny",
    "--backend cpu --threads 1 --curves 2 --points 34 --tau 4e-6 --t-end 0.2 --solver direct --series 0.05",
);
/// Long enough for a second checkpoint in the middle.
static SECOND: Study = Study::new(
    "more than a second, zarr",
    "--backend cpu --threads 1 --points 34 --curves 110 --tau 5e-5 --t-end 1 --series 0.5 --snapshots 0,0.5 --store zarr",
);

const STOPS: [(&str, i32, i32); 3] = [("INT", 2, 130), ("TERM", 15, 75), ("HUP", 1, 75)];

type Rows = Arc<Mutex<Vec<(String, &'static str, Option<String>)>>>;

/// The tests requested.
struct Suite {
    full: bool,
    rows: Rows,
    trials: Vec<Trial>,
}

impl Suite {
    /// The number for this scale.
    fn of<T>(&self, small: T, full: T) -> T {
        if self.full { full } else { small }
    }

    fn test(&mut self, name: &'static str, bound: &'static str, test: impl FnOnce() -> Outcome + Send + 'static) {
        self.test_if(None, name, bound, test);
    }

    /// A test that is reported as ignored if something is missing.
    fn test_if(
        &mut self,
        missing: Option<&str>,
        name: &'static str,
        bound: &'static str,
        test: impl FnOnce() -> Outcome + Send + 'static,
    ) {
        if let Some(missing) = missing {
            eprintln!("{name}: ignored, there is no {missing}");
        }
        let rows = Arc::clone(&self.rows);
        let place = {
            let mut rows = rows.lock().unwrap();
            rows.push((name.into(), bound, missing.map(|missing| format!("- | ignored: no {missing}"))));
            rows.len() - 1
        };
        let trial = Trial::test(name, move || {
            let since = Instant::now();
            rows.lock().unwrap()[place].2 = Some("? | FAILED".into());
            let found = test()?;
            let took = since.elapsed().as_secs_f64();
            rows.lock().unwrap()[place].2 = Some(format!("{} | {} ({took:.0} s)", found.cases, found.result));
            Ok(())
        });
        self.trials.push(trial.with_ignored_flag(missing.is_some()));
    }
}

/// Runs the suite and prints its table.
pub fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let full = env::var("TORTURE").is_ok_and(|scale| scale == "full");
    let seed = env::var("TORTURE_SEED").ok().map_or(1, |seed| seed.parse().expect("TORTURE_SEED is a whole number"));
    println!("torture: {} scale, TORTURE_SEED={seed}", if full { "full" } else { "small" });
    let rows = Rows::default();
    let mut suite = Suite { full, rows: Arc::clone(&rows), trials: Vec::new() };
    interruptions(&mut suite, seed);
    calls_of_the_system(&mut suite, seed);
    folders_and_states(&mut suite, seed);
    attacks_on_files(&mut suite, seed);
    the_rest(&mut suite, seed);
    let conclusion = libtest_mimic::run(&arguments, suite.trials);
    println!("| test | bound | cases | result |\n|---|---|---|---|");
    for (name, bound, found) in rows.lock().unwrap().iter() {
        if let Some(found) = found {
            println!("| {} | {bound} | {found} |", name.replace('_', " "));
        }
    }
    conclusion.exit_code()
}

/// What a GPU run is missing, if anything.
fn no_gpu() -> Option<&'static str> {
    let home = TempDir::new().unwrap();
    let output = program::curvelax(home.path(), "adapters --json").output().unwrap();
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
    json["adapters"].as_array().is_none_or(Vec::is_empty).then_some("GPU adapter")
}

fn interruptions(suite: &mut Suite, seed: u64) {
    const SAME: &str = "0 differing bytes";
    let gpu = no_gpu();
    suite.test("the_comparison_finds_what_differs", "all seen", || controls::differences_are_seen(&SHORT));
    for (name, study, small, full) in [
        ("killed_at_random_times_with_adaptive_steps", &ADAPTIVE, 12, 120),
        ("killed_at_random_times_with_fixed_steps_and_arrays", &FIXED, 12, 120),
        ("killed_at_random_times_with_two_cohorts", &COHORTS, 10, 110),
    ] {
        let kills = suite.of(small, full);
        suite.test(name, SAME, move || kills::at_random_times(study, None, kills, seed));
    }
    for (name, study, small, full) in [
        ("killed_at_random_times_on_the_gpu", &GPU, 8, 80),
        ("killed_at_random_times_on_the_gpu_with_two_cohorts", &GPU_ZARR, 8, 80),
    ] {
        let kills = suite.of(small, full);
        suite.test_if(gpu, name, SAME, move || kills::at_random_times(study, None, kills, seed));
    }
    let kills = suite.of(10, 100);
    suite.test("killed_over_the_files_of_an_earlier_run", "one of the two runs, whole", move || {
        kills::at_random_times(&SHORT, Some(&OTHER), kills, seed)
    });
    const STOPPED: &str = "0 differing bytes, out after 5 s of work";
    let cases = suite.of(8, 80);
    suite.test("stopped_by_signals_at_random_times", STOPPED, move || {
        signals::stop_at_random_times(&[&ADAPTIVE, &FIXED, &COHORTS], &STOPS, cases, seed)
    });
    let cases = suite.of(3, 30);
    suite.test_if(gpu, "stopped_by_signals_on_the_gpu", STOPPED, move || {
        signals::stop_at_random_times(&[&GPU, &GPU_ZARR], &STOPS, cases, seed)
    });
    let cases = suite.of(2, 20);
    suite.test("a_second_signal_does_not_wait", "0 differing bytes, out after 2 s of work", move || {
        signals::stop_twice(&SECOND, cases, seed)
    });
    let all: Vec<&'static Study> = suite.of(vec![&FIXED], vec![&FIXED, &ADAPTIVE, &COHORTS]);
    suite.test("a_second_at_a_time", SAME, move || signals::a_second_at_a_time(&all));
}

fn calls_of_the_system(suite: &mut Suite, seed: u64) {
    const SAME: &str = "0 differing bytes";
    let strace = (!calls::can_trace()).then_some("strace that works");
    let strides = [suite.of(7, 1), suite.of(17, 1)];
    for (name, study, from, stride) in [
        ("killed_at_every_call_that_writes", &SHORT, From::Start, strides[0]),
        ("killed_at_every_call_that_writes_arrays", &SHORT_ZARR, From::Start, strides[0]),
        ("killed_at_every_call_over_an_earlier_run", &SHORT, From::Over(&OTHER), strides[0]),
        ("killed_at_every_call_of_a_resumed_run", &SHORT, From::Middle, strides[0]),
        ("killed_at_every_call_of_a_resumed_run_with_arrays", &SHORT_ZARR, From::Middle, strides[0]),
        ("killed_at_every_call_of_a_run_with_many_states", &SECOND, From::Start, strides[1]),
    ] {
        suite.test_if(strace, name, SAME, move || calls::kill_at_every_call(study, from, stride, seed));
    }
    let (all, strides) = (suite.full, [suite.of(7, 1), suite.of(13, 1)]);
    for (name, study, from, stride) in [
        ("every_call_fails_once_or_always", &SHORT, From::Start, strides[0]),
        ("every_call_fails_with_arrays", &SHORT_ZARR, From::Start, strides[1]),
        ("every_call_of_a_resumed_run_fails", &SHORT, From::Middle, strides[1]),
    ] {
        suite.test_if(strace, name, "exit 0, 1 or 2, one line, resumed 0 differing bytes", move || {
            calls::fail_at_every_call(study, from, stride, all, seed)
        });
    }
}

fn folders_and_states(suite: &mut Suite, seed: u64) {
    let mount = (!space::can_mount()).then_some("right to mount");
    const KEPT: &str = "one line, resumed 0 differing bytes";
    let sizes: &[usize] = suite.of(&[64, 256], &[4, 16, 32, 64, 96, 128, 160, 192, 224, 256, 288, 320, 384, 512]);
    suite.test_if(mount, "a_disk_that_is_too_small", KEPT, || space::small_disks(&SHORT, sizes));
    let limits: &[usize] =
        suite.of(&[0, 2, 16, 100], &[0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 160, 192]);
    suite.test("files_that_may_not_grow", KEPT, || space::limited_files(&SHORT, limits));
    let races = suite.of(50, 50);
    suite.test("double_starts_in_one_folder", "exactly one proceeds", move || races::double_starts(&TINY, races));
    let (stride, cut) = suite.of((1009, 251), (1, 1));
    suite.test("a_state_with_a_flipped_bit_or_cut_off", "refused, or the state before", move || {
        state::damaged(&TINY, stride, cut, seed)
    });
    suite.test("tables_that_do_not_belong_to_the_state", "refused by name, or 0 differing bytes", || {
        state::foreign_tables(&TINY, &SHORT)
    });
}

fn attacks_on_files(suite: &mut Suite, seed: u64) {
    let strace = (!calls::can_trace()).then_some("strace that works");
    let stride = suite.of(23, 1);
    suite.test_if(strace, "folders_taken_away_at_every_call", "the other run is not touched", move || {
        attacks::taken_away(&SHORT, &OTHER, stride, seed)
    });
    suite.test_if(strace, "a_lock_that_is_removed", "exactly one proceeds", || attacks::lock_removed(&SHORT));
    suite.test("copies_that_share_their_files", "0 differing bytes", || attacks::linked_copies(&[&TINY, &SHORT_ZARR]));
    suite.test("folders_of_other_commands", "refused", || attacks::foreign_folders(&SHORT));
    suite.test("folders_without_a_run", "nothing is lost", || attacks::folders_without_a_run(&SHORT));
    suite.test_if(strace, "outlines_that_change", "read once", attacks::outlines);
    suite.test("pipes_devices_and_endless_files", "named, in 1 GB", || {
        hostile::in_the_place_of_files(&SHORT, &SHORT_ZARR)
    });
    suite.test("things_in_the_way", "named, nothing left over", || hostile::in_the_way(&TINY, &SECOND));
    let lengths: Vec<usize> = suite.of(
        [2000].into_iter().chain((3980..4100).step_by(20)).collect(),
        [2000].into_iter().chain(3960..4100).collect(),
    );
    suite.test("paths_of_any_length", "done, or refused with nothing left over", move || {
        attacks::long_paths(&SHORT, &lengths)
    });
}

fn the_rest(suite: &mut Suite, seed: u64) {
    const SAME: &str = "0 differing bytes";
    let mount = (!space::can_mount()).then_some("right to mount");
    let gpu = no_gpu();
    let unprivileged = surroundings::Unprivileged::is_missing();
    suite.test_if(unprivileged, "folders_that_cannot_be_written", "refused by name", || {
        surroundings::folders_that_cannot_be_written(&SHORT)
    });
    suite.test_if(mount, "a_disk_that_is_read_only", "refused by name", || surroundings::read_only_disk(&TINY));
    let strace = (!calls::can_trace()).then_some("strace that works");
    suite.test_if(strace, "a_file_system_without_locks", SAME, || surroundings::no_locks(&SHORT));
    const NAMED: &str = "refused by name, or 0 differing bytes";
    suite.test_if(strace, "few_threads", NAMED, || threads::few(&SHORT_ZARR));
    let most = suite.of(4, 12);
    suite.test_if(strace.or(gpu), "few_threads_on_the_gpu", NAMED, move || threads::few_on_the_gpu(&GPU, most));
    let limit = (!threads::can_limit()).then_some("prlimit");
    suite.test_if(limit.or(unprivileged), "no_threads_left_for_signals", "stopped, 0 differing bytes", || {
        threads::none_left_for_signals(&LONG, &STOPS)
    });
    suite.test_if(unprivileged, "no_rights_for_new_files", "refused by name", || {
        surroundings::no_rights_for_new_files(&SHORT)
    });
    let cases = suite.of(3, 50);
    suite.test("a_folder_that_vanishes", "a named error, no panic", move || {
        surroundings::vanished_folder(&SECOND, cases, seed)
    });
    suite.test("no_reader_of_the_output", SAME, || surroundings::no_reader_of_the_output(&SHORT));
    suite.test("locales", SAME, || surroundings::locales(&SHORT));
    let faketime = (!surroundings::has_faketime()).then_some("faketime that works");
    suite.test_if(faketime, "wrong_clocks", SAME, || surroundings::wrong_clocks(&SHORT));
    suite.test("threads", SAME, || order::threads(&SHORT));
    let studies = suite.of(12, 2000);
    suite.test("random_studies", SAME, move || differential::studies("cpu", studies, seed));
    let studies = suite.of(3, 400);
    suite.test_if(gpu, "random_studies_on_the_gpu", SAME, move || differential::studies("gpu", studies, seed));
    suite.test("subsets", SAME, || order::subsets(&SHORT, &["0", "9", "1,2,3,7", "0,1,2,3,4,5,6,7,8,9"]));
    let times = suite.of(2, 20);
    suite.test_if(gpu, "repeats_on_the_gpu", SAME, move || order::repeats(&GPU_ZARR, times));
    let sizes: &[usize] = suite.of(&[6, 7, 11, 64, 1000], &[6, 7, 11, 64, 1000, 100_000, 1_000_000]);
    suite.test("rings_of_any_size", "done, or refused by name", || sizes::rings(sizes));
    suite.test("ensembles_of_any_size", "done, or refused by name", sizes::members);
    let (samples, steps) = (140, suite.of(100, 5000));
    suite.test("memory_and_open_files_stay", "4 MiB, 3 files", move || soak::constant(samples, steps));
}
