//! A study: the cells of a spec, each an ensemble whose members run side by side.

mod level_sink;
mod stage;

pub use level_sink::LevelSink;
pub use stage::{Cohort, Stage};

use std::{borrow::Cow, path::Path};

use crate::{
    Family, LevelTimes, Member, Outcome, Outlines, RefinementLevel, Spec, Variation,
    request::spec::{FinalTime, OrAuto, Store},
    theory::times,
};
use curvelax_base::error::{Error, Result};
use curvelax_curve::{BaseCurve, Sampler, Sampling};

/// Members of a study that leave a [portrait](crate::Portrait): the first ones of its cells.
pub const PORTRAITS: usize = 12;

/// A checked spec: its cells, each with its curves. Everything that runs a spec needs a `Study`.
pub struct Study {
    spec: Spec,
    cells: Vec<Cell>,
    stages: Vec<Stage>,
    outlines: Outlines,
    /// Flags by which times follow the size of the curves, although the request does not have them.
    by_size: Vec<&'static str>,
}

impl Study {
    /// Checks everything about `spec` that does not depend on the machine, and makes the curves of its cells.
    ///
    /// ```
    /// use curvelax_ensemble::{Spec, Study};
    ///
    /// let study = Study::new(Spec { curves: 3, ..Spec::default() })?;
    /// assert_eq!(study.cells()[0].members().collect::<Vec<_>>(), [0, 1, 2]);
    /// # Ok::<(), curvelax_base::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Request`] for a value out of range, naming its cell; for curves with different numbers of nodes that
    /// would share an array; and for more curves than fit into memory.
    pub fn new(spec: Spec) -> Result<Study> {
        Study::new_from(spec, Path::new(""), &Outlines::default())
    }

    /// Does the same as [`Study::new`], with the outlines that are `known`; other paths in the spec are relative to the
    /// directory `base`.
    ///
    /// # Errors
    /// As [`Study::new`].
    pub fn new_from(spec: Spec, base: &Path, known: &Outlines) -> Result<Study> {
        let outlines = Outlines::read(&spec, base, known)?;
        let spec = outlines.settle(spec)?;
        let (free, given) = (spec.gives_no_times(), spec.clone());
        let spec = spec.validate()?;
        let cells = cells(&spec, &outlines)?;
        if !free || !cells.iter().any(|cell| times::is_far(&cell.spec, cell.family.scales())) {
            return Ok(Study { outlines, ..Study::of_cells(spec, cells)? });
        }
        let tau = if spec.adaptive.is_some() { None } else { Some(OrAuto::Auto) };
        let own = Spec { tau, t_end: Some(FinalTime::Auto), omega: None, ..spec }.validate()?;
        drop(cells);
        let cells = self::cells(&own, &outlines)?;
        let chosen = [("--tau auto", own.tau != given.tau), ("--t-end auto", given.t_end.is_none())];
        let by_size = chosen.into_iter().filter_map(|(flag, is_new)| is_new.then_some(flag)).collect();
        Ok(Study { outlines, by_size, ..Study::of_cells(own, cells)? })
    }

    /// Does the same as [`Study::new`], with members that are perturbations of `curve` instead of the shape of `spec`.
    ///
    /// # Errors
    /// As [`Study::new`], and for a spec that sweeps.
    pub fn of_curve(spec: Spec, curve: BaseCurve) -> Result<Study> {
        let spec = spec.validate()?;
        if !spec.sweep.is_empty() {
            let (problem, remedy) = ("one curve has no cells", "make a study for each value");
            return Err(Error::value("sweep", spec.sweep.axes().len(), problem, remedy));
        }
        let family = Family::of(&spec, curve)?;
        let own = Spec { points: family.points(), ..spec.clone() }.validate()?;
        Study::of_cells(spec, vec![Cell::only(own, family)])
    }

    /// The request.
    pub fn spec(&self) -> &Spec {
        &self.spec
    }

    /// Its cells; one if nothing is swept.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// The outlines of its shapes that are read from files.
    pub fn outlines(&self) -> &Outlines {
        &self.outlines
    }

    /// Its stages, in the order in which they run: the levels, and then its own members.
    pub fn stages(&self) -> &[Stage] {
        &self.stages
    }

