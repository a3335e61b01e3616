//! Device nodes: whether a hardware GPU may be present, as far as can be seen without its driver.

/// Whether this program can load GPU drivers. A static one for Linux cannot: its C library has no dynamic loader.
pub const LOADS_DRIVERS: bool = !cfg!(all(target_os = "linux", target_feature = "crt-static"));

/// Returns whether this machine may have a hardware GPU. On Linux, none is reachable without a node in `/dev`, except
/// through a Vulkan driver that the user adds.
pub fn may_have_hardware() -> bool {
    #[cfg(target_os = "linux")]
    return linux::has_nodes("/dev".as_ref()) || std::env::var_os("VK_ADD_DRIVER_FILES").is_some();
    #[cfg(not(target_os = "linux"))]
    true
}

#[cfg(target_os = "linux")]
mod linux {
    use std::{fs, path::Path};

    /// Prefixes of the names that GPU drivers use: NVIDIA (also on Tegra), AMD, Windows for its Linux, and Mali,
    /// Adreno, PowerVR and Vivante.
    const VENDORS: [&str; 9] = ["nvidia", "nvhost", "nvgpu", "kfd", "dxg", "mali", "kgsl", "pvr", "galcore"];
    /// Prefixes of compute nodes in `dri`. A `card` alone only displays.
    const RENDER: [&str; 1] = ["renderD"];

    pub fn has_nodes(dev: &Path) -> bool {
        has(dev, &VENDORS) || has(&dev.join("dri"), &RENDER)
    }

    /// Whether a name in `folder` has one of these prefixes.
    fn has(folder: &Path, begins: &[&str]) -> bool {
        let Ok(entries) = fs::read_dir(folder) else { return false };
        let names = entries.flatten().map(|entry| entry.file_name());
        names.into_iter().any(|name| begins.iter().any(|begin| name.as_encoded_bytes().starts_with(begin.as_bytes())))
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn hardware_is_looked_for_where_a_node_of_a_driver_is() {
            let dev = tempfile::tempdir().unwrap();
            for name in ["null", "tty0", "dri/card0", "nvram", "nvme0"] {
                make(dev.path(), name);
                assert!(!has_nodes(dev.path()), "{name}");
            }
            assert!(!has_nodes(&dev.path().join("nowhere")));
            for name in ["dri/renderD128", "nvidia0", "nvidiactl", "kfd", "dxg", "mali0", "kgsl-3d0", "nvhost-gpu"] {
                let dev = tempfile::tempdir().unwrap();
                make(dev.path(), name);
                assert!(has_nodes(dev.path()), "{name}");
            }
        }

        fn make(dev: &Path, name: &str) {
            let path = dev.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
    }
}
