//! The WGSL of the kernels, compiled in. `README.md` describes the files.
//!
//! A kernel is a list of these files, one after the other; which ones, the back end decides.

/// A file: its name and its text.
pub type ShaderPart = (&'static str, &'static str);

macro_rules! files {
    ($($constant:ident $name:literal,)+) => {
        $(
            #[doc = concat!("`", $name, "`")]
            pub const $constant: ShaderPart = ($name, include_str!($name));
        )+
        /// All files.
        pub const ALL: &[ShaderPart] = &[$($constant),+];
    };
}

files! {
    CURVATURE "curvature.wgsl",
    DECAY "decay.wgsl",
    DENSE "dense.wgsl",
    DIRECT "direct.wgsl",
    EVOLVE "evolve.wgsl",
    EXCESS "excess.wgsl",
    EXCHANGE "exchange.wgsl",
    EXCHANGE_SUBGROUP "exchange_subgroup.wgsl",
    EXTRAPOLATION "extrapolation.wgsl",
    FORCES "forces.wgsl",
    FORCING "forcing.wgsl",
    GAUSS_SEIDEL "gauss_seidel.wgsl",
    MEMBER "member.wgsl",
    NUMBER "number.wgsl",
    OBSERVE "observe.wgsl",
    PACE "pace.wgsl",
    PLACE "place.wgsl",
    PLACE_FIXED "place_fixed.wgsl",
    POSITION "position.wgsl",
    PULL "pull.wgsl",
    REDISTRIBUTION "redistribution.wgsl",
    RING "ring.wgsl",
    START "start.wgsl",
    STATE "state.wgsl",
    STEP "step.wgsl",
    SUMS "sums.wgsl",
    SWEEPS "sweeps.wgsl",
    SYSTEM "system.wgsl",
    TRACE_OFF "trace_off.wgsl",
    TRACE_ON "trace_on.wgsl",
}
