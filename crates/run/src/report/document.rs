//! The results of a run for programs (`--json`): the content of `run.json`, the paths of its files, and the statistics
//! of its cells. Floats read back exactly; unknown is null.

use std::{collections::BTreeMap, path::Path};

use serde::Serialize;
use toml::Value;

use curvelax_ensemble::{Spec, Status};
use curvelax_statistics::{LogRank, PairedDifferences};
use curvelax_study::results::{
    cells::{CellStatistics, EnsembleStatistics, EventStatistics, GroupStatistics},
    comparison::{CellComparison, CellDifference, LeftOut},
    provenance::Provenance,
    scaling::Scaling,
    times::Numbers,
};

/// A finished run as one document.
#[derive(Serialize)]
pub struct Document<'a> {
    #[serde(flatten)]
    run: &'a Provenance,
    folder: &'a Path,
    files: &'a [&'static str],
    cells: Vec<CellDocument<'a>>,
    /// Whether the cells could have one distribution; null if the test does not hold.
    log_rank: Option<&'a LogRank>,
    /// The differences from the first cell; null unless cells share their random numbers.
    paired: Option<Vec<PairedDocument>>,
    /// Why the cells of a study are not compared; null if they are.
    not_compared: Option<String>,
    /// The groups of outlines; null unless they are grouped.
    groups: Option<Vec<GroupDocument<'a>>>,
    /// For each cell, whether its groups could have one distribution; null if the test does not hold.
    groups_log_rank: Option<Vec<Option<&'a LogRank>>>,
    /// The medians as a power of the swept value; null if no single scale is swept.
    power_law: Option<PowerLawDocument>,
}

/// A row of `ensemble.csv`, under the names of its columns.
#[derive(Serialize)]
struct CellDocument<'a> {
    cell: u64,
    values: BTreeMap<&'a str, &'a Value>,
    members: u64,
    members_by_status: BTreeMap<&'static str, u64>,
    t_relax: Numbers,
    rate: Numbers,
    discretisation: Numbers,
    t_limit: Numbers,
    t_vanish: Numbers,
    t_vanish_limit: Numbers,
    /// By the names of the events.
    events: BTreeMap<&'a str, EventDocument>,
}

/// A row of `event_statistics.csv`.
#[derive(Serialize)]
struct EventDocument {
    t: Numbers,
    discretisation: Numbers,
    t_limit: Numbers,
}

/// A row of `groups.csv`.
#[derive(Serialize)]
struct GroupDocument<'a> {
    group: &'a str,
    #[serde(flatten)]
    times: CellDocument<'a>,
}

#[derive(Serialize)]
struct PairedDocument {
    cell: u64,
    against: u64,
    pairs: usize,
    equal: usize,
    median: Option<f64>,
    median_low: Option<f64>,
    median_high: Option<f64>,
    /// W⁺ of the signed-rank test; null without a test.
    w: Option<f64>,
    p: Option<f64>,
    exact: Option<bool>,
    left_out: LeftOut,
}

impl PairedDocument {
    fn new(of: &CellDifference) -> PairedDocument {
        let CellDifference { cell, found, left_out } = *of;
        let PairedDifferences { pairs, equal, median, interval, test } = found;
        PairedDocument {
            cell,
            against: 0,
            pairs,
            equal,
            median,
            median_low: interval.map(|(low, _)| low),
            median_high: interval.map(|(_, high)| high),
            w: test.map(|test| test.statistic),
            p: test.map(|test| test.p_value),
            exact: test.map(|test| test.exact),
            left_out,
        }
    }
}

#[derive(Serialize)]
struct PowerLawDocument {
    /// The scale.
    of: String,
    /// Null if fewer than two cells can be fitted.
    factor: Option<f64>,
    exponent: Option<f64>,
    exponent_se: Option<f64>,
    r2: Option<f64>,
    /// How well it fits; null below three cells, and if they have no uncertainties.
    chi2: Option<f64>,
    degrees_of_freedom: Option<usize>,
    p: Option<f64>,
    left_out: Vec<LeftOutDocument>,
}

/// A cell that is not in the fit.
#[derive(Serialize)]
struct LeftOutDocument {
    cell: u64,
    reason: &'static str,
}

impl PowerLawDocument {
    fn new(scaling: &Scaling) -> PowerLawDocument {
        let law = scaling.law.as_ref();
        let goodness = law.and_then(|law| law.goodness);
        PowerLawDocument {
            of: scaling.scale.clone(),
            factor: law.map(|law| law.factor),
            exponent: law.map(|law| law.exponent),
            exponent_se: law.and_then(|law| law.exponent_error),
            r2: law.and_then(|law| law.r2),
            chi2: goodness.map(|goodness| goodness.statistic),
            degrees_of_freedom: goodness.map(|goodness| goodness.degrees_of_freedom),
            p: goodness.map(|goodness| goodness.p_value),
            left_out: scaling.left_out.iter().map(|(cell, reason)| LeftOutDocument { cell: *cell, reason }).collect(),
        }
    }
}

