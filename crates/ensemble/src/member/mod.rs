//! Members: member j of an ensemble is one base curve, randomly perturbed and sampled into n nodes.
//!
//! A member is a pure function of the spec and j. Its amplitudes and phases are draws addressed by (seed, j, attempt,
//! mode); numbers of its shape, flow and perturbation that are distributions have draws of their own (`values.rs`).
//! Batch, order, thread and the other members therefore do not matter, and mode m gets the same number whichever other
//! modes are requested. The number of nodes does not matter either: member j is the same curve at n = 100 and 200.

pub mod mollifier;
pub mod outline_curve;
mod outline_set;
mod read_outlines;
mod stretch;

pub use mollifier::{Mollified, Treated};
pub use outline_curve::Variation;
pub use read_outlines::Outlines;

use std::{
    borrow::Cow,
    f64::consts::{FRAC_1_SQRT_2, TAU},
    iter::repeat,
    path::Path,
    sync::Arc,
};

use glam::DVec2;

use mollifier::mollify;
use outline_curve::{OutlineCurve, Treatment};
pub(crate) use outline_set::OutlineSet;
use outline_set::{OutlineCurves, check_equal_points, scale};
use stretch::{Sizes, Stretch};

use crate::{MemberValues, Spec, theory::horizon::CurveScale};
use curvelax_base::random::Stream;
use curvelax_base::{
    error::{Error, Result},
    text::count,
};
use curvelax_curve::{
    BaseCurve, Perturbation, RadialFactor, RadialLaw, Sampler, Sampling, Shape, check_directions,
    outlines::{self, Labelled},
    polygon,
};
use curvelax_flow::{flow::Flow, forcing::Forcing, solver::ring::MIN_POINTS};

/// Draws for one member before giving up. By Rice's formula the harshest law allowed, a thousand modes of one size,
/// still yields two valid draws in a hundred.
const MAX_ATTEMPTS: u32 = 1000;

/// Modes of the perturbation whose coefficients are features: the lowest ones. Mode m decays at m²(m² - 1), mode 34 a
/// hundred thousand times as fast as mode 2, and each fills two columns.
pub const FEATURE_MODES: usize = 32;

const NO_EXCESS: &str = "the loops of a lemniscate cancel: its area is next to nothing, and its excess, status and \
                         relaxation times, which divide by it, mean nothing";

/// A curve at the start of its run.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// Index of the member, from 0.
    pub index: u64,
    /// Index of its cell in a study, from 0.
    pub cell: u64,
    /// The name of its outline; empty if it has none.
    pub label: String,
    /// The value of the property by which outlines are grouped; empty if they are not.
    pub group: String,
    /// Nodes relative to `origin`, counter-clockwise, i = 1…n at index i-1.
    pub nodes: Vec<DVec2>,
    /// Area centroid of the nodes in the user's frame, subtracted so that f32 keeps its digits.
    pub origin: DVec2,
    /// How its corners were rounded off; only outlines sampled by arclength can need it.
    pub mollified: Mollified,
    /// The excess of its outline before corners were rounded off, if they were: a share of the excess at the start is
    /// one of this.
    pub given_excess: Option<f64>,
    /// Its law of motion, if each member has its own; otherwise that of the spec.
    pub flow: Option<Flow>,
    /// What acts besides it, if each member has values of its own; otherwise that of the spec.
    pub forcing: Option<Forcing>,
    /// The numbers that were drawn for it, in the order of [`Family::drawn`].
    pub drawn: Vec<f64>,
    /// The coefficients of cos mθ and sin mθ in its perturbation, of the lowest [`FEATURE_MODES`] modes m.
    pub coefficients: Vec<DVec2>,
}

