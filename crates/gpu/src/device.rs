//! The device that advances members.

use std::fmt;
use std::sync::Arc;

use curvelax_backend::DeviceKind;

use crate::Gpu;

/// A device that advances members, not yet opened.
#[derive(Clone)]
pub enum Device {
    /// The cores of this machine.
    Cpu,
    /// This adapter.
    Gpu(Arc<Gpu>),
}

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

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Device::Cpu => f.write_str("CPU"),
            Device::Gpu(gpu) => write!(f, "GPU {} ({})", gpu.name(), gpu.api()),
        }
    }
}
