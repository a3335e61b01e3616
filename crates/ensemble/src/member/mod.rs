//! Members: member j of an ensemble is one base curve, randomly perturbed and sampled into n nodes.
//!
//! A member is a pure function of the spec and j. Its amplitudes and phases are draws addressed by (seed, j, attempt,
//! mode); numbers of its shape, flow and perturbation that are distributions have draws of their own (`values.rs`).
//! Batch, order, thread and the other members therefore do not matter, and mode m gets the same number whichever other
//! modes are requested. The number of nodes does not matter either: member j is the same curve at n = 100 and 200.

pub mod mollifier;
pub mod outline_curve;
mod read_outlines;

pub use mollifier::{Mollified, Treated};
pub use outline_curve::Variation;
pub use read_outlines::Outlines;

use std::{
    borrow::Cow,
    collections::BTreeSet,
    f64::consts::{FRAC_1_SQRT_2, TAU},
    iter::repeat,
    path::Path,
    sync::{Arc, OnceLock},
};

use glam::DVec2;

use mollifier::mollify;
use outline_curve::{OutlineCurve, Treatment};

use crate::{MemberValues, Spec, theory::horizon::CurveScale};
use curvelax_base::random::Stream;
use curvelax_base::{
    error::{Error, Result},
    text::count,
};
use curvelax_curve::{
    BaseCurve, Modes, Perturbation, RadialFactor, RadialLaw, Sampler, Sampling, Shape, check_directions,
    outlines::{self, Labelled},
    polygon,
};
use curvelax_flow::{flow::Flow, solver::ring::MIN_POINTS};

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
    /// The excess of its outline before corners were rounded off, if they were: a share of the excess at the start is one of
    /// this.
    pub given_excess: Option<f64>,
    /// Its law of motion, if each member has its own; otherwise that of the spec.
    pub flow: Option<Flow>,
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
    law: RadialLaw,
    perturbation: Perturbation,
    seed: u64,
    /// The spec, if members have values of their own.
    drawn: Option<Arc<Spec>>,
    curves: Curves,
    /// Property of the outlines whose values are groups.
    group_by: Option<String>,
    sampling: Sampling,
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
}

/// The group of outlines that do not have the property.
const NO_GROUP: &str = "(none)";

/// The outlines of a shape, with the sizes of those that stand for all: measured once for all cells and levels.
pub(crate) struct OutlineSet {
    pub(crate) all: Vec<Labelled>,
    scales: Arc<[CurveScale]>,
}

impl OutlineSet {
    pub(crate) fn new(all: Vec<Labelled>) -> Result<OutlineSet> {
        // The only one is measured with the nodes that it gets.
        let scales = if all.len() > 1 { scales_of(&all)? } else { Arc::default() };
        Ok(OutlineSet { all, scales })
    }
}

/// Outlines of which the curves are kept: that of a rough one takes about 100 kB. Those of more are made for each member.
const KEPT: usize = 256;

/// The curves of the outlines of a set, each made when it is first needed.
struct OutlineCurves {
    set: Arc<OutlineSet>,
    treatment: Treatment,
    made: Vec<OnceLock<OutlineCurve>>,
}

impl OutlineCurves {
    fn new(set: Arc<OutlineSet>, treatment: Treatment) -> OutlineCurves {
        let kept = if set.all.len() <= KEPT { set.all.len() } else { 0 };
        OutlineCurves { set, treatment, made: (0..kept).map(|_| OnceLock::new()).collect() }
    }

    fn treatment(&self) -> &Treatment {
        &self.treatment
    }

    /// The curve of outline `i`, which there is.
    fn curve(&self, i: usize) -> OutlineCurve {
        let make = || self.treatment.curve(&self.set.all[i].outline);
        self.made.get(i).map_or_else(make, |kept| kept.get_or_init(make).clone())
    }

    /// Corners of that curve, which is not made for it.
    fn corners(&self, i: usize) -> u32 {
        let made = self.made.get(i).and_then(OnceLock::get);
        made.map_or_else(|| self.treatment.corners(&self.set.all[i].outline), |curve| curve.treated.corners)
    }
}

/// Nodes of a curve that is only measured.
const PROBE_NODES: usize = 512;
/// The outlines that stand for all are this many of the largest and of the longest ones, and of the smallest.
const EXTREMES: usize = 8;

