//! What distinguishes the cells of a sweep, and how pictures show it: names, colours, dashes and panels.

use std::cmp::Reverse;

use super::FinishedRun;
use curvelax_draw::{
    chart::{Entry, LegendMark},
    charts::{CellKey, Crossed},
    style::SERIES,
};
use curvelax_ensemble::request::sweep::SweepAxis;

/// The cells of one panel, and its name.
pub(super) struct CellGroup {
    pub name: String,
    pub cells: Vec<usize>,
}

impl FinishedRun<'_> {
    /// The swept keys with more than one value, with their places among all: only these tell cells apart.
    pub(super) fn varied(&self) -> Vec<(usize, &SweepAxis)> {
        let axes = self.spec().sweep.axes().iter().enumerate();
        axes.filter(|(_, axis)| axis.values.len() > 1).collect()
    }

    /// Names of these keys.
    pub(super) fn keys(&self) -> String {
        self.varied().iter().map(|(_, axis)| axis.key.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The name of a cell in a legend.
    pub(super) fn label(&self, cell: u64) -> String {
        let (varied, labels) = (self.varied(), self.spec().sweep.labels(cell));
        let named = |(i, axis): &(usize, &SweepAxis)| format!("{} = {}", axis.key, labels[*i]);
        match varied.is_empty() {
            true => "all members".into(),
            false => varied.iter().map(named).collect::<Vec<_>>().join(", "),
        }
    }

    /// The values of a cell next to [`FinishedRun::keys`]; empty without a sweep.
    pub(super) fn short_label(&self, cell: u64) -> String {
        let labels = self.spec().sweep.labels(cell);
        self.varied().iter().map(|(i, _)| labels[*i].as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The swept key with numeric values that colours show if there are many cells: the one with most values.
    fn colour_axis(&self) -> Option<(usize, &SweepAxis)> {
        let axes = self.varied().into_iter().filter(|(_, axis)| axis.numbers().is_some());
        axes.max_by_key(|(i, axis)| (axis.values.len(), Reverse(*i)))
    }

    /// Its values, cell by cell.
    fn numbers(&self) -> Option<Vec<f64>> {
        let (place, _) = self.colour_axis()?;
        let cells = self.statistics.cells.iter();
        cells.map(|cell| cell.values.get(place)?.parse().ok()).collect()
    }

    /// The places of two keys among all, if there are two: the one of colours, and that of dashes or panels.
    pub(super) fn two_axes(&self) -> Option<[usize; 2]> {
        let [(first, _), (last, _)] = self.varied()[..] else { return None };
        let colour = self.colour_axis().map_or(last, |(place, _)| place);
        Some([colour, if colour == first { last } else { first }])
    }

    /// Two keys of which colours show one.
    fn crossed(&self) -> Option<Crossed> {
        let axes = self.two_axes()?.map(|place| (place, &self.spec().sweep.axes()[place]));
        let labels = axes.map(|(_, axis)| axis.labels());
        let [colours, patterns] =
            [0, 1].map(|i| labels[i].iter().map(|label| format!("{} = {label}", axes[i].1.key)).collect::<Vec<_>>());
        let place = |values: &[String], i: usize| labels[i].iter().position(|label| *label == values[axes[i].0]);
        let of_cell = |values: &[String]| Some((place(values, 0)?, place(values, 1)?));
        let places = self.statistics.cells.iter().map(|cell| of_cell(&cell.values)).collect::<Option<_>>()?;
        Some(Crossed { colours, patterns, places })
    }

    /// What distinguishes the cells in a chart; `on_page` if a page may have a legend of them.
    pub(super) fn cell_key(&self, on_page: bool) -> CellKey {
        let name = self.colour_axis().map_or(self.keys(), |(_, axis)| axis.key.clone());
        let of_each = |name: &dyn Fn(u64) -> String| self.statistics.cells.iter().map(|cell| name(cell.cell)).collect();
        CellKey {
            name,
            crossed: self.crossed(),
            labels: of_each(&|cell| self.label(cell)),
            names: of_each(&|cell| self.short_label(cell)),
            values: self.numbers(),
            named_elsewhere: on_page && !self.legend().is_empty(),
        }
    }

    /// The legend of the cells for all charts of a page; empty if there is one cell, or a colour bar.
    pub(super) fn legend(&self) -> Vec<Entry> {
        let cells = self.statistics.cells.len();
        if let Some(crossed) = self.crossed() {
            return crossed.entries();
        }
        if !(2..=SERIES).contains(&cells) {
            return Vec::new();
        }
        (0..cells).map(|i| Entry::new(&format!("s{i}"), LegendMark::Series, &self.label(i as u64))).collect()
    }

    /// The cells whose members are seen side by side: a cloud of several flows or shapes would mean nothing.
    pub(super) fn panel_groups(&self) -> Vec<CellGroup> {
        let cells = self.statistics.cells.len();
        if let Some(Crossed { patterns, places, .. }) = self.crossed() {
            let of = |pattern: usize| (0..cells).filter(|cell| places[*cell].1 == pattern).collect();
            return patterns.into_iter().enumerate().map(|(i, name)| CellGroup { name, cells: of(i) }).collect();
        }
        match self.numbers().is_none() && cells > 1 {
            true => (0..cells).map(|cell| CellGroup { name: self.label(cell as u64), cells: vec![cell] }).collect(),
            false => vec![CellGroup { name: String::new(), cells: (0..cells).collect() }],
        }
    }
}
