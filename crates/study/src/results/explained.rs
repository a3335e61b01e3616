//! What explains the times: how the relaxation times of the members of a cell depend on their features.
//!
//! Times of which the largest is more than 30 times the smallest, as those of outlines of many sizes are, enter by
//! their logarithms, and with them the positive features that vary as widely. All other numbers enter as they are. A
//! rank correlation near ±1 with a smaller R² means a dependence that is monotone but not straight. A feature that is
//! constant among the members, or unknown for one of them, is left out.
//!
//! The first [`CONSIDERED`] members of a cell enter. One that ended before a time has none and cannot: the numbers hold
//! for the members that reached the time, and the others, mostly the slow ones, are counted beside them. If these are
//! more than [`MAX_CENSORED`], or those that reached the time fewer than [`MIN_MEMBERS`], nothing is claimed: the
//! only row of the cell and time is that of the regression, with the counts alone.

use curvelax_ensemble::Feature;
use curvelax_statistics::{Regression, correlation, spearman};

/// Fewest members with a time of which anything is claimed.
pub const MIN_MEMBERS: usize = 20;
/// Largest share of members without a time beside which anything is claimed.
pub const MAX_CENSORED: f64 = 0.1;
/// Largest over smallest time above which logarithms are taken, as on the axes of pictures.
const WIDE: f64 = 30.0;
/// Members of a cell that enter: the first ones. More would only cost memory: the error of a correlation is 0.007.
pub const CONSIDERED: usize = 20_000;
/// Features that are drawn.
pub const PICTURED: usize = 4;
/// Members that are drawn, over all cells, and at least of each of up to 24.
pub const DRAWN: usize = 256;
/// More cells are not drawn.
const DRAWN_CELLS: u64 = 24;

/// The times that are explained in every run; limits and events come besides.
pub const TIMES: [&str; 2] = ["t_relax", "t_half"];
/// Name of the regression among the features.
pub const TOGETHER: &str = "together";

/// A row of `explained.csv`: how much a feature explains of a time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExplainedRow {
    /// Index of the cell.
    pub cell: u64,
    /// Name of the time.
    pub time: String,
    /// Name of the feature, or [`TOGETHER`].
    pub feature: String,
    /// Members that reached the time.
    pub members: u64,
    /// Members that did not.
    pub censored: u64,
    /// Rank correlation.
    pub spearman: Option<f64>,
    /// Share of the variance that a straight line explains; that of the regression is cross-validated.
    pub r2: Option<f64>,
    /// Place in the regression, from 1; of the regression the number of its features.
    pub chosen: Option<u64>,
    /// What entered by its logarithm: `time`, or `both` time and feature; else empty.
    pub logarithm: String,
}

/// A member with its features and times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeaturedMember {
    /// Index of the member.
    pub member: u64,
    /// Index of its cell.
    pub cell: u64,
    /// Its index among the members of the cell.
    pub place: u64,
    /// A number for each feature; NaN if unknown.
    pub numbers: Vec<f64>,
    /// Each of the [times](Explained::times), if it was reached.
    pub times: Vec<Option<f64>>,
    /// A time that it had not reached, for one without the first of the [times](Explained::times); NaN if none is
    /// known.
    pub later_than: f64,
}

/// What explains the times of all cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Explained {
    /// Names of the times that are explained; the first is the one that is shown.
    pub times: Vec<String>,
    /// By cell, time and R².
    pub rows: Vec<ExplainedRow>,
    /// Names of the features.
    pub features: Vec<String>,
    /// The features that are drawn, as indices, best first.
    pub pictured: Vec<usize>,
    /// The members that are drawn.
    pub drawn: Vec<FeaturedMember>,
}

/// Collects the members of one cell after the other.
pub struct Explaining {
    explained: Explained,
    cells: u64,
    members: Vec<FeaturedMember>,
}

impl Explaining {
    /// Begins, for members with these features and times in so many cells.
    pub fn new(features: &[Feature], times: impl Iterator<Item = String>, cells: u64) -> Explaining {
        let features = features.iter().map(|feature| feature.name.clone()).collect();
        let explained = Explained { features, times: times.collect(), ..Explained::default() };
        Explaining { explained, cells, members: Vec::new() }
    }

    /// Whether a further member of this cell enters.
    pub fn wants(&self, cell: u64) -> bool {
        self.members.first().is_none_or(|first| first.cell != cell) || self.members.len() < CONSIDERED
    }

    /// Whether no further member enters.
    pub fn is_full(&self) -> bool {
        self.members.first().is_some_and(|first| first.cell + 1 == self.cells) && self.members.len() >= CONSIDERED
    }

    /// Adds a member; cells ascend.
    pub fn add(&mut self, member: FeaturedMember) {
        if self.members.first().is_some_and(|first| first.cell != member.cell) {
            self.end_cell();
        }
        self.members.push(member);
    }

