//! Stores as a reader finds them: element by element, by their metadata alone.

use std::{fs, path::Path};

use serde_json::Value;

use super::SnapshotStore;
use crate::{
    OutputFolder, names,
    tables::{NodeRow, Table},
};
use curvelax_backend::{Backend, cpu::CpuBackend};
use curvelax_ensemble::{
    Cell, Ended, Family, Snapshot, Spec, Status,
    request::spec::{Precision, Store},
    simulate::simulate,
};
use curvelax_flow::{
    scheme::step::Method,
    solver::{Blocks, Solver},
};

/// An array as it was read, in C order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Read {
    shape: Vec<usize>,
    chunk: Vec<usize>,
    elements: Vec<[u8; 8]>,
}

impl Read {
    fn floats(&self) -> Vec<u64> {
        self.elements.iter().map(|bytes| f64::from_le_bytes(*bytes).to_bits()).collect()
    }

    fn whole(&self) -> Vec<i64> {
        self.elements.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect()
    }
}

/// Reads an array by its metadata alone, element by element; elements shorter than 8 bytes are extended.
pub(super) fn read(store: &Path, name: &str) -> Read {
    let text = fs::read_to_string(store.join(name).join("zarr.json")).unwrap();
    let metadata: Value = serde_json::from_str(&text).unwrap();
    let extents = |list: &Value| -> Vec<usize> {
        list.as_array().unwrap().iter().map(|extent| extent.as_u64().unwrap() as usize).collect()
    };
    let shape = extents(&metadata["shape"]);
    let chunk = extents(&metadata["chunk_grid"]["configuration"]["chunk_shape"]);
    let size = if metadata["data_type"] == "int8" { 1 } else { 8 };
    let element = |mut number: usize| {
        let (mut key, mut offset, mut stride) = (String::new(), 0, size);
        for (extent, chunk) in shape.iter().zip(&chunk).rev() {
            let i = number % extent;
            number /= extent;
            key = format!(".{}{key}", i / chunk);
            offset += i % chunk * stride;
            stride *= chunk;
        }
        let bytes = fs::read(store.join(name).join(format!("c{key}"))).unwrap();
        assert_eq!(bytes.len(), stride, "{name}/c{key} is no whole chunk");
        let mut element = [0; 8];
        element[..size].copy_from_slice(&bytes[offset..offset + size]);
        element
    };
    let elements = (0..shape.iter().product()).map(element).collect();
    Read { shape, chunk, elements }
}

/// Adds a member.
pub(super) fn add(store: &mut SnapshotStore, status: Status, snapshots: &[Snapshot]) {
    snapshots.iter().for_each(|snapshot| store.snapshot(snapshot).unwrap());
    store.member(status).unwrap();
}

/// The store of these members, in chunks of at most `bytes`.
pub(super) fn stored(
    home: &Path,
    spec: &Spec,
    members: &[(Status, Vec<Snapshot>)],
    bytes: usize,
) -> std::path::PathBuf {
    let out = OutputFolder::open(home, true).unwrap();
    let points = members.iter().flat_map(|(_, snapshots)| snapshots).map(|s| s.x.len()).max().unwrap();
    let folder = out.store(names::STORE).unwrap();
    let mut store = SnapshotStore::of_chunks(folder, spec, points, spec.snapshots.clone(), bytes).unwrap();
    members.iter().for_each(|(status, snapshots)| add(&mut store, *status, snapshots));
    let run = out.write(names::RUN, "{}").unwrap();
    out.publish(Vec::new(), Some(store.ready().unwrap()), run).unwrap();
    home.join(names::STORE)
}

pub(super) fn spec(curves: u64, snapshots: &[f64]) -> Spec {
    Spec { curves, snapshots: snapshots.into(), store: Store::Zarr, ..Spec::default() }
}

/// Seven different members of five nodes; the fourth ends before the last of three times.
pub(super) fn members() -> Vec<(Status, Vec<Snapshot>)> {
    let node = |member: u64, t: f64, field: f64| -> Vec<f64> {
        (1..=5).map(|i| 1000.0 * field + 100.0 * member as f64 + 10.0 * t + f64::from(i)).collect()
    };
    let snapshot = |member: u64, t: f64| {
        let [x, y, k, r] = [1.0, 2.0, 3.0, 4.0].map(|field| node(member, t, field));
        Snapshot { member, t, x, y, k, r }
    };
    let member = |member| match member {
        3 => (Status::Stalled, vec![snapshot(3, 0.0), snapshot(3, 1.0)]),
        _ => (Status::Relaxed, [0.0, 1.0, 2.0].map(|t| snapshot(member, t)).into()),
    };
    (0..7).map(member).collect()
}

fn expected(members: &[(Status, Vec<Snapshot>)], of: fn(&Snapshot) -> &Vec<f64>) -> Vec<u64> {
    let mut all = Vec::new();
    for (_, snapshots) in members {
        for t in [0.0, 1.0, 2.0] {
            match snapshots.iter().find(|snapshot| snapshot.t == t) {
                Some(snapshot) => all.extend(of(snapshot).iter().map(|value| value.to_bits())),
                None => all.extend([f64::NAN.to_bits(); 5]),
            }
        }
    }
    all
}

