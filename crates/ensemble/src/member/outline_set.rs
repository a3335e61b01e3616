//! The outlines that members are copies of, and the sizes of those that stand for all.

use std::{
    collections::BTreeSet,
    sync::{Arc, OnceLock},
};

use super::outline_curve::{OutlineCurve, Treatment};
use crate::theory::horizon::CurveScale;
use curvelax_base::error::{Error, Result};
use curvelax_curve::{BaseCurve, RadialFactor, Sampler, Sampling, outlines::Labelled};

/// Nodes of a curve that is only measured.
const PROBE_NODES: usize = 512;
/// The outlines that stand for all are this many of the largest and of the longest ones, and of the smallest.
const EXTREMES: usize = 8;

/// The outlines of a shape, with the sizes of those that stand for all: measured once for all cells and levels.
pub(crate) struct OutlineSet {
    pub(crate) all: Vec<Labelled>,
    pub(super) scales: Arc<[CurveScale]>,
}

impl OutlineSet {
    pub(crate) fn new(all: Vec<Labelled>) -> Result<OutlineSet> {
        // The only one is measured with the nodes that it gets.
        let scales = if all.len() > 1 { scales_of(&all)? } else { Arc::default() };
        Ok(OutlineSet { all, scales })
    }
}

/// Outlines of which the curves are kept: that of a rough one takes about 100 kB. Those of more are made for each
/// member.
const KEPT: usize = 256;

/// The curves of the outlines of a set, each made when it is first needed.
pub(super) struct OutlineCurves {
    pub(super) set: Arc<OutlineSet>,
    treatment: Treatment,
    made: Vec<OnceLock<OutlineCurve>>,
}

impl OutlineCurves {
    pub(super) fn new(set: Arc<OutlineSet>, treatment: Treatment) -> OutlineCurves {
        let kept = if set.all.len() <= KEPT { set.all.len() } else { 0 };
        OutlineCurves { set, treatment, made: (0..kept).map(|_| OnceLock::new()).collect() }
    }

    pub(super) fn treatment(&self) -> &Treatment {
        &self.treatment
    }

    /// The curve of outline `i`, which there is.
    pub(super) fn curve(&self, i: usize) -> OutlineCurve {
        let make = || self.treatment.curve(&self.set.all[i].outline);
        self.made.get(i).map_or_else(make, |kept| kept.get_or_init(make).clone())
    }

    /// Corners of that curve, which is not made for it.
    pub(super) fn corners(&self, i: usize) -> u32 {
        let made = self.made.get(i).and_then(OnceLock::get);
        made.map_or_else(|| self.treatment.corners(&self.set.all[i].outline), |curve| curve.treated.corners)
    }
}

/// The size of a curve.
pub(super) fn scale(curve: BaseCurve) -> Result<CurveScale> {
    let sampler = Sampler::new(curve, Sampling::Parameter, PROBE_NODES)?;
    Ok(CurveScale::of(&sampler.sample(&RadialFactor::default())))
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
pub(super) fn check_equal_points(outlines: &[Labelled]) -> Result<()> {
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