/// The curve of a spec, prepared once; every member is made from it, or from a curve of its own.
#[derive(Clone)]
pub struct Family {
    /// The curve of all members; if each has its own, that of the typical values, or the first outline.
    sampler: Arc<Sampler>,
    /// Its spec, without lists.
    spec: Arc<Spec>,
    /// The law of the perturbation at the typical values, whose modes all members have.
    law: RadialLaw,
    /// The sizes that the starts of all members are given.
    sizes: Option<Sizes>,
    curves: Curves,
    /// How outlines become curves, and what the one of all members has become.
    treatment: Treatment,
    outline_curve: OutlineCurve,
    /// Directions at which a draw is checked.
    directions: Arc<[DVec2]>,
    warnings: Vec<String>,
    /// The curve is an outline with equal spacing: its corners may be too sharp for n nodes.
    has_corners: bool,
    /// The size of the curve without perturbation; if members have curves of their own, of the curve of each of
    /// [`Spec::probes`], or of some outlines.
    scales: Arc<[CurveScale]>,
}

/// What members are perturbations of.
#[derive(Clone)]
enum Curves {
    /// One curve.
    One,
    /// The shape with each member's own numbers.
    Drawn,
    /// Member j of outline j modulo their number.
    Outlines(Arc<OutlineCurves>),
}

/// What a member is made from.
struct MemberCurve {
    /// Its curve, if it is not that of all.
    own: Option<OutlineCurve>,
    factor: RadialFactor,
    /// Its law of motion, if it is not that of all.
    flow: Option<Flow>,
    /// What acts besides it, if members have values of their own.
    forcing: Option<Forcing>,
    /// How the perturbed curve is stretched.
    stretch: Option<Stretch>,
}

/// The group of outlines that do not have the property.
const NO_GROUP: &str = "(none)";

impl Family {
    /// Loads the shape and checks the keys shape, sampling, points, amplitude, modes and decay.
    ///
    /// # Errors
    /// [`Error::Request`] if one of them, or the file of the shape, is wrong.
    pub fn new(spec: &Spec) -> Result<Family> {
        let outlines = spec.shape.typical().outlines_from(Path::new(""));
        let outlines = outlines.map(|all| OutlineSet::new(all?)).transpose()?;
        Family::with(spec, outlines.map(Arc::new).as_ref())
    }

    /// Does the same as [`Family::new`], with `outlines`, at least one, if the shape is no formula.
    pub(crate) fn with(spec: &Spec, outlines: Option<&Arc<OutlineSet>>) -> Result<Family> {
        let Some(outlines) = outlines else {
            let curves = if spec.shape.is_drawn() { Curves::Drawn } else { Curves::One };
            return Family::of_curve(spec, spec.shape.typical().resolve()?, curves, None);
        };
        let none = || Error::value("shape", &spec.shape, "there is no outline", "give one");
        let first = Arc::clone(&outlines.all.first().ok_or_else(none)?.outline);
        let curves = OutlineCurves::new(Arc::clone(outlines), Treatment::of(spec, None));
        Family::of_curve(spec, BaseCurve::from_outline(first), Curves::Outlines(curves.into()), None)
    }

    /// Does the same as [`Family::new`], with `curve` in place of the shape, for all members: for curves that no
    /// `--shape` can name.
    ///
    /// ```
    /// use curvelax_curve::BaseCurve;
    /// use curvelax_ensemble::{Family, Spec};
    /// use glam::DVec2;
    ///
    /// let spec = Spec { points: 64, amplitude: 0.0.into(), ..Spec::default() }.validate()?;
    /// let circle = BaseCurve::from_formula(|u| DVec2::from_angle(std::f64::consts::TAU * u));
    /// let member = Family::of(&spec, circle)?.member(0)?;
    /// assert!(member.nodes.iter().all(|node| (node.length() - 1.0).abs() < 1e-6));
    /// # Ok::<(), curvelax_base::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Request`] if one of the keys sampling, points, amplitude, modes and decay is wrong.
    pub fn of(spec: &Spec, curve: BaseCurve) -> Result<Family> {
        Family::of_curve(spec, curve, Curves::One, None)
    }