#[test]
fn every_element_is_where_the_metadata_say_however_the_arrays_are_cut() {
    let (spec, members) = (spec(7, &[0.0, 1.0, 2.0]), members());
    for (bytes, chunk) in [
        (1 << 20, [7, 3, 5]),
        (360, [3, 3, 5]), // three members in a chunk, one in the last
        (120, [1, 3, 5]),
        (80, [1, 2, 5]), // times are cut
        (24, [1, 1, 3]), // nodes are
        (8, [1, 1, 1]),
    ] {
        let home = tempfile::tempdir().unwrap();
        let store = stored(home.path(), &spec, &members, bytes);
        let x = read(&store, "x");
        assert_eq!((&x.shape[..], &x.chunk[..]), (&[7, 3, 5][..], &chunk[..]));
        assert_eq!(x.floats(), expected(&members, |snapshot| &snapshot.x), "chunks of {bytes} bytes");
        assert_eq!(read(&store, "y").floats(), expected(&members, |snapshot| &snapshot.y));
        assert_eq!(read(&store, "k").floats(), expected(&members, |snapshot| &snapshot.k));
        assert_eq!(read(&store, "r").floats(), expected(&members, |snapshot| &snapshot.r));
        assert_eq!(read(&store, "member").whole(), [0, 1, 2, 3, 4, 5, 6]);
        assert_eq!(read(&store, "node").whole(), [1, 2, 3, 4, 5]);
        assert_eq!(read(&store, "time").floats(), [0.0, 1.0, 2.0].map(f64::to_bits));
        let codes = read(&store, "status").elements.iter().map(|element| element[0]).collect::<Vec<_>>();
        assert_eq!(codes, [1, 1, 1, 5, 1, 1, 1]);
        let chunks = fs::read_dir(store.join("x")).unwrap().count() - 1;
        assert_eq!(chunks, 7_usize.div_ceil(chunk[0]) * 3_usize.div_ceil(chunk[1]) * 5_usize.div_ceil(chunk[2]));

        // Members in another order are detected, and so is a chunk with another one's bytes.
        let mut other = members.clone();
        other.swap(1, 2);
        assert_ne!(x.floats(), expected(&other, |snapshot| &snapshot.x));
        if chunk[0] == 3 {
            fs::copy(store.join("x/c.1.0.0"), store.join("x/c.0.0.0")).unwrap();
            assert_ne!(read(&store, "x").floats(), x.floats());
        }
    }
}

#[test]
fn unknown_is_nan_and_padding_is_never_in_the_array() {
    let home = tempfile::tempdir().unwrap();
    let (spec, mut members) = (spec(7, &[0.0, 1.0, 2.0]), members());
    members[6].1[2].k[4] = f64::INFINITY;
    let store = stored(home.path(), &spec, &members, 360);
    let unknown = |name| -> Vec<usize> {
        let elements = read(&store, name).floats();
        (0..elements.len()).filter(|i| elements[*i] == f64::NAN.to_bits()).collect()
    };
    let lost: Vec<usize> = (3 * 15 + 10..3 * 15 + 15).collect();
    assert_eq!(unknown("x"), lost);
    assert_eq!(unknown("k"), [lost, vec![6 * 15 + 14]].concat());
    let last = fs::read(store.join("x/c.2.0.0")).unwrap();
    assert!(last.chunks(8).skip(15).all(|element| element == f64::NAN.to_le_bytes()));
}

#[test]
fn a_run_leaves_the_same_bits_as_in_its_table() {
    let spec = Spec {
        points: 33,
        t_end: Some(0.3.into()),
        relax_to: Some(0.2),
        stop_when_relaxed: Some(true),
        only: Some(vec![1, 2, 5, 7, 8]),
        solver: Solver::Direct.into(),
        ..spec(11, &[0.0, 0.0123, 0.1, 0.3])
    };
    let spec = spec.validate().unwrap();
    let family = Family::new(&spec).unwrap();
    let direct = Method::coloured(Solver::Direct, 1);
    let mut backend = CpuBackend::<f64>::new(Blocks::new(33).unwrap(), direct, 1).unwrap();
    let mut members: Vec<Ended> = Vec::new();
    let backend: &mut dyn Backend = &mut backend;
    simulate(&[Cell::only(spec.clone(), family)], Precision::F64, backend, 0, &mut members).unwrap();
    let members: Vec<_> = members.into_iter().map(|ended| (ended.outcome.status, ended.rows.snapshots)).collect();

    let home = tempfile::tempdir().unwrap();
    let store = stored(home.path(), &spec, &members, 2 * 4 * 33 * 8);
    let [member, node] = ["member", "node"].map(|name| read(&store, name).whole());
    assert_eq!(member, [1, 2, 5, 7, 8]);
    let time: Vec<f64> = read(&store, "time").floats().into_iter().map(f64::from_bits).collect();
    let fields = ["x", "y", "k", "r"].map(|name| read(&store, name));
    assert_eq!(fields[0].chunk, [2, 4, 33]);
    let mut rows = Vec::new();
    for number in 0..fields[0].elements.len() {
        let values = fields.each_ref().map(|field| f64::from_le_bytes(field.elements[number]));
        if !values[0].is_nan() {
            let (member, t, i) = (member[number / 132], time[number / 33 % 4], node[number % 33]);
            let [x, y, k, r] = values;
            rows.push(format!("{member},{t:?},{i},{x:?},{y:?},{k:?},{r:?}"));
        }
    }

    let elsewhere = tempfile::tempdir().unwrap();
    let out = OutputFolder::open(elsewhere.path(), true).unwrap();
    let mut table = Table::new::<NodeRow>(out.file("snapshots.csv").unwrap()).unwrap();
    let rows_of = |own: &Snapshot| NodeRow::of(own).try_for_each(|row| table.row(&row)).unwrap();
    members.iter().flat_map(|(_, snapshots)| snapshots).for_each(rows_of);
    let text = fs::read_to_string(table.ready().unwrap().part().at()).unwrap();
    let lines: Vec<&str> = text.lines().skip(1).collect();
    assert!(rows.len() < 5 * 4 * 33 && rows.len() > 2 * 4 * 33, "{} rows: some, not all, end early", rows.len());
    assert_eq!(rows, lines);
}