    /// The cells of a stage. Those of a [selective](Stage::is_selective) one have the members that need it by the times
    /// at the `levels` before, and there is none without such a member.
    ///
    /// # Errors
    /// As [`Study::new`].
    pub fn cells_of(&self, stage: &Stage, levels: &LevelTimes) -> Result<Cow<'_, [Cell]>> {
        let own = &self.cells[stage.range.clone()];
        let Some(level) = stage.level else { return Ok(Cow::Borrowed(own)) };
        let mut cells: Vec<Cell> = Vec::new();
        for cell in own {
            let Ok(mut spec) = cell.at(level) else { continue };
            if level.is_selective() {
                let only: Vec<u64> = cell.needing(level, levels).map(|member| member - cell.first).collect();
                if only.is_empty() {
                    continue;
                }
                spec.only = Some(only);
            }
            // The cell itself has no variation; the others here have the same one.
            let own = level.variation().is_none().then_some(cell);
            let others = || own.into_iter().chain(cells.iter().rev());
            let family = match others().find(|other| same_curve(&other.spec, &spec)) {
                Some(other) => Family::like(&other.family, &spec)?,
                None => Family::resampled(&cell.family, &spec, level.variation())?,
            };
            cells.push(Cell { spec, family, ..*cell });
        }
        Ok(Cow::Owned(cells))
    }

    /// The members of a stage, after these times at the `levels` before it.
    pub fn members_of(&self, stage: &Stage, levels: &LevelTimes) -> u64 {
        let Some(level) = stage.level.filter(|_| stage.is_selective()) else { return stage.members };
        let cells = self.cells[stage.range.clone()].iter().filter(|cell| cell.at(level).is_ok());
        cells.map(|cell| cell.needing(level, levels).count() as u64).sum()
    }

    /// The first stage of its own members.
    pub fn own_stage(&self) -> usize {
        self.stages.iter().take_while(|stage| stage.level.is_some()).count()
    }

    /// Whether the levels are those of a few members.
    pub fn has_pilot(&self) -> bool {
        !self.spec.refine
    }

    /// The spec of the first cell of a stage.
    ///
    /// # Errors
    /// Does not fail for a stage of this study.
    pub fn spec_of(&self, stage: &Stage) -> Result<Spec> {
        let cells = &self.cells[stage.range.clone()];
        let spec = |cell: &Cell| stage.level.map_or_else(|| Ok(cell.spec.clone()), |level| cell.at(level));
        let none = || Error::Failed("a stage has no cell".into());
        cells.iter().map(spec).find(Result::is_ok).ok_or_else(none)?
    }

    /// Members of all stages but the finer ones, which are not known in advance.
    pub fn work(&self) -> u64 {
        self.stages.iter().filter(|stage| !stage.is_selective()).map(|stage| stage.members).sum()
    }

    /// Members that may run on variations of their outlines, each once for every variation.
    pub fn varied_members(&self) -> f64 {
        let of = |cell: &Cell| cell.family.variations() * cell.spec.member_count() as f64;
        if self.spec.refine { self.cells.iter().map(of).sum() } else { 0.0 }
    }

    /// Nodes of the finest level at which members may run, or of the members themselves if these have more.
    pub fn most_points(&self) -> usize {
        let points = |cell: &Cell| cell.levels().into_iter().map(|level| level.points(cell.spec.points)).max();
        self.cells.iter().filter_map(points).max().unwrap_or(0)
    }

    /// Nodes of a member; meaningful only if all have the same number.
    pub fn points(&self) -> usize {
        self.cells[0].spec.points
    }

    /// Members of a stage that leave a portrait: the [`PORTRAITS`] of the study, spread over all cells; none of a
    /// level.
    pub fn portraits(&self, stage: &Stage) -> usize {
        match stage.level {
            Some(_) => 0,
            None => (PORTRAITS * stage.range.len()).div_ceil(self.cells.len()),
        }
    }

    /// Members to run, over all cells.
    pub fn member_count(&self) -> u64 {
        self.spec.member_count()
    }

    /// What the user should know before the run, each sentence once.
    pub fn warnings(&self) -> Vec<String> {
        let mut all: Vec<String> = self.cells.iter().flat_map(Cell::warnings).collect();
        all.sort();
        all.dedup();
        all
    }

    /// What was chosen because the request says nothing about it, if anything.
    pub fn note(&self) -> Option<String> {
        let problem = "the default times are for curves of about unit size, and one here is far smaller or larger";
        (!self.by_size.is_empty()).then(|| format!("{problem}: used {}", self.by_size.join(" ")))
    }

    /// Brings the spec up to date with the cells: it is that of the only cell, such as the number of points of a file,
    /// or gets by `common` what all cells have in common.
    pub fn settle_spec(&mut self, common: impl Fn(&mut Spec)) {
        if self.spec.sweep.is_empty() {
            let Spec { only, shard, .. } = self.spec.clone();
            self.spec = Spec { only, shard, ..self.cells[0].spec.clone() };
        } else {
            common(&mut self.spec);
        }
    }

    /// Its cells, mutable.
    pub fn cells_mut(&mut self) -> &mut [Cell] {
        &mut self.cells
    }

    /// # Errors
    /// [`Error::Request`] for times and rates that do not suit the curve of a cell.
    fn of_cells(mut spec: Spec, mut cells: Vec<Cell>) -> Result<Study> {
        if !spec.design.is_random() && !cells.iter().any(|cell| cell.spec.has_drawn_values()) {
            let (problem, remedy) = ("nothing is drawn that it could spread", "write a distribution for a number");
            let remedy = format!("{remedy}, such as --amplitude 'uniform(0.01..0.1)', or leave it out");
            return Err(Error::value("design", spec.design.name(), problem, &remedy));
        }
        for cell in &mut cells {
            cell.settle().map_err(|error| spec.sweep.in_cell(error, cell.index))?;
        }
        if spec.t_end == Some(FinalTime::Auto) && !spec.sweep.is_empty() {
            spec.t_end = Some(FinalTime::OfCells(cells.iter().map(|cell| cell.spec.final_time()).collect()));
        }
        let stages = stage::stages(&cells);
        let mut study = Study { spec, cells, stages, outlines: Outlines::default(), by_size: Vec::new() };
        study.settle_spec(|_| ());
        Ok(study)
    }
}

