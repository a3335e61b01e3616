//! The files of `shaders/`, compiled into the program.

/// A file: its name in `shaders/` and its text.
pub type ShaderPart = (&'static str, &'static str);

/// The named files of `shaders/`, as an array of [`ShaderPart`]s.
macro_rules! parts {
    ($($file:literal),+ $(,)?) => {
        [$(($file, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $file)))),+]
    };
}

pub(crate) use parts;