impl<'a> Document<'a> {
    /// Collects the document.
    pub fn new(
        run: &'a Provenance,
        statistics: &'a EnsembleStatistics,
        folder: &'a Path,
        files: &'a [&'static str],
    ) -> Document<'a> {
        let spec = &run.spec;
        let EnsembleStatistics { cells, comparison, groups, group_comparisons, scaling, .. } = statistics;
        let paired = comparison.paired_cells().map(|cells| cells.iter().map(PairedDocument::new).collect());
        let not_compared = comparison.refusal().map(String::from);
        let log_rank = comparison.log_rank();
        let of_group =
            |of: &'a GroupStatistics| GroupDocument { group: &of.group, times: CellDocument::new(spec, &of.times) };
        let is_grouped = spec.group_by.is_some();
        let groups = is_grouped.then(|| groups.iter().map(of_group).collect());
        let groups_log_rank = is_grouped.then(|| group_comparisons.iter().map(CellComparison::log_rank).collect());
        let power_law = scaling.as_ref().map(PowerLawDocument::new);
        let cells = cells.iter().map(|cell| CellDocument::new(spec, cell)).collect();
        Document { run, folder, files, cells, log_rank, paired, not_compared, groups, groups_log_rank, power_law }
    }
}

impl<'a> CellDocument<'a> {
    fn new(spec: &'a Spec, statistics: &CellStatistics) -> CellDocument<'a> {
        let (cell, counts) = (statistics.cell, statistics.counts);
        let event = |of: &EventStatistics| {
            let (t, discretisation) = (of.times.numbers(), of.errors());
            EventDocument { t, discretisation, t_limit: of.limit() }
        };
        let events = statistics.events.iter().map(event);
        CellDocument {
            cell,
            values: spec.sweep.axes().iter().map(|axis| &axis.key[..]).zip(spec.sweep.values(cell)).collect(),
            members: statistics.members(),
            members_by_status: Status::ALL.iter().map(|status| status.name()).zip(counts).collect(),
            t_relax: statistics.relaxing.times.numbers(),
            rate: statistics.rates.numbers.clone(),
            discretisation: statistics.relaxing.errors(),
            t_limit: statistics.relaxing.limit(),
            t_vanish: statistics.vanished(),
            t_vanish_limit: statistics.vanished_limit(),
            events: spec.event.iter().map(|event| &event.name[..]).zip(events).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use curvelax_ensemble::Outcome;
    use curvelax_study::{
        results::{provenance::json, tally::Tally},
        samples::{outcome, platform},
    };

    #[test]
    fn a_document_has_what_the_files_have_and_its_floats_read_back() {
        let mut spec = Spec { curves: 3, seed: u64::MAX, ..Spec::default() };
        spec.sweep.set("amplitude=0.1,0.2".parse().unwrap());
        let mut tally = Tally::default();
        for (member, t_relax) in
            [Some(0.1 + 0.2), Some(1.0 / 3.0), None, Some(0.5), Some(0.25), None].iter().enumerate()
        {
            let status = if t_relax.is_some() { Status::Relaxed } else { Status::Stalled };
            let member = member as u64;
            tally.add(&Outcome { cell: member / 3, ..outcome(member, status, *t_relax) }).unwrap();
        }
        let (platform, statistics) = (platform(), EnsembleStatistics::new(&spec, &mut tally).unwrap());
        let run = Provenance::new(&spec, &platform, &tally, &[], Duration::ZERO, Duration::ZERO);
        let text = json(&Document::new(&run, &statistics, Path::new("out"), &["summary.csv"]), "JSON").unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();

        let alone: serde_json::Value = serde_json::from_str(&run.to_json().unwrap()).unwrap();
        assert!(alone.as_object().unwrap().iter().all(|(key, value)| json[key] == *value), "{text}");
        assert_eq!((&json["folder"], &json["files"][0]), (&"out".into(), &"summary.csv".into()));
        let cell = &json["cells"][1];
        assert_eq!(
            (&cell["cell"], &cell["values"]["amplitude"], &cell["members"]),
            (&1.into(), &0.2.into(), &3.into())
        );
        assert_eq!((&cell["members_by_status"]["stalled"], &cell["t_relax"]["known"]), (&1.into(), &2.into()));
        for (cell, statistics) in json["cells"].as_array().unwrap().iter().zip(&statistics.cells) {
            let read = |name: &str| cell["t_relax"][name].as_f64();
            assert_eq!(read("median"), statistics.relaxing.times.median());
            assert_eq!(read("mean"), statistics.relaxing.times.mean.map(|mean| mean.value));
            assert_eq!(read("se"), statistics.relaxing.times.mean.and_then(|mean| mean.standard_error));
            assert_eq!(read("q95"), None, "a quantile beyond the last event is unknown: {text}");
        }
        assert_eq!(json["log_rank"], serde_json::Value::Null);
        assert!(json["not_compared"].as_str().is_some_and(|why| why.contains("expected relaxations")), "{text}");
        // Too few members relaxed for the upper ends of the intervals.
        let law = &json["power_law"];
        assert_eq!((&law["of"], &law["exponent"]), (&"amplitude".into(), &serde_json::Value::Null));
        let open = statistics
            .cells
            .iter()
            .filter(|cell| cell.relaxing.times.interval().is_none_or(|interval| interval.bounds().is_none()))
            .count();
        assert!(open > 0 && law["left_out"].as_array().unwrap().len() == open, "{text}");
        assert_eq!(law["left_out"][0]["reason"], "its median has no closed interval");
    }
}