/// Whether two specs have one curve with the same nodes. Curves that are drawn are the same if everything is that a
/// draw depends on.
fn same_curve(one: &Spec, other: &Spec) -> bool {
    let drawn = |spec: &Spec| (spec.seed, spec.members_per_cell(), spec.design, spec.common_random_numbers);
    let same_draws = || drawn(one) == drawn(other) && one.distributions() == other.distributions();
    let nodes = |spec: &Spec| (spec.points, spec.sampling, spec.interpolation(), spec.rounding().to_bits());
    let nodes = nodes(one) == nodes(other);
    nodes && one.shape == other.shape && (!one.shape.is_drawn() || same_draws())
}

/// One ensemble of a study.
#[derive(Clone)]
pub struct Cell {
    /// Index of the cell, from 0.
    pub index: u64,
    /// Its spec, without a sweep.
    pub spec: Spec,
    /// Its curves.
    pub family: Family,
    /// Members of the cells before it.
    first: u64,
}

/// The cell of a member, of some in their order.
pub(crate) fn cell_of<'a>(cells: &'a [Cell], ended: &Outcome) -> Option<&'a Cell> {
    cells.binary_search_by_key(&ended.cell, |cell| cell.index).ok().map(|at| &cells[at])
}

const LONG_SWEEPS: &str = "Gauss-Seidel needs more sweeps the longer the step, and adaptive steps grow: a solve may \
                           need tens of thousands; --solver direct needs none";

const TOO_WIDE: &str = "standard errors and intervals are those of independent members, too wide for --design sobol and \
                        lhs: the spread over several seeds is the error of such a run";

const OF_THESE: &str = "standard errors and intervals take copies of one outline for independent members: they hold for these \
                        outlines, not for a population of which they are a sample";

const NARROW: &str = "narrow the distribution, or cut it: DISTRIBUTION in A..B";

/// Members that are stretched before the run, to refuse what cannot be: each takes a millisecond.
const STRETCHED: usize = 256;

/// How many times more nodes are looked for where so few cannot be refined.
const MAX_MORE: usize = 8;

impl Cell {
    /// The only cell of a spec without a sweep.
    pub fn only(spec: Spec, family: Family) -> Cell {
        let spec = times::settled(spec, family.scales());
        Cell { index: 0, spec, family, first: 0 }
    }

