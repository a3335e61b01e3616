//! Samples of results, for the tests of this crate and of those above it.

use curvelax_backend::DeviceKind;
use curvelax_ensemble::{Outcome, Status};
use curvelax_flow::number::Precision;

use crate::placement::Platform;

/// A member that ended at t = 2 after 10 steps.
pub fn outcome(member: u64, status: Status, t_relax: Option<f64>) -> Outcome {
    Outcome {
        member,
        status,
        t_end: 2.0,
        steps: 10,
        solves: 10,
        sweeps_k: 20,
        sweeps_x: 5,
        t_relax,
        ..Outcome::default()
    }
}

/// A CPU with two threads.
pub fn platform() -> Platform {
    Platform {
        backend: DeviceKind::Cpu,
        adapter: None,
        driver: None,
        device_type: None,
        precision: Precision::F64,
        reason: "no hardware GPU".into(),
        threads: Some(2),
    }
}