    /// Returns what explains the times of the members that were added.
    pub fn finish(mut self) -> Explained {
        self.end_cell();
        let Explained { rows, features, times, .. } = &self.explained;
        // Sums over cells: a cell without the feature adds nothing.
        let sum = |name: &String| {
            let own = rows.iter().filter(|row| times.first() == Some(&row.time) && row.feature == *name);
            own.filter_map(|row| row.r2).sum::<f64>()
        };
        let sums: Vec<f64> = features.iter().map(sum).collect();
        let mut order: Vec<usize> = (0..features.len()).filter(|i| sums[*i] > 0.0).collect();
        order.sort_by(|a, b| sums[*b].total_cmp(&sums[*a]));
        order.truncate(PICTURED);
        Explained { pictured: order, ..self.explained }
    }

    fn end_cell(&mut self) {
        let members = std::mem::take(&mut self.members);
        for (time, name) in self.explained.times.iter().enumerate() {
            self.explained.rows.extend(rows(&members, (time, name), &self.explained.features));
        }
        let most = (DRAWN as u64 / self.cells.clamp(1, DRAWN_CELLS)) as usize;
        let step = members.len().div_ceil(most).max(1);
        self.explained.drawn.extend(members.into_iter().step_by(step));
    }
}

/// The rows of a time of the members of a cell.
fn rows(members: &[FeaturedMember], (time, time_name): (usize, &str), names: &[String]) -> Vec<ExplainedRow> {
    let known: Vec<&FeaturedMember> = members.iter().filter(|member| member.times[time].is_some()).collect();
    let censored = members.len() - known.len();
    let cell = members.first().map_or(0, |first| first.cell);
    let claims = known.len() >= MIN_MEMBERS && censored as f64 <= MAX_CENSORED * members.len() as f64;
    let row = |feature: &str| ExplainedRow {
        cell,
        time: time_name.into(),
        feature: feature.into(),
        members: known.len() as u64,
        censored: censored as u64,
        ..ExplainedRow::default()
    };
    let numbers = |of: &[&FeaturedMember], i: usize| of.iter().map(|member| member.numbers[i]).collect::<Vec<f64>>();
    // Whether a feature has an entry does not depend on which members relaxed.
    let all: Vec<&FeaturedMember> = members.iter().collect();
    let varying: Vec<usize> = (0..names.len()).filter(|i| varies(&numbers(&all, *i))).collect();
    if varying.is_empty() {
        return Vec::new();
    }
    if !claims {
        return vec![row(TOGETHER)];
    }
    let times: Vec<f64> = known.iter().filter_map(|member| member.times[time]).collect();
    let by_logarithm = is_wide(&times);
    let entering = |numbers: Vec<f64>| match by_logarithm && is_wide(&numbers) {
        true => (numbers.iter().map(|number| number.ln()).collect(), "both"),
        false => (numbers, if by_logarithm { "time" } else { "" }),
    };
    let (times, _) = entering(times);
    let keys: Vec<u64> = known.iter().map(|member| member.place).collect();
    let (columns, logarithms): (Vec<Vec<f64>>, Vec<&str>) =
        varying.iter().map(|i| entering(numbers(&known, *i))).unzip();
    let regression = Regression::forward(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>(), &times, &keys);
    let place = |i: usize| regression.as_ref()?.chosen.iter().position(|own| *own == i).map(|place| place as u64 + 1);
    let of_feature = |(i, column): (usize, &Vec<f64>)| ExplainedRow {
        spearman: spearman(column, &times),
        r2: correlation(column, &times).map(|r| r * r),
        chosen: place(i),
        logarithm: logarithms[i].into(),
        ..row(&names[varying[i]])
    };
    let mut rows: Vec<ExplainedRow> = columns.iter().enumerate().map(of_feature).collect();
    rows.sort_by(|a, b| b.r2.unwrap_or(-1.0).total_cmp(&a.r2.unwrap_or(-1.0)));
    rows.push(ExplainedRow {
        r2: regression.as_ref().map(|regression| regression.r2),
        chosen: regression.as_ref().map(|regression| regression.chosen.len() as u64),
        logarithm: if by_logarithm { "time".into() } else { String::new() },
        ..row(TOGETHER)
    });
    rows
}

/// Whether the numbers are positive and over several magnitudes.
fn is_wide(numbers: &[f64]) -> bool {
    let (low, high) = numbers.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
    low > 0.0 && high > WIDE * low
}