    /// Gives its spec a number as the final time, and checks it against the curve.
    fn settle(&mut self) -> Result<()> {
        let scales = self.family.scales();
        self.spec = times::settled(self.spec.clone(), scales).validate_alone()?;
        times::check(&self.spec, scales, self.family.points())?;
        self.check_draws()?;
        self.check_stretch()?;
        self.check_refinement()
    }

    /// The rank of a member among those of the cell that would run without shards.
    pub fn place(&self, index: u64) -> u64 {
        self.spec.place(index - self.first)
    }

    /// The members to run, as indices in the study.
    pub fn members(&self) -> impl Iterator<Item = u64> + '_ {
        self.spec.members().map(|member| self.first + member)
    }

    /// Makes the member with this index in the study.
    ///
    /// # Errors
    /// As [`Family::member`].
    pub fn member(&self, index: u64) -> Result<Member> {
        Ok(Member { index, cell: self.index, ..self.family.member(self.drawn_as(index))? })
    }

    /// The index of the random numbers of the member with this index in the study: for [`Family::drawn`],
    /// [`Family::coefficients`] and [`Spec::values`].
    pub fn drawn_as(&self, index: u64) -> u64 {
        self.spec.drawn_as(index, self.index)
    }

    /// What the user should know about it before the run, one sentence each.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.family.warnings().to_vec();
        let Cohort { solver, adaptive, .. } = self.cohort();
        if adaptive && solver.sweeps() {
            warnings.push(LONG_SWEEPS.into());
        }
        if !self.spec.design.is_random() && self.spec.has_drawn_values() {
            warnings.push(TOO_WIDE.into());
        }
        if self.spec.has_copies_of_outlines() {
            warnings.push(OF_THESE.into());
        }
        warnings.extend(times::warnings(&self.spec, self.family.scales()));
        warnings
    }

    /// Checks that no member was drawn with values that cannot be.
    fn check_draws(&self) -> Result<()> {
        let Some(possible) = self.spec.refusal() else { return Ok(()) };
        if self.spec.accuracy.is_some() {
            let any = format!("{possible}: --accuracy adds members until one may be drawn so; {NARROW}");
            return Err(Error::Request(any));
        }
        let of_member = |member| self.spec.check_values(self.drawn_as(member)).err().map(|error| (member, error));
        let mut refused = self.members().filter_map(of_member);
        let Some((member, error)) = refused.next() else { return Ok(()) };
        let (more, all) = (refused.count(), self.spec.member_count());
        let more = if more == 0 { String::new() } else { format!(" and {more} more") };
        Err(Error::Request(format!("{error}, for member {member}{more} of {all}; {NARROW}")))
    }

    /// Checks that the first members can be stretched as asked.
    fn check_stretch(&self) -> Result<()> {
        let asked = self.spec.reduced_area.is_some() || self.spec.conserve_at.is_some();
        self.members().take(if asked { STRETCHED } else { 0 }).try_for_each(|member| self.member(member).map(drop))
    }

    /// Checks that its members have limits, if these are asked for.
    fn check_refinement(&self) -> Result<()> {
        if !self.spec.refine {
            return Ok(());
        }
        let runs = |spec: &Spec| {
            RefinementLevel::FIRST.into_iter().try_for_each(|level| self.resampled(spec, level).map(drop))
        };
        let Err(fault) = runs(&self.spec) else { return Ok(()) };
        let n = self.spec.points;
        let more = (n + 1..=MAX_MORE * n).find(|points| runs(&Spec { points: *points, ..self.spec.clone() }).is_ok());
        let why = fault.to_string();
        // Without its remedy, which is for members of n/2 nodes.
        let why = why.rsplit_once("; ").map_or(why.as_str(), |(why, _)| why);
        let coarser = format!("n/2 = {} nodes are too few ({why})", RefinementLevel::HALF.points(n));
        Err(match more {
            Some(points) => Error::value(
                "points",
                n,
                &format!("--refine also runs members with fewer, and {coarser}"),
                &format!("use {points} or more"),
            ),
            None => {
                Error::Request(format!("--refine: members must also run with fewer nodes, which cannot be: {fault}"))
            }
        })
    }

    /// The levels at which its members may run, and then, where they have outlines, the variations of these.
    fn levels(&self) -> Vec<RefinementLevel> {
        let finer = RefinementLevel::finer(self.spec.points).filter(|_| self.spec.refine);
        let mut levels: Vec<_> = RefinementLevel::FIRST.into_iter().chain(finer).collect();
        if self.spec.refine && self.family.has_outlines() {
            let fine: Vec<_> = levels.iter().copied().filter(|level| *level >= RefinementLevel::FULL).collect();
            let varied = |variation| fine.iter().map(move |level| level.varied(variation));
            levels.extend(Variation::ALL.into_iter().flat_map(varied));
        }
        levels
    }

    /// Its members that need a selective `level`, by their times at the `levels` before it.
    fn needing<'a>(&'a self, level: RefinementLevel, levels: &'a LevelTimes) -> impl Iterator<Item = u64> + 'a {
        let varies = move |member: u64| {
            level.variation().is_none_or(|variation| self.family.has(variation, self.drawn_as(member)))
        };
        self.members().filter(move |member| levels.needs(&self.spec, *member, level) && varies(*member))
    }

    /// Its spec at a level.
    ///
    /// # Errors
    /// [`Error::Request`] if its curve has no such level.
    fn at(&self, level: RefinementLevel) -> Result<Spec> {
        self.resampled(&self.spec, level)
    }

    /// That of `own`, its spec with any number of points, at a level.
    fn resampled(&self, own: &Spec, level: RefinementLevel) -> Result<Spec> {
        if own.sampling == Sampling::Points {
            let (problem, remedy) = ("a file's own points have no coarser resolution", "use --sampling arclength");
            return Err(Error::value("sampling", "points", problem, remedy));
        }
        // Of a member that cannot be halved no level is of use.
        let half = RefinementLevel::HALF.spec(own)?;
        times::check(&half, self.family.scales(), half.points)?;
        let spec = level.spec(own)?;
        times::check(&spec, self.family.scales(), spec.points)?;
        Ok(spec)
    }

    /// The properties that other cells must share to run side by side with it.
    pub fn cohort(&self) -> Cohort {
        Cohort::of(&self.spec)
    }
}