    /// Does the same as [`Family::new`], with `curve` as the typical one, or a variation of it.
    fn of_curve(spec: &Spec, curve: BaseCurve, curves: Curves, variation: Option<Variation>) -> Result<Family> {
        let law = law(spec)?;
        let treatment = Treatment::of(spec, variation);
        let outline_curve = match (&curves, curve.outline()) {
            (_, None) => OutlineCurve::of(curve),
            (Curves::Outlines(curves), Some(_)) if *curves.treatment() == treatment => curves.curve(0),
            (_, Some(outline)) => treatment.curve(outline),
        };
        let curve = outline_curve.curve.clone();
        let outline = curve.outline();
        if let (Sampling::Points, Some(own)) = (spec.sampling, outline.map(|outline| outline.vertices().len())) {
            check_own_points(spec.points, own)?;
            check_equal_points(curves.outlines())?;
        }
        let has_corners = outline.is_some() && spec.sampling == Sampling::Arclength && spec.points >= MIN_POINTS;
        let simple = curve.is_simple();
        let mut warnings = match &curves {
            Curves::Outlines(curves) => outlines::warnings(&curves.set.all),
            _ => outline.map_or(Vec::new(), |outline| outline.warnings().to_vec()),
        };
        warnings.extend(outlines::misread("label", curves.outlines().iter().map(|one| &*one.label)));
        if let Some(property) = &spec.group_by {
            let all = curves.outlines();
            let groups: Vec<_> = all.iter().filter_map(|one| one.property(property)).collect();
            warnings.extend(outlines::misread("group", groups.iter().map(|group| &**group)));
            let without = all.iter().filter(|one| one.property(property).is_none_or(|value| value.is_empty()));
            let labels: Vec<&str> = without.map(|one| &*one.label).collect();
            if let Some(first) = labels.first() {
                let others = match labels.len() - 1 {
                    0 => String::new(),
                    more => format!(" and {}", count(more as u64, "other")),
                };
                warnings.push(format!(
                    "the outline `{first}`{others} of {} have no property {property}, or more than one value of it: their \
                     group is {NO_GROUP}",
                    all.len()
                ));
            }
        }
        if let Shape::Lemniscate { .. } = spec.shape.typical() {
            warnings.push(NO_EXCESS.into());
        }
        let sampler = Sampler::new(curve, spec.sampling, spec.points)?;
        let mut nodes = sampler.sample(&RadialFactor::default());
        if has_corners {
            mollify(&mut nodes, || sampler.area(&RadialFactor::default()), simple);
        }
        let scales = match &curves {
            Curves::Drawn => {
                spec.probes().iter().map(|values| scale(values.shape.resolve()?)).collect::<Result<_>>()?
            }
            Curves::Outlines(curves) if curves.set.all.len() > 1 => Arc::clone(&curves.set.scales),
            _ => [CurveScale::of(&nodes)].into(),
        };
        Ok(Family {
            sampler: Arc::new(sampler),
            spec: without_lists(spec),
            law,
            sizes: Sizes::of(spec),
            curves,
            treatment,
            outline_curve,
            directions: check_directions(spec.modes.high).into(),
            warnings,
            has_corners,
            scales,
        })
    }

    /// Does the same as [`Family::new`] for a spec with the same shape, sampling and points as `other`; the large
    /// tables are shared.
    ///
    /// # Errors
    /// As [`Family::new`].
    pub fn like(other: &Family, spec: &Spec) -> Result<Family> {
        let law = law(spec)?;
        let directions = match other.law.modes().high == spec.modes.high {
            true => Arc::clone(&other.directions),
            false => check_directions(spec.modes.high).into(),
        };
        Ok(Family { spec: without_lists(spec), law, sizes: Sizes::of(spec), directions, ..other.clone() })
    }

