//! The device that advances members.

use std::fmt;
#[cfg(feature = "program")]
use std::sync::Arc;

use serde::{Deserialize, Serialize};

#[cfg(feature = "program")]
use super::gpu::Gpu;

/// A device that advances members, not yet opened.
#[cfg(feature = "program")]
pub enum Device {
    /// The cores of this machine.
    Cpu,
    /// This adapter.
    Gpu(Arc<Gpu>),
}

/// The kinds of [`Device`].
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

#[cfg(feature = "program")]
impl Device {
    /// Returns the kind of this device.
    pub fn kind(&self) -> DeviceKind {
        match self {
            Device::Cpu => DeviceKind::Cpu,
            Device::Gpu(_) => DeviceKind::Gpu,
        }
    }

    /// Returns the adapter, if this is one.
    pub fn gpu(&self) -> Option<&Gpu> {
        match self {
            Device::Cpu => None,
            Device::Gpu(gpu) => Some(gpu),
        }
    }
}

#[cfg(feature = "program")]
impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Device::Cpu => f.write_str("CPU"),
            Device::Gpu(gpu) => write!(f, "GPU {} ({})", gpu.name(), gpu.api()),
        }
    }
}
