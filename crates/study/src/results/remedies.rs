//! What helps members that failed, drifted or did not relax in time, by how they ran.

use curvelax_ensemble::{
    Spec,
    request::{
        drawn::Drawn,
        spec::{OrAuto, Pace, Precision},
    },
};
use curvelax_flow::forcing::Drive;

/// How members ran, as far as remedies depend on it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Remedies {
    geometric: bool,
    pub(super) adaptive: bool,
    pulled: bool,
    driven: bool,
    vesicles: bool,
    stops: bool,
    short: bool,
    /// A member is relaxed at a share of its initial excess.
    pub(super) relative: bool,
}

impl Remedies {
    /// Those of a run of `spec`.
    pub(super) fn of(spec: &Spec) -> Remedies {
        Remedies {
            geometric: spec.is_geometric(),
            adaptive: matches!(spec.pace(), Pace::Adaptive(_)),
            pulled: spec.pull != OrAuto::Number(0.0),
            driven: spec.sweep.has("drive") || spec.drive.as_ref().is_some_and(is_inwards),
            vesicles: spec.has_vesicles(),
            stops: spec.stops_when_relaxed(),
            short: spec.precision == Some(Precision::F32),
            relative: spec.relax_at.is_none() && !spec.sweep.has("relax-at"),
        }
    }

    /// Of members that failed.
    pub(super) fn of_failures(&self) -> String {
        let Remedies { geometric, adaptive, pulled, driven, short, .. } = *self;
        let mut text = String::from("unless the flow itself becomes singular");
        if driven {
            text += ", as where a strong force makes the sides of a thin curve meet";
        }
        text += match (geometric, adaptive, pulled) {
            (false, false, _) => ", --adaptive --pull auto helps, or a smaller --tau",
            (false, true, false) => ", --pull auto helps, or more --points or a smaller --adaptive",
            (false, true, true) => ", more --points help, or a smaller --adaptive",
            (true, false, _) => ", --adaptive --pull auto helps, and more --points",
            (true, true, false) => ", --pull auto helps, and more --points",
            (true, true, true) => {
                ", more --points help, and a --pull of 960/R^4, ten times auto (R^2 = area/pi): with --energy, --drive or \
                 --conserve nodes must resolve the curve, and a smaller --adaptive does not help (docs/method.md)"
            }
        };
        // Vesicles and crystals at rest are moved by rounding alone.
        text + if geometric && short { "; if they relax in f64, use --precision f64" } else { "" }
    }

    /// Of members that drifted.
    pub(super) fn of_drift(&self) -> &'static str {
        match (self.pulled, self.geometric) {
            (false, _) => "use --pull auto, a smaller --tau or --adaptive, or more --points",
            (true, false) => "use a smaller --tau or --adaptive, or more --points",
            (true, true) => "use more --points, or a stronger --pull",
        }
    }

    /// Of members whose time was up.
    pub(super) fn of_time(&self) -> &'static str {
        match (self.vesicles, self.stops) {
            // In f32 the energy of one that hardly moves is rounded by more than its share.
            (true, _) if self.short => "use a longer --t-end, another --relax-to, or --precision f64",
            (true, _) => "use a longer --t-end, or another --relax-to",
            (false, true) => "use a longer --t-end, or a larger --relax-to or --relax-at",
            (false, false) => "use a longer --t-end or --t-end auto, or a larger --relax-to or --relax-at",
        }
    }
}

/// Whether a force may push curves inwards.
fn is_inwards(drive: &Drawn<Drive>) -> bool {
    drive.is_drawn() || !matches!(drive.typical(), Drive::Constant(force) if *force <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Remedies {
        Remedies::of(&Spec::from_toml(text).unwrap())
    }

    #[test]
    fn a_remedy_is_none_that_the_run_has_already() {
        let plain = of("");
        assert!(plain.of_drift().contains("--pull auto") && plain.of_failures().contains("a smaller --tau"));
        let pulled = of("adaptive = 1e-3\npull = 'auto'\nenergy = 'cos:4,0.03'");
        assert!(!pulled.of_drift().contains("auto") && pulled.of_failures().contains("ten times auto"));
        assert!(of("drive = 0.5").of_failures().contains("--adaptive --pull auto helps"));
        assert!(of("drive = 0.5").of_failures().contains("sides of a thin curve meet"));
        assert!(of("precision = 'f32'\ndrive = 0.5").of_failures().ends_with("use --precision f64"));
        assert!(!of("drive = 0.5").of_failures().contains("f64"));
        assert!(!pulled.of_failures().contains("sides") && !of("drive = -0.5").of_failures().contains("sides"));
    }

    #[test]
    fn a_vesicle_has_no_relax_at() {
        let vesicle = "flow = 'willmore'\nconserve = 'area,length'\nt-end = 'auto'";
        assert_eq!(of(vesicle).of_time(), "use a longer --t-end, or another --relax-to");
        assert!(of(&format!("precision = 'f32'\n{vesicle}")).of_time().ends_with("or --precision f64"));
        assert!(of("").of_time().contains("--t-end auto") && !of("t-end = 'auto'").of_time().contains("--t-end auto"));
    }
}