    /// Does the same as [`Family::new`] for a spec with the same shape as `other`, and another number of points; or for
    /// a variation of its curves.
    ///
    /// # Errors
    /// As [`Family::new`].
    pub fn resampled(other: &Family, spec: &Spec, variation: Option<Variation>) -> Result<Family> {
        let treatment = Treatment::of(spec, variation);
        let curves = match &other.curves {
            Curves::Outlines(curves) if *curves.treatment() != treatment => {
                Curves::Outlines(OutlineCurves::new(Arc::clone(&curves.set), treatment).into())
            }
            curves => curves.clone(),
        };
        Family::of_curve(spec, other.sampler.curve().clone(), curves, variation)
    }

    /// Whether members are curves through points, rather than these themselves.
    pub(crate) fn has_outlines(&self) -> bool {
        self.sampler.outline().is_some() && self.spec.sampling != Sampling::Points
    }

    /// Whether the curve of member `index` has a variation, as outlines can have.
    pub(crate) fn has(&self, variation: Variation, index: u64) -> bool {
        match &self.curves {
            Curves::Outlines(curves) if curves.set.all.len() > 1 => {
                let i = (index % curves.set.all.len() as u64) as usize;
                self.treatment.varies(&curves.set.all[i].outline, curves.corners(i), variation)
            }
            _ => self
                .sampler
                .outline()
                .is_some_and(|outline| self.treatment.varies(outline, self.outline_curve.treated.corners, variation)),
        }
    }

    /// Variations of the curve of a member, on average.
    pub(crate) fn variations(&self) -> f64 {
        let outlines = self.outlines().len().max(1) as u64;
        let of = |index: u64| Variation::ALL.into_iter().filter(|variation| self.has(*variation, index)).count();
        (0..outlines).map(|index| of(index) as f64).sum::<f64>() / outlines as f64
    }

    /// The outlines of the members, if they are read from files: that of member j is the one at j modulo their number.
    pub fn outlines(&self) -> &[Labelled] {
        self.curves.outlines()
    }

    /// The outline of member `index`, if it is read from a file.
    pub fn outline(&self, index: u64) -> Option<&Labelled> {
        let all = self.outlines();
        all.get((index % all.len().max(1) as u64) as usize)
    }

    /// The size of the curve without perturbation; if members have curves of their own, of the curve of each of
    /// [`Spec::probes`], or of outlines that stand for all; the typical one first.
    pub(crate) fn scales(&self) -> &[CurveScale] {
        &self.scales
    }

    /// Whether it shares the tables of its curve with `other`.
    #[cfg(test)]
    pub fn shares_with(&self, other: &Family) -> bool {
        Arc::ptr_eq(&self.sampler, &other.sampler)
    }

    /// What the user should know about the curve, one sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Number of nodes n: with `--sampling points` the number of points in the file, otherwise that of the spec.
    pub fn points(&self) -> usize {
        self.sampler.nodes()
    }

