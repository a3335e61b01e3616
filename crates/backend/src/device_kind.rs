//! The kinds of devices that advance members.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What advances members.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviceKind {
    /// The cores of a machine.
    Cpu,
    /// A graphics processor, or software that acts as one.
    Gpu,
}

impl DeviceKind {
    /// Names used in flags and files.
    pub const NAMES: [&str; 2] = ["cpu", "gpu"];
}

impl fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(DeviceKind::NAMES[*self as usize])
    }
}