impl Family {
    /// Loads the shape and checks the keys shape, sampling, points, amplitude, modes and decay.
    ///
    /// # Errors
    /// [`Error::Request`] if one of them, or the file of the shape, is wrong.
    pub fn new(spec: &Spec) -> Result<Family> {
        match spec.shape.typical().outlines_from(Path::new("")) {
            Some(outlines) => Family::of_outlines(spec, OutlineSet::new(outlines?)?.into()),
            None => Family::of_shape(spec),
        }
    }

    /// Does the same as [`Family::new`], for a shape that is a formula.
    pub(crate) fn of_shape(spec: &Spec) -> Result<Family> {
        let curves = if spec.shape.is_drawn() { Curves::Drawn } else { Curves::One };
        Family::of_curve(spec, spec.shape.typical().resolve()?, curves, None)
    }

    /// Does the same as [`Family::new`], with `outlines`, at least one, in place of the shape.
    pub(crate) fn of_outlines(spec: &Spec, outlines: Arc<OutlineSet>) -> Result<Family> {
        let none = || Error::value("shape", &spec.shape, "there is no outline", "give one");
        let first = Arc::clone(&outlines.all.first().ok_or_else(none)?.outline);
        let curves = OutlineCurves::new(outlines, Treatment::of(spec, None));
        Family::of_curve(spec, BaseCurve::from_outline(first), Curves::Outlines(curves.into()), None)
    }

