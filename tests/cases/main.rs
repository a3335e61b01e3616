//! The tests whose cases are values: what there is to test depends on the adapters, drivers and compilers of the
//! machine, and what is missing is reported as ignored. `cargo test --release --test cases -- MODULE:` runs those of
//! one file.

mod browser;
#[path = "../common/mod.rs"]
mod common;
mod compilers;
mod conformance;
mod faults;
mod hostile;
mod legible;
mod places;
mod resume;
mod truth;

use std::{process::ExitCode, thread::available_parallelism};

use libtest_mimic::{Arguments, Trial};

/// Whether to run all cases, as `tests/run --all` does, or those of a quarter of an hour.
fn everything() -> bool {
    std::env::var("CURVELAX_TESTS").is_ok_and(|value| value == "all")
}

/// Whether tests that need a GPU are ignored where there is none. Otherwise they fail.
fn may_lack_gpu() -> bool {
    std::env::var("ALLOW_NO_GPU").is_ok_and(|value| value == "1")
}

fn main() -> ExitCode {
    let mut arguments = Arguments::from_args();
    // Many trials wait: for a program, a compiler, or the two minutes after which a GPU is given up. These are first,
    // those with compilers of one thread before all, since others then run beside them.
    arguments.test_threads.get_or_insert(2 + available_parallelism().map_or(1, usize::from));
    type Trials = fn() -> Vec<Trial>;
    let modules: [(&str, Trials); 9] = [
        ("compilers", compilers::trials),
        ("hostile", hostile::trials),
        ("conformance", conformance::trials),
        ("faults", faults::trials),
        ("resume", resume::trials),
        ("places", places::trials),
        ("truth", truth::trials),
        ("browser", browser::trials),
        ("legible", legible::trials),
    ];
    let kinds = modules.into_iter().flat_map(|(kind, trials)| trials().into_iter().map(move |t| t.with_kind(kind)));
    let conclusion = libtest_mimic::run(&arguments, kinds.collect());
    conformance::record();
    conclusion.exit_code()
}
