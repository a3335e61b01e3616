//! The outlines of a request: those of the files that its shapes name, read once for all cells.

use std::{path::Path, sync::Arc};

use crate::request::spec::DEFAULT_ROUNDING;
use crate::{Drawn, Spec, member::OutlineSet};
use curvelax_base::{
    error::{Error, Result, echo, shortened},
    text::{count, number},
};
use curvelax_curve::{Sampling, Shape, outlines::Labelled};

/// The outlines of the shapes of a spec that are read from files.
#[derive(Clone, Default)]
pub struct Outlines {
    sets: Vec<(Shape, Arc<OutlineSet>)>,
    /// There are shapes that are not.
    has_formulas: bool,
}

impl Outlines {
    /// Those of `spec` and its sweep: from `known` if it has them, and otherwise read from files, whose paths are
    /// relative to the directory `base`.
    ///
    /// # Errors
    /// [`Error::Request`] for everything that [`Shape::outlines_from`] refuses.
    pub(crate) fn read(spec: &Spec, base: &Path, known: &Outlines) -> Result<Outlines> {
        let swept = spec.sweep.axis("shape").into_iter().flat_map(|axis| &axis.values);
        // Other values are refused with their cell, later.
        let swept: Vec<Drawn<Shape>> = swept.filter_map(|value| value.as_str()?.parse().ok()).collect();
        let shapes = if swept.is_empty() { vec![&spec.shape] } else { swept.iter().collect() };
        let mut outlines = Outlines::default();
        for shape in shapes.into_iter().map(Drawn::typical) {
            if outlines.of(shape).is_some() {
                continue;
            }
            if let Some(set) = known.of(shape) {
                outlines.sets.push((shape.clone(), Arc::clone(set)));
                continue;
            }
            let Some(read) = shape.outlines_from(base) else {
                outlines.has_formulas = true;
                continue;
            };
            let set = read.and_then(OutlineSet::new).map_err(|error| {
                let cell = (0..spec.sweep.cells()).find(|cell| has_shape(spec, *cell, shape)).unwrap_or(0);
                spec.sweep.in_cell(error, cell)
            })?;
            outlines.sets.push((shape.clone(), set.into()));
        }
        Ok(outlines)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.sets.is_empty()
    }

    /// All of them, shape by shape.
    pub fn all(&self) -> impl Iterator<Item = &Labelled> {
        self.sets.iter().flat_map(|(_, set)| &set.all)
    }

    /// The text of each shape with its outlines.
    pub fn saved(&self) -> Vec<(String, &[Labelled])> {
        self.sets.iter().map(|(shape, set)| (shape.to_string(), &set.all[..])).collect()
    }

    /// Those that were saved as this; `None` if they cannot be outlines.
    pub fn restored(saved: Vec<(String, Vec<Labelled>)>) -> Option<Outlines> {
        let set = |(shape, all): (String, Vec<Labelled>)| {
            let all = Some(all).filter(|all| all.iter().all(|one| one.outline.is_possible()))?;
            Some((shape.parse().ok()?, OutlineSet::new(all).ok()?.into()))
        };
        Some(Outlines { sets: saved.into_iter().map(set).collect::<Option<_>>()?, has_formulas: false })
    }

    /// Those of a shape, if it is read from files.
    pub(crate) fn of(&self, shape: &Shape) -> Option<&Arc<OutlineSet>> {
        self.sets.iter().find(|(known, _)| known == shape).map(|(_, set)| set)
    }