    /// Makes member `index`.
    ///
    /// # Errors
    /// [`Error::Request`] if no draw leaves the radius positive.
    pub fn member(&self, index: u64) -> Result<Member> {
        let MemberCurve { own, factor, flow, forcing, stretch } = self.own_curve(index)?;
        let sampler =
            own.as_ref().map(|own| Sampler::new(own.curve.clone(), self.spec.sampling, self.points())).transpose()?;
        let own = own.as_ref().unwrap_or(&self.outline_curve);
        let sampler = sampler.as_ref().unwrap_or(&self.sampler);
        let stretched = stretch.map(|stretch| stretch.of(sampler.curve(), &factor));
        let stretched = stretched.map(|curve| Sampler::new(curve, self.spec.sampling, self.points())).transpose()?;
        let mut nodes = match &stretched {
            Some(sampler) => sampler.sample(&RadialFactor::default()),
            None => sampler.sample(&factor),
        };
        let mollified = match self.has_corners {
            // A stretch keeps the area.
            true => mollify(&mut nodes, || sampler.area(&factor), sampler.curve().is_simple()),
            false => Mollified::default(),
        };
        let mollified = Mollified { outline: own.treated, ..mollified };
        let length = polygon::length(&nodes);
        // The area of loops that cancel is rounding only; its sign must not decide the orientation.
        if polygon::signed_area(&nodes) < -polygon::NO_AREA * length * length {
            polygon::turn_round(&mut nodes);
        }
        let origin = polygon::area_centroid(&nodes);
        nodes.iter_mut().for_each(|node| *node -= origin);
        self.sizes.map_or(Ok(()), |sizes| sizes.fit(&mut nodes))?;
        let drawn = self.drawn(index).into_iter().map(|(_, number)| number).collect();
        let coefficients = self.feature_coefficients(&factor);
        let outline = self.outline(index);
        let label = outline.map_or(String::new(), |outline| outline.label.clone());
        let group = outline.zip(self.spec.group_by.as_deref()).map_or(String::new(), |(outline, property)| {
            outline.property(property).filter(|value| !value.is_empty()).map_or(NO_GROUP.into(), Cow::into_owned)
        });
        let given_excess = own.given_excess(&factor).filter(|_| stretched.is_none());
        Ok(Member {
            index,
            cell: 0,
            label,
            group,
            nodes,
            origin,
            mollified,
            given_excess,
            flow,
            forcing,
            drawn,
            coefficients,
        })
    }

    /// The curve of member `index` before it is sampled, perturbed, at any u, and its law of motion, if it has its own.
    ///
    /// # Errors
    /// As [`Family::member`].
    pub fn curve(&self, index: u64) -> Result<(impl Fn(f64) -> DVec2 + use<>, Option<Flow>)> {
        let MemberCurve { own, factor, flow, stretch, .. } = self.own_curve(index)?;
        let curve = own.map_or_else(|| self.sampler.curve().clone(), |own| own.curve);
        let placed = move |u| factor.apply(curve.centroid(), curve.point(u));
        Ok((move |u| stretch.map_or_else(|| placed(u), |stretch| stretch.apply(placed(u))), flow))
    }

    fn own_curve(&self, index: u64) -> Result<MemberCurve> {
        let values = self.values(index)?;
        let factor = self.radial_factor(&self.law_of(values.as_ref())?, index)?;
        let own = match (&self.curves, &values) {
            (Curves::Drawn, Some(values)) => Some(OutlineCurve::of(values.shape.resolve()?)),
            (Curves::Outlines(curves), _) if curves.set.all.len() > 1 => {
                Some(curves.curve((index % curves.set.all.len() as u64) as usize))
            }
            _ => None,
        };
        let forcing = values.as_ref().map(|values| values.forcing);
        // Points that are nodes are moved as such.
        let sizes = self.sizes.filter(|sizes| !sizes.are_kept() || self.spec.sampling != Sampling::Points);
        let own_reduced = values.as_ref().and_then(|values| values.reduced_area).map(Sizes::ReducedArea);
        let reduced = own_reduced.or(sizes).and_then(|sizes| Some((sizes.reduced_area()?, sizes)));
        let curve = own.as_ref().map_or_else(|| self.sampler.curve(), |own: &OutlineCurve| &own.curve);
        let stretch = reduced.map(|reduced| Stretch::to(reduced, curve, &factor, index)).transpose()?.flatten();
        let flow = values.and_then(|values| match values.flow {
            Cow::Owned(flow) => Some(flow),
            Cow::Borrowed(_) => None,
        });
        Ok(MemberCurve { own, factor, flow, forcing, stretch })
    }

    /// The first coefficients of a member's perturbation. Where others are perturbed, a member that is not has zeros.
    fn feature_coefficients(&self, factor: &RadialFactor) -> Vec<DVec2> {
        let own = factor.coefficients().map(|(_, wave)| wave);
        own.chain(repeat(DVec2::ZERO)).take(self.spec.feature_modes().len()).collect()
    }