    /// Does the same as [`Family::new`], with `curve` in place of the shape, for all members: for curves that no `--shape`
    /// can name.
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
            Curves::Drawn => scales(spec)?,
            Curves::Outlines(curves) if curves.set.all.len() > 1 => Arc::clone(&curves.set.scales),
            _ => [CurveScale::of(&nodes)].into(),
        };
        let (sampler, directions) = (Arc::new(sampler), check_directions(spec.modes.high).into());
        let Spec { perturbation, seed, sampling, .. } = *spec;
        let drawn = drawn(spec);
        Ok(Family {
            sampler,
            law,
            perturbation,
            seed,
            drawn,
            curves,
            group_by: spec.group_by.clone(),
            sampling,
            treatment,
            outline_curve,
            directions,
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
        let (sampler, scales) = (Arc::clone(&other.sampler), Arc::clone(&other.scales));
        let Spec { perturbation, seed, .. } = *spec;
        let drawn = drawn(spec);
        Ok(Family { sampler, law, perturbation, seed, drawn, directions, scales, ..other.clone() })
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
        self.sampler.outline().is_some() && self.sampling != Sampling::Points
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

    /// The same with their sizes.
    pub(crate) fn outline_set(&self) -> Option<&Arc<OutlineSet>> {
        match &self.curves {
            Curves::Outlines(curves) => Some(&curves.set),
            _ => None,
        }
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
        let MemberCurve { own, factor, flow } = self.own_curve(index)?;
        let sampler =
            own.as_ref().map(|own| Sampler::new(own.curve.clone(), self.sampling, self.points())).transpose()?;
        let own = own.as_ref().unwrap_or(&self.outline_curve);
        let sampler = sampler.as_ref().unwrap_or(&self.sampler);
        let mut nodes = sampler.sample(&factor);
        let mollified = match self.has_corners {
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
        let drawn = self.drawn(index).into_iter().map(|(_, number)| number).collect();
        let coefficients = self.feature_coefficients(&factor);
        let outline = self.outline(index);
        let label = outline.map_or(String::new(), |outline| outline.label.clone());
        let group = outline.zip(self.group_by.as_deref()).map_or(String::new(), |(outline, property)| {
            outline.property(property).filter(|value| !value.is_empty()).map_or(NO_GROUP.into(), Cow::into_owned)
        });
        let given_excess = own.given_excess(&factor);
        Ok(Member { index, cell: 0, label, group, nodes, origin, mollified, given_excess, flow, drawn, coefficients })
    }

    /// The curve of member `index` before it is sampled, perturbed, at any u, and its law of motion, if it has its own.
    ///
    /// # Errors
    /// As [`Family::member`].
    pub fn curve(&self, index: u64) -> Result<(impl Fn(f64) -> DVec2 + use<>, Option<Flow>)> {
        let MemberCurve { own, factor, flow, .. } = self.own_curve(index)?;
        let curve = own.map_or_else(|| self.sampler.curve().clone(), |own| own.curve);
        Ok((move |u| factor.apply(curve.centroid(), curve.point(u)), flow))
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
        let flow = values.and_then(|values| match values.flow {
            Cow::Owned(flow) => Some(flow),
            Cow::Borrowed(_) => None,
        });
        Ok(MemberCurve { own, factor, flow })
    }

    /// The first coefficients of a member's perturbation. Where others are perturbed, a member that is not has zeros.
    fn feature_coefficients(&self, factor: &RadialFactor) -> Vec<DVec2> {
        let Modes { low, high } = self.law.modes();
        let some = !self.law.is_none() || self.drawn.as_ref().is_some_and(|spec| spec.is_perturbed());
        let modes = if some { ((high - low) as usize + 1).min(FEATURE_MODES) } else { 0 };
        let own = factor.coefficients().map(|(_, wave)| wave);
        own.chain(repeat(DVec2::ZERO)).take(modes).collect()
    }

    /// The numbers that are drawn for member `index`, with their names: see [`Spec::drawn_numbers`].
    pub fn drawn(&self, index: u64) -> Vec<(String, f64)> {
        self.drawn.as_ref().map_or(Vec::new(), |spec| spec.drawn_numbers(index))
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
        self.drawn.as_ref().map(|spec| spec.values(index)).transpose()
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
        let draws = (0..MAX_ATTEMPTS).map(|attempt| self.draw(law, Stream::new(self.seed, index, attempt)));
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
        match self.perturbation {
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

/// The spec, without its lists, if members have values of their own.
fn drawn(spec: &Spec) -> Option<Arc<Spec>> {
    let short = || Spec { only: None, snapshots: Vec::new(), ..spec.clone() };
    spec.has_drawn_values().then(|| Arc::new(short()))
}

impl Curves {
    fn outlines(&self) -> &[Labelled] {
        match self {
            Curves::Outlines(curves) => &curves.set.all,
            _ => &[],
        }
    }
}

/// The size of a curve.
fn scale(curve: BaseCurve) -> Result<CurveScale> {
    let sampler = Sampler::new(curve, Sampling::Parameter, PROBE_NODES)?;
    Ok(CurveScale::of(&sampler.sample(&RadialFactor::default())))
}

/// The size of the curve of each of [`Spec::probes`].
fn scales(spec: &Spec) -> Result<Arc<[CurveScale]>> {
    spec.probes().iter().map(|values| scale(values.shape.resolve()?)).collect()
}

/// The sizes of the outlines that stand for all: the one of median radius, and the extreme ones, each once.
fn scales_of(outlines: &[Labelled]) -> Result<Arc<[CurveScale]>> {
    let all = outlines.iter().map(|one| scale(BaseCurve::from_outline(Arc::clone(&one.outline))));
    let all: Vec<CurveScale> = all.collect::<Result<_>>()?;
    let ascending = |of: fn(&CurveScale) -> f64| {
        let mut order: Vec<usize> = (0..all.len()).collect();
        order.sort_by(|one, other| of(&all[*one]).total_cmp(&of(&all[*other])));
        order
    };
    let (by_radius, by_length) = (ascending(|scale| scale.radius), ascending(|scale| scale.radius_of_length));
    let few = EXTREMES.min(all.len());
    let median = by_radius[all.len() / 2];
    let ends = [&by_radius[..few], &by_radius[all.len() - few..], &by_length[all.len() - few..]].concat();
    let extremes: BTreeSet<usize> = ends.into_iter().filter(|i| *i != median).collect();
    Ok([median].into_iter().chain(extremes).map(|i| all[i].clone()).collect())
}

/// Checks that all outlines have as many points, for `--sampling points`.
fn check_equal_points(outlines: &[Labelled]) -> Result<()> {
    let points = |one: &Labelled| one.outline.vertices().len();
    let Some(first) = outlines.first() else { return Ok(()) };
    let Some(other) = outlines.iter().find(|other| points(other) != points(first)) else { return Ok(()) };
    let problem = format!(
        "members have as many nodes each, and `{}` has {} points, `{}` {}",
        first.label,
        points(first),
        other.label,
        points(other)
    );
    Err(Error::value("sampling", "points", &problem, "use --sampling arclength"))
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
mod tests {
    use super::*;
    use curvelax_curve::crossing;

    fn spec(shape: &str, sampling: Sampling, points: usize, amplitude: f64) -> Spec {
        Spec { shape: shape.parse().unwrap(), sampling, points, amplitude: amplitude.into(), ..Spec::default() }
    }

    fn family(spec: &Spec) -> Family {
        Family::new(spec).unwrap()
    }

    fn in_user_frame(member: &Member) -> Vec<DVec2> {
        member.nodes.iter().map(|node| *node + member.origin).collect()
    }

    #[test]
    fn a_member_does_not_depend_on_the_members_before_it() {
        let default = Spec::default();
        let (one, other) = (family(&default), family(&default));
        let forwards: Vec<Member> = (0..11).map(|j| one.member(j).unwrap()).collect();
        let backwards: Vec<Member> = (0..11).rev().map(|j| other.member(j).unwrap()).collect();
        assert!(forwards.iter().eq(backwards.iter().rev()));
        assert!((1..11).all(|j| forwards[j].nodes != forwards[j - 1].nodes));
    }

    #[test]
    fn member_0_of_the_default_ensemble_never_changes() {
        let nodes = in_user_frame(&family(&Spec::default()).member(0).unwrap());
        let pinned = [
            (0, DVec2::new(1.9736111059010777, 0.09649039999015596)),
            (49, DVec2::new(-2.018789996233421, 0.01631228074190085)),
            (99, DVec2::new(1.9787948327127796, 0.0)),
        ];
        for (i, node) in pinned {
            assert!(nodes[i].distance(node) < 1e-12, "node {}: {:?}", i + 1, nodes[i]);
        }
    }

    #[test]
    fn amplitude_and_phase_of_a_mode_are_independent() {
        let spec = Spec { modes: Modes { low: 2, high: 2 }, ..Spec::default() };
        let family = family(&spec);
        let (a_quarter, count) = (DVec2::from_angle(-TAU / 8.0), 20_000_u32);
        // With amplitude a and phase φ these are a cos φ and a sin φ: of equal variance, and uncorrelated.
        let parts = (0..count).map(|j| {
            let factor = family.draw(&family.law, Stream::new(1, j.into(), 0));
            DVec2::new(factor.excursion(DVec2::X), factor.excursion(a_quarter)) / family.law.radial_deviation()
        });
        let [xx, xy, yy] = parts.fold([0.0; 3], |s, p| [s[0] + p.x * p.x, s[1] + p.x * p.y, s[2] + p.y * p.y]);
        let mean = [xx, xy, yy].map(|sum| sum / f64::from(count));
        // Standard errors are under 1/70: the fourth moment of a cos φ is 4.5.
        assert!((mean[0] - 1.0).abs() < 0.07 && (mean[2] - 1.0).abs() < 0.07 && mean[1].abs() < 0.05, "{mean:?}");
    }

    #[test]
    fn coefficients_of_the_gaussian_law_are_normal_and_independent_and_those_of_the_default_are_not() {
        let (count, modes) = (20_000_u64, Modes { low: 2, high: 3 });
        // Means over members of the coefficients of mode 2, over their deviation: x², y², x⁴, x²y², and x² of mode 3.
        let moments = |perturbation| {
            let amplitude = 0.05.into();
            let family = family(&Spec { modes, amplitude, perturbation, ..Spec::default() });
            let [two, three] = [2, 3].map(|m| family.law.deviation(m) * FRAC_1_SQRT_2);
            let mut sums = [0.0; 5];
            for j in 0..count {
                let all = family.coefficients(j).unwrap();
                let (DVec2 { x, y }, other) = (all[0].1 / two, all[1].1.x / three);
                let own = [x * x, y * y, x.powi(4), x * x * y * y, other * other];
                sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += own / count as f64);
            }
            sums
        };
        let [normal, default] = [Perturbation::Gaussian, Perturbation::AmplitudePhase].map(moments);
        // Standard errors: √(2/count) = 0.01 of x² and √(96/count) = 0.07 of x⁴ of a normal law.
        for (found, exact) in normal.iter().zip([1.0, 1.0, 3.0, 1.0, 1.0]) {
            assert!((found / exact - 1.0).abs() < 0.1, "seed 1: {normal:?}");
        }
        // E a⁴ E cos⁴ = 3·3/8 over 1/4, and E a⁴ E cos² sin² = 3/8 over 1/4.
        for (found, exact) in default.iter().zip([1.0, 1.0, 4.5, 1.5, 1.0]) {
            assert!((found / exact - 1.0).abs() < 0.15, "seed 1: {default:?}");
        }
    }

    #[test]
    fn the_power_of_a_mode_falls_as_two_p() {
        let spec = Spec { perturbation: Perturbation::Gaussian, decay: 1.5.into(), ..Spec::default() };
        let family = family(&Spec { modes: Modes { low: 2, high: 8 }, ..spec });
        let mut power = [0.0; 7];
        for j in 0..5000 {
            for (sum, (_, c)) in power.iter_mut().zip(family.coefficients(j).unwrap()) {
                *sum += c.length_squared() / 5000.0;
            }
        }
        for (m, power) in (2..).zip(power) {
            let exact = 0.05_f64.powi(2) * f64::from(m).powf(-3.0);
            // A standard error is 1/√5000.
            assert!((power / exact - 1.0).abs() < 0.07, "seed 1, mode {m}: {power} {exact}");
        }
    }

    #[test]
    fn a_member_with_drawn_values_is_the_member_of_a_spec_that_has_them() {
        let text = "shape = 'ellipse:uniform(1.2..3),1'\nflow = 'elastic:lognormal(0.5,0.2)'\n\
                    amplitude = 'uniform(0.01..0.1)'\ndecay = 'normal(1,0.1)'\npoints = 48";
        for design in ["random", "sobol", "lhs"] {
            let spec = Spec::from_toml(&format!("{text}\ndesign = '{design}'")).unwrap();
            let family = family(&spec);
            for j in [0, 3, 200, 255] {
                let values = spec.values(j).unwrap();
                let fixed = Spec {
                    shape: values.shape.clone().into_owned().into(),
                    amplitude: values.amplitude.into(),
                    decay: values.decay.into(),
                    ..Spec::from_toml("points = 48").unwrap()
                };
                let (own, alone) = (family.member(j).unwrap(), self::family(&fixed).member(j).unwrap());
                assert_eq!(own.nodes, alone.nodes, "{design} {j}");
                assert_eq!((own.flow, alone.flow), (Some(values.flow.into_owned()), None));
                assert_eq!(family.drawn(j).len(), 4);
            }
            assert_ne!(family.member(0).unwrap().nodes, family.member(1).unwrap().nodes);
        }
    }

    #[test]
    fn seeds_and_large_indices_make_different_members() {
        let make = |seed, index| family(&Spec { seed, ..Spec::default() }).member(index).unwrap().nodes;
        let nodes = [make(1, 0), make(2, 0), make(1 << 32, 0), make(1, u64::MAX), make(1, 1 << 32)];
        for (i, a) in nodes.iter().enumerate() {
            assert!(nodes[..i].iter().all(|b| a != b), "{i}");
        }
    }

    #[test]
    fn without_amplitude_a_member_is_the_base_curve() {
        let member = family(&spec("ellipse:2,1", Sampling::Parameter, 100, 0.0)).member(5).unwrap();
        for (i, node) in (1..).zip(in_user_frame(&member)) {
            let angle = TAU * (f64::from(i) / 100.0);
            assert!(node.distance(DVec2::new(2.0 * angle.cos(), angle.sin())) < 1e-15, "node {i}");
        }
    }

    #[test]
    fn nodes_are_counter_clockwise_about_their_own_centroid() {
        for shape in ["ellipse:2,1", "nonconvex", "file:../../examples/islands/iceland.csv"] {
            let family = family(&spec(shape, Sampling::Arclength, 101, 0.1));
            for j in 0..7 {
                let member = family.member(j).unwrap();
                assert!(polygon::signed_area(&member.nodes) > 0.0);
                assert!(polygon::area_centroid(&member.nodes).length() < 1e-14, "{shape} {j}");
            }
        }
    }

    #[test]
    fn more_nodes_sample_the_same_curve() {
        let at = |n| in_user_frame(&family(&spec("nonconvex", Sampling::Arclength, n, 0.05)).member(3).unwrap());
        let (coarse, fine) = (at(100), at(400));
        for (i, node) in coarse.iter().enumerate() {
            assert!(node.distance(fine[4 * i + 3]) < 1e-5, "node {}", i + 1);
        }
    }

    #[test]
    fn a_mode_is_the_same_draw_whichever_others_are_asked_for() {
        let factor = |low, high| {
            let family = family(&Spec { modes: Modes { low, high }, ..Spec::default() });
            family.draw(&family.law, Stream::new(1, 9, 0))
        };
        let circle = |k: u32| DVec2::from_angle(0.1 * f64::from(k));
        for k in 0..20 {
            let parts = factor(2, 4).excursion(circle(k)) + factor(5, 8).excursion(circle(k));
            assert!((factor(2, 8).excursion(circle(k)) - parts).abs() < 1e-15);
        }
    }

    #[test]
    fn the_radius_deviates_as_the_law_says() {
        let mut spec = spec("circle:1", Sampling::Parameter, 16, 0.1);
        spec.modes = Modes { low: 2, high: 6 };
        let family = family(&spec);
        let members = 4000_u32;
        let mut sums = [0.0; 2];
        for j in 0..members {
            let excursion = in_user_frame(&family.member(j.into()).unwrap())[4].length() - 1.0;
            sums = [sums[0] + excursion, sums[1] + excursion * excursion];
        }
        let count = f64::from(members);
        let deviation = (sums[1] / count).sqrt();
        let expected = family.law.radial_deviation();
        assert!((sums[0] / count).abs() < 5.0 * expected / count.sqrt(), "seed 1: mean {}", sums[0] / count);
        assert!((deviation / expected - 1.0).abs() < 0.06, "seed 1: {deviation} instead of {expected}");
    }

    #[test]
    fn the_strongest_law_still_makes_embedded_curves_of_embedded_ones() {
        let mut spec = spec("nonconvex", Sampling::Arclength, 601, 0.37);
        spec.modes = Modes { low: 2, high: 5 };
        spec.decay = 0.5.into();
        let family = family(&spec);
        assert!(family.law.radial_deviation() > 0.28, "{}", family.law.radial_deviation());
        let redrawn = (0..50)
            .filter(|&j| !family.draw(&family.law, Stream::new(1, j, 0)).is_embedding(&family.directions))
            .count();
        assert!(redrawn > 0, "seed 1: no draw was rejected, the test has lost its point");
        for j in 0..50 {
            assert_eq!(crossing(&family.member(j).unwrap().nodes), None, "seed 1, member {j}");
        }
    }

    #[test]
    fn a_file_s_own_number_of_points_must_agree_with_the_one_asked_for() {
        let island =
            |points| Family::new(&spec("file:../../examples/islands/jamaica.csv", Sampling::Points, points, 0.02));
        assert_eq!(island(100).unwrap().points(), 47);
        assert_eq!(island(47).unwrap().member(0).unwrap().nodes.len(), 47);
        let message = island(48).err().unwrap().to_string();
        assert!(message.contains("--points 48: the file has 47 points"), "{message}");
    }

    #[test]
    fn a_crossing_outline_warns() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bow.csv");
        std::fs::write(&path, "0,0\n3,3\n3,0\n0,1\n").unwrap();
        let crossed = family(&spec(&format!("file:{}", path.display()), Sampling::Arclength, 50, 0.0));
        assert!(crossed.warnings()[0].contains("crosses"), "{:?}", crossed.warnings());
        assert!(family(&Spec::default()).warnings().is_empty());
    }

    #[test]
    fn a_lemniscate_keeps_its_loops_its_place_and_has_a_warning() {
        for amplitude in [0.0, 0.05] {
            let family = family(&spec("lemniscate:2", Sampling::Arclength, 101, amplitude));
            assert!(family.warnings()[0].contains("excess"), "{:?}", family.warnings());
            for j in 0..20 {
                let member = family.member(j).unwrap();
                assert_eq!(polygon::turning_number(&member.nodes), 0, "seed 1, member {j}");
                assert!(member.origin.length() < 2.5, "seed 1, member {j}: {}", member.origin);
                let area = polygon::signed_area(&member.nodes);
                assert!(area >= -polygon::NO_AREA * 120.0, "seed 1, member {j}: {area}");
                assert_eq!(member.mollified, Mollified::default());
            }
        }
    }

    #[test]
    fn every_wrong_key_is_refused_before_any_member_is_made() {
        let wrong = [
            (Spec { amplitude: 0.6.into(), ..Spec::default() }, "--amplitude 0.6"),
            (Spec { modes: Modes { low: 0, high: 3 }, ..Spec::default() }, "--modes `0..=3`"),
            (Spec { decay: f64::NAN.into(), ..Spec::default() }, "--decay NaN"),
            (Spec { points: 2, ..Spec::default() }, "--points 2"),
            (Spec { sampling: Sampling::Points, ..Spec::default() }, "--sampling points"),
            (Spec { shape: Shape::Circle { radius: 0.0 }.into(), ..Spec::default() }, "--shape circle:0"),
            (Spec { shape: Shape::File("none.csv".into()).into(), ..Spec::default() }, "--shape file:none.csv"),
        ];
        for (spec, key) in wrong {
            let error = Family::new(&spec).err().expect(key);
            assert!(error.exit_code() == 2 && error.to_string().starts_with(key), "{error}");
        }
    }
}