    /// `spec` with their number, if they are an ensemble, and with what follows from it: where the request says nothing
    /// else, one copy of each, as it is.
    ///
    /// # Errors
    /// [`Error::Request`] for cells with unequal numbers of outlines, for another number than `spec` has, and for keys
    /// that mean nothing with outlines, or only with them.
    pub(crate) fn settle(&self, mut spec: Spec) -> Result<Spec> {
        self.settle_curves(&mut spec)?;
        let several = |(shape, set): &&(Shape, Arc<OutlineSet>)| matches!(shape, Shape::Files(_)) || set.all.len() > 1;
        let Some((first, set)) = self.sets.iter().find(several) else {
            if let Some(asked) = spec.outlines.filter(|asked| *asked != 1) {
                let problem = format!("the shape {} is one curve", echo(&spec.shape));
                return Err(Error::value(
                    "outlines",
                    asked,
                    &problem,
                    "leave it out, or give the file of the outlines",
                ));
            }
            return spec.group_by.is_none().then_some(spec).ok_or_else(|| {
                let problem = "--group-by groups the outlines of a file by a property, and the shape is one curve";
                Error::Request(format!("{problem}; leave it out"))
            });
        };
        let found = set.all.len() as u64;
        if let Some((other, others)) = self.sets.iter().find(|(_, others)| others.all.len() as u64 != found) {
            let (found, others) = (count(found, "outline"), count(others.all.len() as u64, "outline"));
            return Err(Error::Request(format!(
                "--sweep shape: cells have as many members each, and {first} has {found}, {other} {others}; read all with \
                 one pattern, such as files:DIR/*.csv, and use --group-by file"
            )));
        }
        if let Some(asked) = spec.outlines.filter(|asked| *asked != found) {
            let problem = format!("{first} has {}", count(found, "outline"));
            return Err(Error::value("outlines", asked, &problem, "restore the files, or leave --outlines out"));
        }
        if self.has_formulas {
            let problem =
                format!("a sweep has {first}, with {}, and a shape that is one curve", count(found, "outline"));
            return Err(Error::Request(format!("--sweep shape: {problem}; run them apart")));
        }
        if let Some(property) = &spec.group_by {
            self.sets.iter().try_for_each(|(_, set)| check_property(property, &set.all))?;
        }
        spec.outlines = Some(found);
        if spec.omitted.curves {
            spec.curves = 1;
            if spec.omitted.amplitude && !spec.sweep.has("amplitude") {
                spec.amplitude = 0.0.into();
            }
        }
        Ok(spec)
    }
}

impl Outlines {
    /// Fills in how outlines become curves, where there are any.
    ///
    /// # Errors
    /// [`Error::Request`] for such a key where there are none, or where their points are the nodes.
    fn settle_curves(&self, spec: &mut Spec) -> Result<()> {
        let interpolate = spec.interpolate.map(|how| how.name().to_owned());
        let given = [("interpolate", interpolate), ("rounding", spec.rounding.map(number))];
        let swept = |key: &str| spec.sweep.has(key).then(|| "(swept)".to_owned());
        let mut given = given.into_iter().filter_map(|(key, value)| Some((key, value.or_else(|| swept(key))?)));
        let are_nodes = spec.sampling == Sampling::Points && !spec.sweep.has("sampling");
        match given.next() {
            Some((key, value)) if self.sets.is_empty() => {
                let problem =
                    format!("the shape {} is a formula, without points or corners to round", echo(&spec.shape));
                return Err(Error::value(key, value, &problem, "leave it out, or give an outline"));
            }
            Some((key, value)) if are_nodes => {
                let problem = "with --sampling points the nodes are the points, as they are";
                return Err(Error::value(key, value, problem, "leave it out, or use --sampling arclength"));
            }
            _ if self.sets.is_empty() || are_nodes => return Ok(()),
            _ => {}
        }
        if !spec.sweep.has("interpolate") {
            spec.interpolate.get_or_insert_default();
        }
        if !spec.sweep.has("rounding") {
            spec.rounding.get_or_insert(DEFAULT_ROUNDING);
        }
        Ok(())
    }
}

/// Whether a cell has this shape.
fn has_shape(spec: &Spec, cell: u64, shape: &Shape) -> bool {
    let text = shape.to_string();
    spec.sweep.values(cell).into_iter().any(|value| value.as_str() == Some(&text))
}

/// Checks that some outline has `property`.
fn check_property(property: &str, all: &[Labelled]) -> Result<()> {
    if all.iter().any(|one| one.property(property).is_some()) {
        return Ok(());
    }
    let mut known: Vec<&str> = all.iter().flat_map(|one| one.properties.keys()).map(String::as_str).collect();
    known.sort_unstable();
    known.dedup();
    known.push(Labelled::FILE);
    let remedy = format!("they have {}", shortened(&known.join(", "), 500));
    Err(Error::value("group-by", property, "no outline has such a property", &remedy))
}