/// Memory for the curves of all cells, which are made before the first cell runs: enough for three cells of a million
/// nodes.
const MAX_BYTES: usize = 4_000_000_000;

/// Makes cell `index` of `spec`, after the cells `before`; `bytes` counts the memory of all curves.
fn cell(spec: &Spec, outlines: &Outlines, index: u64, before: &[Cell], bytes: &mut usize) -> Result<Cell> {
    let per_cell = spec.members_per_cell();
    let first = index * per_cell;
    let only = spec.only.as_ref().map(|only| {
        // They ascend.
        let below = |member: u64| only.partition_point(|m| *m < member);
        only[below(first)..below(first + per_cell)].iter().map(|member| member - first).collect()
    });
    let own = Spec { only: None, shard: None, ..spec.of_cell(index)? }.validate()?;
    let family = match before.iter().rfind(|cell| same_curve(&cell.spec, &own)) {
        Some(other) => Family::like(&other.family, &own)?,
        None => {
            *bytes += Sampler::bytes(own.sampling, own.points);
            if *bytes > MAX_BYTES {
                let (cells, gigabytes) = (format!("({} cells)", spec.sweep.cells()), MAX_BYTES as f64 / 1e9);
                let problem = format!("the curves of the first {} take more than {gigabytes} GB", index + 1);
                return Err(Error::value("sweep", cells, &problem, "use fewer --points, or fewer cells at once"));
            }
            Family::with(&own, outlines.of(own.shape.typical()))?
        }
    };
    // The number of points of a file has not been checked yet.
    let own = Spec { points: family.points(), ..own }.validate()?;
    let shard = spec.shard.map(|shard| shard.from(first));
    Ok(Cell { index, spec: Spec { only, shard, ..own }, family, first })
}

