//! Snapshots that a run has passed on, as arrays.

use curvelax::ensemble::Snapshot;
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

/// Bytes above which none are kept in memory: they are on disk.
const MOST: usize = 512 << 20;

/// The snapshots of a run, member by member.
#[pyclass(frozen)]
#[derive(Default)]
pub struct SnapshotBuffer {
    all: Vec<Snapshot>,
    bytes: usize,
}

impl SnapshotBuffer {
    /// Adds snapshots, unless there are too many.
    pub fn add(&mut self, snapshots: &[Snapshot]) {
        self.bytes += snapshots.iter().map(|one| 4 * size_of_val(&*one.x)).sum::<usize>();
        if self.bytes > MOST {
            self.all = Vec::new();
        } else {
            self.all.extend_from_slice(snapshots);
        }
    }
}

#[pymethods]
impl SnapshotBuffer {
    /// The fields x, y, k and r of the `members` at the `times`, as arrays of member × time × node, NaN where there is
    /// no snapshot; or `None` if the snapshots were too many for memory.
    fn arrays<'py>(
        &self,
        py: Python<'py>,
        members: Vec<u64>,
        times: Vec<f64>,
    ) -> PyResult<Option<[Bound<'py, PyArray3<f64>>; 4]>> {
        // Cells of a sweep may differ in nodes.
        let Some(nodes) = self.all.iter().map(|one| one.x.len()).max().filter(|_| self.bytes <= MOST) else {
            return Ok(None);
        };
        let [a, b, c, d]: [fn(&Snapshot) -> &[f64]; 4] = [|of| &of.x, |of| &of.y, |of| &of.k, |of| &of.r];
        let array = |field: fn(&Snapshot) -> &[f64]| -> PyResult<_> {
            let mut all = vec![f64::NAN; members.len() * times.len() * nodes];
            for one in &self.all {
                let place = members.binary_search(&one.member).ok();
                if let Some((member, time)) = place.zip(times.iter().position(|t| *t == one.t)) {
                    let from = (member * times.len() + time) * nodes;
                    all[from..from + one.x.len()].copy_from_slice(field(one));
                }
            }
            PyArray1::from_vec(py, all).reshape([members.len(), times.len(), nodes])
        };
        Ok(Some([array(a)?, array(b)?, array(c)?, array(d)?]))
    }
}
