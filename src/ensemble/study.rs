//! A study: the cells of a spec, each an ensemble of its own, whose members run side by side.

use std::ops::Range;

use super::{
    Family, Member, Spec,
    spec::{Pace, Store},
};
use crate::{
    error::{Error, Result},
    solver::{Order, Solver},
};

/// One ensemble of a study.
pub struct Cell {
    /// Index of the cell, from 0.
    pub index: u64,
    /// Its spec, without a sweep.
    pub spec: Spec,
    /// Its curves.
    pub family: Family,
    /// Members of the cells before it.
    first: u64,
    /// Member j of every cell is drawn from the same random numbers.
    common: bool,
}

/// What members must have in common to be advanced side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Company {
    points: usize,
    solver: Solver,
    order: Order,
    adaptive: bool,
}

impl Cell {
    /// The only cell of a spec without a sweep.
    ///
    /// ```
    /// use curvelax::ensemble::{Cell, Family, Spec};
    ///
    /// let spec = Spec { curves: 3, ..Spec::default() }.validate()?;
    /// let family = Family::new(&spec)?;
    /// assert_eq!(Cell::only(spec, family).members().collect::<Vec<_>>(), [0, 1, 2]);
    /// # Ok::<(), curvelax::Error>(())
    /// ```
    pub fn only(spec: Spec, family: Family) -> Cell {
        Cell { index: 0, spec, family, first: 0, common: false }
    }

    /// The members to run: the index of each in the study.
    pub fn members(&self) -> impl Iterator<Item = u64> + '_ {
        self.spec.members().map(|member| self.first + member)
    }

    /// Makes the member with this index in the study.
    ///
    /// # Errors
    /// As [`Family::member`].
    pub fn member(&self, index: u64) -> Result<Member> {
        let drawn = if self.common { index - self.first } else { index };
        Ok(Member { index, cell: self.index, ..self.family.member(drawn)? })
    }

    /// What it must have in common with others to run beside them.
    pub fn company(&self) -> Company {
        let Spec { points, order, .. } = self.spec;
        let adaptive = matches!(self.spec.pace(), Pace::Adaptive(_));
        Company { points, solver: self.spec.solver(), order, adaptive }
    }
}

/// All cells of `spec`, checked; one if nothing is swept.
///
/// # Errors
/// [`Error::Request`] for a value that is out of range, with the cell that has it, and for curves of unequal numbers of
/// nodes that are to share an array.
pub fn cells(spec: &Spec) -> Result<Vec<Cell>> {
    let cell = |index: u64| -> Result<Cell> {
        let first = index * spec.curves;
        let of_cell = |member: &u64| (first..first + spec.curves).contains(member);
        let only = spec.only.as_ref().map(|only| only.iter().filter(|m| of_cell(m)).map(|m| m - first).collect());
        let own = Spec { only: None, ..spec.sweep.apply(spec, index)? }.validate()?;
        let family = Family::new(&own)?;
        // A file's own points are a number that no check has seen.
        let own = Spec { points: family.points(), ..own }.validate()?;
        Ok(Cell { index, spec: Spec { only, ..own }, family, first, common: spec.common_random_numbers })
    };
    let name = |index, error| match error {
        Error::Request(message) if !spec.sweep.is_empty() => {
            Error::Request(format!("{message} (in the cell {})", spec.sweep.name(index)))
        }
        error => error,
    };
    let cells = (0..spec.sweep.cells()).map(|index| cell(index).map_err(|error| name(index, error)));
    let cells = cells.collect::<Result<Vec<_>>>()?;
    let unequal = cells.windows(2).find(|pair| pair[0].spec.points != pair[1].spec.points);
    if let (Store::Zarr, Some([one, other])) = (spec.store, unequal) {
        let [(one, own), (other, others)] = [one, other].map(|cell| (spec.sweep.name(cell.index), cell.spec.points));
        let problem = format!("an array has as many nodes for all members: {own} in {one}, {others} in {other}");
        return Err(Error::value("store", "zarr", &problem, "take --store csv, or one number of --points"));
    }
    Ok(cells)
}

/// Ranges of cells whose members run side by side, in order.
pub fn companies(cells: &[Cell]) -> Vec<Range<usize>> {
    let mut companies: Vec<Range<usize>> = Vec::new();
    for (i, cell) in cells.iter().enumerate() {
        match companies.last_mut() {
            Some(range) if cells[range.start].company() == cell.company() => range.end = i + 1,
            _ => companies.push(i..i + 1),
        }
    }
    companies
}