/// Makes and checks all cells of `spec`, whose files have been read; one if nothing is swept.
fn cells(spec: &Spec, outlines: &Outlines) -> Result<Vec<Cell>> {
    let mut cells: Vec<Cell> = Vec::new();
    let mut bytes = 0;
    for index in 0..spec.sweep.cells() {
        let cell = cell(spec, outlines, index, &cells, &mut bytes);
        cells.push(cell.map_err(|error| spec.sweep.in_cell(error, index))?);
    }
    let unequal = cells.windows(2).find(|pair| pair[0].spec.points != pair[1].spec.points);
    if let (Store::Zarr, Some([one, other])) = (spec.store, unequal) {
        let [(one, own), (other, others)] = [one, other].map(|cell| (spec.sweep.name(cell.index), cell.spec.points));
        let problem = format!("an array has as many nodes for all members: {own} in {one}, {others} in {other}");
        return Err(Error::value("store", "zarr", &problem, "use --store csv, or one number of --points"));
    }
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_flow::solver::Solver;

    fn swept(axes: &[&str], base: Spec) -> Spec {
        let mut spec = base;
        axes.iter().for_each(|axis| spec.sweep.set(axis.parse().unwrap()));
        spec.validate().unwrap()
    }

    #[test]
    fn cells_of_one_curve_share_it_and_have_the_members_of_cells_that_do_not() {
        let axes = ["amplitude=0.05,0.1", "modes=2..=4;2..=8", "shape=ellipse:2,1;circle:1", "seed=1,2"];
        let spec = swept(&axes, Spec { points: 48, curves: 2, ..Spec::default() });
        let cells = Study::new(spec.clone()).unwrap().cells;
        assert_eq!(cells.len(), 16);
        for (one, other) in cells.iter().flat_map(|one| cells.iter().map(move |other| (one, other))) {
            assert_eq!(one.family.shares_with(&other.family), one.spec.shape == other.spec.shape);
        }
        for cell in &cells {
            let alone = Family::new(&cell.spec).unwrap();
            for member in cell.members() {
                assert_eq!(cell.member(member).unwrap().nodes, alone.member(member).unwrap().nodes, "{member}");
            }
        }
        assert_ne!(cells[0].member(0).unwrap().nodes, cells[4].member(0).unwrap().nodes, "other modes");
    }

    #[test]
    fn sweeps_that_take_long_are_warned_of_in_their_cells_alone() {
        let spec = swept(&["solver=gauss-seidel,direct", "adaptive=0.01"], Spec::default());
        let cells = Study::new(spec).unwrap().cells;
        let warned: Vec<bool> = cells.iter().map(|cell| cell.warnings() == [LONG_SWEEPS]).collect();
        assert_eq!(warned, [true, false]);
        let fixed = Spec { solver: Solver::GaussSeidel.into(), ..Spec::default() }.validate().unwrap();
        let family = Family::new(&fixed).unwrap();
        assert!(Cell::only(fixed, family).warnings().is_empty());
    }

    #[test]
    fn more_curves_than_a_memory_holds_are_refused_before_they_are_made() {
        // Parameter sampling is quick, and its tables are a fraction of those for equal spacing.
        let spec = swept(&["sampling=parameter,arclength"], Spec { points: 1_000_000, ..Spec::default() });
        let outlines = Outlines::read(&spec, Path::new(""), &Outlines::default()).unwrap();
        let bytes = |held: usize| cell(&spec, &outlines, 0, &[], &mut { held });
        assert!(bytes(MAX_BYTES - 16_000_000).is_ok());
        let message = bytes(MAX_BYTES - 15_999_999).err().unwrap().to_string();
        assert!(message.starts_with("--sweep (2 cells): the curves of the first 1 take more than 4 GB; "), "{message}");
    }

    #[test]
    fn a_design_needs_something_to_spread_and_says_what_its_errors_are() {
        let study = |text: &str| Study::new(Spec::from_toml(text).unwrap());
        let message = study("design = 'sobol'").err().unwrap().to_string();
        assert!(message.starts_with("--design sobol: nothing is drawn that it could spread; write "), "{message}");
        let drawn = "design = 'lhs'\nshape = 'ellipse:uniform(1.2..3),1'";
        assert!(study(drawn).unwrap().warnings().contains(&TOO_WIDE.to_string()));
        assert!(!study(&drawn.replace("lhs", "random")).unwrap().warnings().contains(&TOO_WIDE.to_string()));
        // One cell may be drawn, and another not.
        assert!(study("design = 'sobol'\n[sweep]\namplitude = [0.05, 'uniform(0.01..0.1)']").is_ok());
    }

    #[test]
    fn the_members_to_run_fall_to_their_cells() {
        let only = Some(vec![0, 2, 3, 8]);
        let spec = swept(&["omega=1,2,3"], Spec { points: 48, curves: 3, only, ..Spec::default() });
        let cells = Study::new(spec.clone()).unwrap().cells;
        let members: Vec<Vec<u64>> = cells.iter().map(|cell| cell.members().collect()).collect();
        assert_eq!(members, [vec![0, 2], vec![3], vec![8]]);
    }
}
