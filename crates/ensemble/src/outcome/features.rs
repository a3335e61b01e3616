//! The features of a member at its start: what was drawn for it, and the shape of its curve. They are what may explain
//! why members relax at different times.
//!
//! Like the member itself, they are a pure function of the spec and its index.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::{
    Member, Observables, Spec,
    member::FEATURE_MODES,
    request::{DRAWN, drawn_names},
};
use curvelax_base::error::Result;
use curvelax_curve::{DESCRIPTORS, Modes, descriptors, polygon};

/// Keys on which the features depend.
const KEYS: [&str; 9] =
    ["shape", "flow", "energy", "diffusivity", "drive", "amplitude", "decay", "reduced-area", "modes"];

/// The features of a member: a number for each of [`Spec::cell_features`], NaN if unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Features(pub Vec<f64>);

/// A feature that members have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Feature {
    /// Its name: a heading of `members.csv`.
    pub name: String,
    /// What it means.
    pub meaning: String,
    /// It is 0 or 1.
    pub is_flag: bool,
}

impl Feature {
    fn new(name: impl Into<String>, meaning: impl Into<String>) -> Feature {
        Feature { name: name.into(), meaning: meaning.into(), is_flag: false }
    }
}

impl Features {
    /// Those of a member, with the observables of its start.
    pub fn of(member: &Member, start: &Observables) -> Features {
        let Member { nodes, drawn, coefficients, .. } = member;
        let Observables { excess, energy, k_min, k_max, .. } = *start;
        let waves = coefficients.iter().flat_map(|wave| [wave.x, wave.y]);
        let convex = f64::from(u8::from(polygon::is_convex(nodes)));
        let shape = [excess, energy, k_min, k_max].into_iter().chain(descriptors(nodes)).chain([convex]);
        Features(drawn.iter().copied().chain(waves).chain(shape).collect())
    }
}

impl Spec {
    /// The features of the members of a cell with this spec, in the order of their numbers.
    pub fn cell_features(&self) -> Vec<Feature> {
        features(self.drawn_counts(), &self.feature_modes())
    }

    /// The features of the members of all cells, each once. Of the modes of the perturbation the lowest
    /// [`FEATURE_MODES`] are among them.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if the values of a cell do not fit the spec.
    pub fn all_features(&self) -> Result<Vec<Feature>> {
        if !self.sweeps_features() {
            return Ok(self.cell_features());
        }
        let (mut counts, mut modes) = ([0; DRAWN], BTreeSet::new());
        for index in 0..self.sweep.cells() {
            let cell = self.of_cell(index)?;
            counts.iter_mut().zip(cell.drawn_counts()).for_each(|(most, own)| *most = own.max(*most));
            modes.extend(cell.feature_modes());
        }
        Ok(features(counts, &modes.into_iter().take(FEATURE_MODES).collect::<Vec<_>>()))
    }

    /// Whether cells may differ in their features.
    pub fn sweeps_features(&self) -> bool {
        KEYS.into_iter().any(|key| self.sweep.has(key))
    }

    /// Modes of the perturbation without a feature of their own, since they are too many.
    pub fn modes_without_features(&self) -> u32 {
        let Modes { low, high } = self.modes;
        if self.is_perturbed() { (high - low + 1).saturating_sub(FEATURE_MODES as u32) } else { 0 }
    }

    /// Modes of the perturbation whose coefficients are features.
    pub(crate) fn feature_modes(&self) -> Vec<u32> {
        let Modes { low, high } = self.modes;
        if self.is_perturbed() { (low..=high).take(FEATURE_MODES).collect() } else { Vec::new() }
    }
}

