//! The text of `--shape`, and the bytes of an outline's file: read or refused, and what was read can be sampled.

#![no_main]

use std::path::Path;

use curvelax::{
    curve::{BaseCurve, Modes, Outline, RadialFactor, Sampler, Sampling, Shape},
    ensemble::{Family, Spec, request::spec::OrAuto, request::sweep::SweepAxis},
    flow::Flow,
};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((first, rest)) = data.split_first() else { return };
    match first {
        b'=' => words(rest),
        // Mollified members take a thousand times as long to make as to read: only some.
        b'~' => outline(rest, Sampling::Arclength),
        _ => outline(data, Sampling::Parameter),
    }
});

/// The values of flags: what is read prints as it is read.
fn words(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(shape) = text.parse::<Shape>() {
        assert_eq!(shape.to_string().parse(), Ok(shape.clone()));
        let _ = (shape.lowest_mode(), shape.highest_mode());
        // Sampled at all of its parameters, so that few can be made in a second: the short ones.
        if !matches!(shape, Shape::File(_) | Shape::Files(_)) && text.len() < 16 {
            let curve = shape.resolve().unwrap();
            assert!([0.0, 0.3, 1.0].into_iter().all(|u| curve.point(u).is_finite()) && curve.centroid().is_finite());
        }
    }
    if let Ok(flow) = text.parse::<Flow>() {
        assert_eq!(flow.to_string().parse(), Ok(flow));
    }
    if let Ok(modes) = text.parse::<Modes>() {
        assert_eq!(modes.to_string().parse(), Ok(modes));
    }
    let _ = text.parse::<OrAuto>();
    if let Ok(axis) = text.parse::<SweepAxis>() {
        assert_eq!(axis.labels().len(), axis.values.len());
    }
}

/// An outline, and curves of few nodes on it.
fn outline(bytes: &[u8], sampling: Sampling) {
    let outline = match Outline::from_csv(Path::new("outline.csv"), bytes) {
        Ok(outline) => outline,
        Err(error) => {
            let message = error.to_string();
            assert!(error.exit_code() == 2 && message.len() < 600 && !message.contains('\n'), "{message}");
            return;
        }
    };
    let n = outline.vertices().len();
    assert!((3..=bytes.len()).contains(&n) && outline.vertices().iter().all(|point| point.is_finite()));
    // A projection is a warning, too.
    assert!(outline.is_simple() || !outline.warnings().is_empty());
    let own = Outline::from_points(outline.vertices()).expect("the vertices of an outline are one");
    assert_eq!(own.vertices(), outline.vertices());
    let spec = Spec { points: 8, sampling, amplitude: 0.0.into(), ..Spec::default() };
    if sampling == Sampling::Arclength {
        let family = Family::of(&spec, BaseCurve::from_outline(outline)).unwrap();
        let member = family.member(0).unwrap();
        assert!(member.nodes.len() == 8 && member.nodes.iter().all(|node| node.is_finite()));
    } else {
        for sampling in [sampling, Sampling::Points] {
            let sampler = Sampler::new(BaseCurve::from_outline(outline.clone()), sampling, 8).unwrap();
            let nodes = sampler.sample(&RadialFactor::default());
            assert!(nodes.len() == sampler.nodes() && nodes.iter().all(|node| node.is_finite()));
        }
    }
}