/// Whether the numbers are all known and not all equal.
fn varies(numbers: &[f64]) -> bool {
    numbers.iter().all(|number| number.is_finite()) && numbers.iter().any(|number| *number != numbers[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Members of a cell whose t_relax is 1 + the first feature + a little of the second; the third is constant, the
    /// fourth unknown for one. The first `censored` have no time.
    pub fn members(cell: u64, count: u64, censored: u64) -> Vec<FeaturedMember> {
        let member = |i: u64| {
            let (a, b) = ((i as f64 * i as f64).sin(), (3.0 * i as f64).cos());
            let unknown = if i == 5 { f64::NAN } else { b };
            let t = (i >= censored).then_some(1.0 + a + 0.1 * b);
            FeaturedMember {
                member: 1000 * cell + i,
                cell,
                place: i,
                numbers: vec![b, a, 7.0, unknown],
                times: vec![t, t.map(|t| 0.5 * t)],
                later_than: 2.0,
            }
        };
        (0..count).map(member).collect()
    }

    fn times() -> impl Iterator<Item = String> {
        TIMES.map(String::from).into_iter()
    }

    pub fn features() -> Vec<Feature> {
        let feature = |name: &str| Feature { name: name.into(), meaning: String::new(), is_flag: false };
        ["cos_2", "sin_2", "excess_start", "convex"].map(feature).into()
    }

    fn explained(members: impl IntoIterator<Item = FeaturedMember>, cells: u64) -> Explained {
        let mut explaining = Explaining::new(&features(), times(), cells);
        members.into_iter().for_each(|member| explaining.add(member));
        explaining.finish()
    }

    #[test]
    fn the_best_feature_comes_first_and_the_regression_last() {
        let found = explained(members(3, 100, 4), 1);
        let names: Vec<(&str, &str)> = found.rows.iter().map(|row| (&*row.time, &*row.feature)).collect();
        let of = |time| [(time, "sin_2"), (time, "cos_2"), (time, TOGETHER)];
        assert_eq!(names, [of("t_relax"), of("t_half")].concat());
        let [best, other, together] = &found.rows[..3] else { panic!("{found:?}") };
        assert_eq!((best.cell, best.members, best.censored, best.chosen), (3, 96, 4, Some(1)));
        assert!(best.r2.unwrap() > 0.98 && best.spearman.unwrap() > 0.98 && best.r2.unwrap() < 1.0 - 1e-6, "{best:?}");
        assert!(other.r2.unwrap() < 0.1 && other.chosen == Some(2), "{other:?}");
        assert!(together.r2.unwrap() > 1.0 - 1e-9 && together.chosen == Some(2), "{together:?}");
        assert_eq!(together.spearman, None);
        assert_eq!((found.pictured, found.drawn.len()), (vec![1, 0], 100));
    }

    #[test]
    fn nothing_is_claimed_of_few_members_or_beside_many_that_are_censored() {
        for (count, censored) in [(19, 0), (100, 11), (22, 3), (30, 30)] {
            let found = explained(members(0, count, censored), 1);
            assert_eq!(found.rows.iter().map(|row| &*row.feature).collect::<Vec<_>>(), [TOGETHER; 2]);
            let none = |row: &ExplainedRow| (row.spearman, row.r2, row.chosen) == (None, None, None);
            assert!(found.rows.iter().all(none), "{found:?}");
            assert!(found.rows.iter().all(|row| (row.members, row.censored) == (count - censored, censored)));
            assert!(found.pictured.is_empty());
        }
        for (count, censored) in [(20, 0), (100, 10), (22, 2)] {
            assert!(explained(members(0, count, censored), 1).rows[0].r2.is_some(), "{count} {censored}");
        }
    }

    #[test]
    fn times_of_many_magnitudes_enter_by_their_logarithms() {
        let member = |i: u64| {
            let size = (0.1 * i as f64).exp();
            let (wave, t) = ((i as f64 * i as f64).sin(), size.powi(4));
            let numbers = vec![wave, size, 1.0 + 0.1 * wave, f64::from(u8::from(i.is_multiple_of(2)))];
            FeaturedMember {
                member: i,
                place: i,
                numbers,
                times: vec![Some(t), Some(2.0 + wave)],
                ..Default::default()
            }
        };
        let found = explained((0..60).map(member), 1);
        let [best, others @ ..] = &found.rows[..4] else { panic!("{found:?}") };
        assert_eq!((&*best.feature, &*best.logarithm), ("sin_2", "both"));
        assert!(best.r2.unwrap() > 1.0 - 1e-12, "{best:?}");
        assert!(others.iter().all(|row| row.logarithm == "time" && row.r2.unwrap() < 0.2), "{others:?}");
        // The control: half the time is over one magnitude.
        assert!(found.rows.iter().filter(|row| row.time == "t_half").all(|row| row.logarithm.is_empty()));
    }

    #[test]
    fn cells_are_explained_one_by_one_and_bounded() {
        let cells = [members(0, 50, 0), members(2, 30, 0)].concat();
        let found = explained(cells, 3);
        let cells: Vec<u64> = found.rows.iter().map(|row| row.cell).collect();
        assert_eq!(cells, [[0; 6], [2; 6]].concat());
        let alone = explained(members(2, 30, 0), 3);
        assert_eq!(found.rows[6..], alone.rows);
        let many = explained(members(0, 1000, 0), 1);
        assert_eq!(many.drawn.len(), 250);
        let mut explaining = Explaining::new(&features(), times(), 1);
        members(0, 3, 0).into_iter().for_each(|member| explaining.add(member));
        explaining.members.resize(CONSIDERED, FeaturedMember::default());
        assert!(!explaining.wants(0) && explaining.wants(1) && explaining.is_full());
        explaining.cells = 2;
        assert!(!explaining.is_full());
        assert_eq!(
            explained([], 1),
            Explained { features: found.features, times: found.times, ..Explained::default() }
        );
    }
}