/// The features of members for which so many numbers of each key are drawn, with these modes of the perturbation.
fn features(drawn: [usize; DRAWN], modes: &[u32]) -> Vec<Feature> {
    let drawn = drawn_names(drawn).into_iter().map(|name| {
        let (key, rank) = match &*name {
            "reduced_area" => ("reduced-area", "1"),
            name => name.split_once('_').unwrap_or((name, "1")),
        };
        let meaning = format!("number {rank} that is drawn for --{key}");
        Feature::new(name, meaning)
    });
    let waves = modes.iter().flat_map(|m| {
        let wave =
            |of: &str| Feature::new(format!("{of}_{m}"), format!("coefficient of {of} {m}θ in the perturbation"));
        ["cos", "sin"].map(wave)
    });
    let observed = [
        ("excess_start", "as in `summary.csv`"),
        ("energy_start", "as in `summary.csv`"),
        ("k_min_start", "smallest curvature of the initial curve"),
        ("k_max_start", "largest curvature of the initial curve"),
    ];
    let observed = observed.map(|(name, meaning)| Feature::new(name, meaning));
    let descriptors = DESCRIPTORS.map(|k| {
        let meaning = format!("Fourier descriptor of mode {k} of the initial outline");
        Feature::new(format!("descriptor_{k}"), meaning)
    });
    let convex =
        Feature { is_flag: true, ..Feature::new("convex", "1 if the initial polygon turns right at no node, else 0") };
    drawn.chain(waves).chain(observed).chain(descriptors).chain([convex]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Study, study::Cell};

    fn spec(text: &str) -> Spec {
        Spec::from_toml(text).unwrap().validate().unwrap()
    }

    fn names(features: &[Feature]) -> String {
        features.iter().map(|feature| feature.name.as_str()).collect::<Vec<_>>().join(" ")
    }

    const SHAPE: &str = "excess_start energy_start k_min_start k_max_start descriptor_2 descriptor_3 descriptor_4 \
                         descriptor_5 descriptor_6 descriptor_7 descriptor_8 convex";

    #[test]
    fn features_are_what_is_drawn_and_the_shape() {
        assert_eq!(names(&spec("modes = '2..=3'").cell_features()), format!("cos_2 sin_2 cos_3 sin_3 {SHAPE}"));
        assert_eq!(names(&spec("amplitude = 0").cell_features()), SHAPE);
        let drawn = "shape = 'ellipse:uniform(1.2..3),1'\nflow = 'elastic:lognormal(0.5,0.2)'\nmodes = '4..=4'\n";
        let own = format!("{drawn}amplitude = 'choice(0,0.1)'\ndecay = 'normal(1,0.1)'");
        assert_eq!(names(&spec(&own).cell_features()), format!("shape_1 flow_1 amplitude decay cos_4 sin_4 {SHAPE}"));
    }

    #[test]
    fn every_member_has_a_number_for_each_feature() {
        for text in [
            "",
            "amplitude = 0",
            "amplitude = 'choice(0,0.1)'\nmodes = '2..=5'",
            "points = 400\nmodes = '3..=90'\namplitude = 0.01",
            "[sweep]\nshape = ['ellipse:uniform(1.2..3),1', 'circle:1']\nmodes = ['2..=3', '3..=5']",
        ] {
            let study = Study::new(Spec { curves: 4, ..spec(text) }).unwrap();
            for cell in study.cells() {
                let names = cell.spec.cell_features();
                for index in cell.members() {
                    let member = cell.member(index).unwrap();
                    let Features(numbers) = Features::of(&member, &Observables::default());
                    assert_eq!(numbers.len(), names.len(), "{text}");
                    assert_waves(cell, index, &names, &numbers);
                }
            }
        }
    }

    /// Checks the coefficients against those of the family; without a perturbation they are 0.
    fn assert_waves(cell: &Cell, index: u64, names: &[Feature], numbers: &[f64]) {
        let waves = cell.family.coefficients(cell.drawn_as(index)).unwrap();
        let found = |name: String| names.iter().position(|feature| feature.name == name).map(|i| numbers[i]);
        let mut seen = 0;
        for (m, wave) in &waves {
            let own = [found(format!("cos_{m}")), found(format!("sin_{m}"))];
            seen += own.iter().flatten().count();
            assert!(own == [None; 2] || own == [Some(wave.x), Some(wave.y)], "{m}: {own:?} {wave}");
        }
        let waving = names.iter().filter(|feature| ["cos_", "sin_"].iter().any(|of| feature.name.starts_with(of)));
        match waves.is_empty() {
            true => assert!(waving.map(|feature| found(feature.name.clone())).all(|value| value == Some(0.0))),
            false => assert_eq!((seen, seen), (waving.count(), 2 * waves.len().min(FEATURE_MODES))),
        }
    }

    #[test]
    fn cells_have_the_union_of_their_features_and_the_lowest_modes() {
        let two = "[sweep]\nshape = ['ellipse:uniform(1.2..3),1', 'circle:1']\nmodes = ['2..=3', '5..=5']";
        let all = spec(two).all_features().unwrap();
        assert_eq!(names(&all), format!("shape_1 cos_2 sin_2 cos_3 sin_3 cos_5 sin_5 {SHAPE}"));
        let many = spec("points = 4000\nmodes = '3..=1000'\namplitude = 0.001");
        let waves = many.all_features().unwrap();
        assert_eq!((waves.len(), &*waves[2 * FEATURE_MODES - 1].name), (2 * FEATURE_MODES + 12, "sin_34"));
        assert_eq!((many.modes_without_features(), spec("").modes_without_features()), (998 - 32, 0));
        let swept = spec("points = 400\namplitude = 0.01\n[sweep]\nmodes = ['20..=60', '2..=4']");
        let first = names(&swept.all_features().unwrap());
        assert!(first.starts_with("cos_2 ") && first.contains(" cos_48 sin_48 excess"), "{first}");
    }
}
