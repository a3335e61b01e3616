//! Files of outlines: the first byte says which format, the rest is read or refused, and what was read can be sampled.

#![no_main]

use std::{collections::BTreeSet, path::Path};

use curvelax::curve::{BaseCurve, Outline, RadialFactor, Sampler, Sampling, outlines};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((first, bytes)) = data.split_first() else { return };
    let name = match first {
        b'g' => "outlines.geojson",
        b'w' => "outlines.wkt",
        b'n' => "outlines.npy",
        b'z' => "outlines.npz",
        _ => "outlines.csv",
    };
    let all = match outlines::from_bytes(Path::new(name), bytes) {
        Ok(all) => all,
        Err(error) => {
            let message = error.to_string();
            let shown = message.len() < 900 && !message.contains(char::is_control);
            assert!(error.exit_code() == 2 && shown, "{message:?}");
            return;
        }
    };
    let labels: BTreeSet<&str> = all.iter().map(|one| &*one.label).collect();
    assert!(!all.is_empty() && labels.len() == all.len() && !outlines::warnings(&all).iter().any(String::is_empty));
    for one in &all {
        assert!(!one.label.is_empty() && !one.label.contains(char::is_control) && one.label.len() < 1000);
        let points = one.outline.vertices();
        assert!(points.len() >= 3 && points.iter().all(|point| point.is_finite()));
        assert!(one.outline.is_simple() || !one.outline.warnings().is_empty());
        let own = Outline::from_points(points).expect("the vertices of an outline are one");
        assert_eq!(own.vertices(), points);
    }
    let sampler = Sampler::new(BaseCurve::from_outline(all[0].outline.clone()), Sampling::Points, 8).unwrap();
    assert!(sampler.sample(&RadialFactor::default()).iter().all(|node| node.is_finite()));
});