    /// The numbers that are drawn for member `index`, with their names: see [`Spec::drawn_numbers`].
    pub fn drawn(&self, index: u64) -> Vec<(String, f64)> {
        self.spec.drawn_numbers(index)
    }

    /// The coefficients of cos mθ and sin mθ in the perturbation of member `index`, with m.
    ///
    /// # Errors
    /// As [`Family::member`].
    pub fn coefficients(&self, index: u64) -> Result<Vec<(u32, DVec2)>> {
        let law = self.law_of(self.values(index)?.as_ref())?;
        Ok(self.radial_factor(&law, index)?.coefficients().collect())
    }

    /// The values of member `index`, if each has its own.
    fn values(&self, index: u64) -> Result<Option<MemberValues<'_>>> {
        self.spec.has_drawn_values().then(|| self.spec.values(index)).transpose()
    }

    /// The law of the perturbation of a member with these values.
    fn law_of(&self, values: Option<&MemberValues>) -> Result<RadialLaw> {
        values.map_or(Ok(self.law), |values| RadialLaw::new(values.amplitude, self.law.modes(), values.decay))
    }

    /// The first draw for member `index` that leaves the radius positive.
    fn radial_factor(&self, law: &RadialLaw, index: u64) -> Result<RadialFactor> {
        if law.is_none() {
            return Ok(RadialFactor::default());
        }
        let draws = (0..MAX_ATTEMPTS).map(|attempt| self.draw(law, Stream::new(self.spec.seed, index, attempt)));
        draws.into_iter().find(|factor| factor.is_embedding(&self.directions)).ok_or_else(|| {
            let problem = format!("member {index} has no positive radius in {MAX_ATTEMPTS} draws");
            Error::value("amplitude", law.amplitude(), &problem, "lower --amplitude or raise --decay")
        })
    }

    /// Mode m uses draw 2m for its amplitude and draw 2m + 1 for its phase; or one for cos and the other for sin.
    fn draw(&self, law: &RadialLaw, stream: Stream) -> RadialFactor {
        let modes = law.modes();
        let amplitude_and_phase = |m: u32| {
            let [turn, _] = stream.uniforms(2 * m + 1);
            (law.deviation(m) * stream.normal(2 * m), TAU * turn)
        };
        // Half the power of the mode each.
        let cos_and_sin = |m: u32| {
            let normals = DVec2::new(stream.normal(2 * m), stream.normal(2 * m + 1));
            law.deviation(m) * FRAC_1_SQRT_2 * normals
        };
        match self.spec.perturbation {
            Perturbation::AmplitudePhase => {
                RadialFactor::new(modes.low, (modes.low..=modes.high).map(amplitude_and_phase))
            }
            Perturbation::Gaussian => {
                RadialFactor::of_coefficients(modes.low, (modes.low..=modes.high).map(cos_and_sin))
            }
        }
    }
}

/// The law of the perturbation at the typical values, whose modes all members have.
fn law(spec: &Spec) -> Result<RadialLaw> {
    RadialLaw::new(*spec.amplitude.typical(), spec.modes, *spec.decay.typical())
}

fn without_lists(spec: &Spec) -> Arc<Spec> {
    Arc::new(Spec { only: None, snapshots: Vec::new(), ..spec.clone() })
}

impl Curves {
    fn outlines(&self) -> &[Labelled] {
        match self {
            Curves::Outlines(curves) => &curves.set.all,
            _ => &[],
        }
    }
}

/// Checks `--points` against the file's own number of points; the default counts as not given.
fn check_own_points(asked: usize, own: usize) -> Result<()> {
    if asked == own || asked == Spec::default().points {
        return Ok(());
    }
    let problem = format!("the file has {own} points and --sampling points makes each a node");
    Err(Error::value(
        "points",
        asked,
        &problem,
        &format!("leave --points out, give {own}, or use --sampling arclength"),
    ))
}

#[cfg(test)]
mod tests;
