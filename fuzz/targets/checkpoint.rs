//! The state that `resume` continues from: as it is on disk, and, behind a byte `s`, with a right checksum round any
//! body.

#![no_main]

use std::{convert::Infallible, sync::LazyLock};

use curvelax::{
    ensemble::{Family, Member, Spec, request::spec::Precision},
    files::state::{
        checkpoint::{LAYOUT, from_bytes, to_bytes},
        envelope::sealed,
    },
    schedule::Outputs,
    trajectory::Trajectory,
};
use libfuzzer_sys::fuzz_target;

/// The spec of the seeds, and its first member.
static START: LazyLock<(Spec, Member)> = LazyLock::new(|| {
    let spec = Spec {
        points: 6,
        curves: 3,
        amplitude: 0.0.into(),
        tau: Some(0.05.into()),
        t_end: Some(0.3.into()),
        ..Spec::default()
    };
    let spec = spec.validate().expect("a right spec");
    let member = Family::new(&spec).and_then(|family| family.member(0)).expect("a member");
    (spec, member)
});

fuzz_target!(|data: &[u8]| {
    let body = data.strip_prefix(b"s").map(|body| {
        let write = |mut bytes: Vec<u8>| {
            bytes.extend(body);
            Ok::<_, Infallible>(bytes)
        };
        sealed(*LAYOUT, write).expect("no error can be made")
    });
    let Ok((head, progress)) = from_bytes(body.as_deref().unwrap_or(data)) else { return };
    // What is read is written and read back the same.
    let resident = progress.resident.clone().unwrap_or_default();
    let again = to_bytes(&head, &progress, &resident).expect("bytes");
    let (same, progress_again) = from_bytes(&again).expect("its own bytes");
    assert_eq!(format!("{head:?} {progress:?}"), format!("{same:?} {progress_again:?}"));
    let (spec, member) = &*START;
    let outputs = Outputs::default();
    for paused in resident.into_values() {
        let mut trajectory = Trajectory::new(member.clone(), spec, Precision::F64, &outputs);
        match trajectory.resume_from(paused) {
            Ok(()) => drop(trajectory.launch()),
            Err(error) => assert_eq!(error.exit_code(), 2),
        }
    }
});
