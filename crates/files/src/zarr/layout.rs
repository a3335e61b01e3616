//! The arrays of a store: their names, units and dimensions.

use serde_json::{Value, json};

use super::{
    array::Array,
    chunks::{CHUNK_BYTES, DataType},
};
use curvelax_base::error::Result;
use curvelax_ensemble::{Spec, Status, request::spec::Store, schedule::Outputs};

/// The array with the status of each member.
pub(super) const STATUS: &str = "status";

/// The arrays of nodes: name, unit and meaning.
pub(super) const FIELDS: [(&str, &str, &str); 4] = [
    ("x", "length", "x coordinate of the node"),
    ("y", "length", "y coordinate of the node"),
    ("k", "1/length", "signed curvature of the segment that ends at the node"),
    ("r", "length", "length of the segment that ends at the node, as the scheme evolves it"),
];

/// All arrays of a store.
pub(super) struct Arrays {
    /// Those that are known in advance: of members, times, nodes and cells.
    pub(super) known: [Array; 4],
    /// Those that grow: the [fields](FIELDS), and the [status](STATUS) of each member.
    pub(super) growing: Vec<Array>,
}

/// The arrays for the members of `spec`, with chunks of at most `bytes`.
pub(super) fn arrays(spec: &Spec, points: usize, times: &[f64], bytes: usize) -> Arrays {
    let members = ("member", spec.member_count());
    let (instants, nodes) = (("time", times.len() as u64), ("node", points as u64));
    let vector = |name, kind, along, attributes| Array::new(name, kind, &[along], attributes, bytes);
    let named = |name: &str| json!({ "long_name": name });
    let flags = json!({
        "long_name": "how the member ended",
        "flag_values": Status::ALL.map(|status| status as u32),
        "flag_meanings": Status::ALL.map(Status::name).join(" "),
    });
    let unit = |own: &str| spec.units.as_ref().map_or(own.to_owned(), |units| units.attribute(own));
    let time = json!({ "long_name": "time", "units": unit("length^4") });
    let fields = FIELDS.map(|(name, units, what)| {
        let attributes = json!({ "long_name": what, "units": unit(units), "coordinates": "cell status" });
        Array::new(name, DataType::Float64, &[members, instants, nodes], attributes, bytes)
    });
    let known = [
        vector("member", DataType::Int64, members, named("index of the member")),
        vector("time", DataType::Float64, instants, time),
        vector("node", DataType::Int64, nodes, named("number of the node along the curve")),
        vector("cell", DataType::Int64, members, named("index of the cell of the sweep")),
    ];
    Arrays { known, growing: fields.into_iter().chain([vector(STATUS, DataType::Int8, members, flags)]).collect() }
}

/// Bytes of the chunks that are being filled while a store of `spec` with `points` nodes grows, 0 without one.
pub fn bytes_held(spec: &Spec, points: usize) -> u64 {
    if spec.store != Store::Zarr || spec.snapshots.is_empty() {
        return 0;
    }
    let growing = arrays(spec, points, &times(spec), CHUNK_BYTES).growing;
    growing.iter().take(FIELDS.len()).map(|array| array.chunk_bytes as u64).sum()
}

/// The attributes of all arrays together.
pub(super) fn of_group(spec: &Spec) -> Result<Value> {
    Ok(json!({
        "title": "nodes of relaxing plane curves",
        "curvelax": curvelax_base::VERSION,
        // The number of threads does not change the results.
        "spec": Spec { threads: None, ..spec.clone() }.to_toml()?,
    }))
}

/// The attributes of each array of `spec` with `points` nodes by name, and under an empty name those of all together.
///
/// # Errors
/// [`Error::Failed`](curvelax_base::error::Error::Failed) if the spec cannot be written.
pub fn attributes(spec: &Spec, points: usize) -> Result<Vec<(&'static str, Value)>> {
    let Arrays { known, growing } = arrays(spec, points, &times(spec), 0);
    let of_arrays =
        known.into_iter().chain(growing).map(|mut array| Ok((array.name, array.metadata["attributes"].take())));
    [of_group(spec).map(|own| ("", own))].into_iter().chain(of_arrays).collect()
}

/// The times of the snapshots. Times equal to the final one up to rounding are replaced by it, as in `snapshots.csv`.
pub fn times(spec: &Spec) -> Vec<f64> {
    Outputs::new(spec.final_time(), None, [&spec.snapshots, &[], &[]]).from(0).map(|output| output.t).collect()
}

/// The index of the time nearest to `t`. They differ only by rounding, if final times vary from cell to cell.
pub(super) fn nearest(times: &[f64], t: f64) -> usize {
    let after = times.partition_point(|own| *own < t).min(times.len() - 1);
    if after > 0 && t - times[after - 1] < times[after] - t { after - 1 } else { after }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde_json::Value;

    use super::*;
    use crate::zarr::tests::{members, spec, stored};

    #[test]
    fn the_metadata_hold_the_spec_and_repeat_that_of_each_array() {
        let home = tempfile::tempdir().unwrap();
        let spec = Spec { threads: Some(3), ..spec(7, &[0.0, 1.0, 2.0]) };
        let store = stored(home.path(), &spec, &members(), 1 << 20);
        let json = |name: &str| -> Value {
            serde_json::from_str(&fs::read_to_string(store.join(name).join("zarr.json")).unwrap()).unwrap()
        };
        let group = json("");
        let text = group["attributes"]["spec"].as_str().unwrap();
        assert_eq!(Spec::from_toml(text).unwrap(), Spec { threads: None, ..spec });
        assert_eq!(group["attributes"]["curvelax"], curvelax_base::VERSION);
        let all = group["consolidated_metadata"]["metadata"].as_object().unwrap();
        assert_eq!(all.len(), 9);
        all.iter().for_each(|(name, metadata)| assert_eq!(json(name), *metadata, "{name}"));
        assert_eq!(json("k")["attributes"]["units"], "1/length");
        assert_eq!(json("time")["attributes"]["units"], "length^4");
        let meanings = json("status")["attributes"]["flag_meanings"].as_str().unwrap().to_string();
        let words: Vec<&str> = meanings.split(' ').collect();
        let codes = json("status")["attributes"]["flag_values"].clone();
        for (i, status) in Status::ALL.into_iter().enumerate() {
            assert_eq!((words[i], &codes[i]), (status.name(), &json!(status as u32)));
        }
    }

    #[test]
    fn a_time_that_rounding_moved_finds_its_place() {
        let times = [0.0, 0.5, 1.0];
        for (t, place) in [(0.0, 0), (0.5, 1), (0.5 + 1e-12, 1), (0.5 - 1e-12, 1), (1.0, 2), (1.0 + 1e-12, 2)] {
            assert_eq!(nearest(&times, t), place, "{t}");
        }
    }
}
