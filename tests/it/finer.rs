//! Members that need more nodes: with `--refine` those that are not asymptotic run at finer levels, and no others.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
    time::{Duration, Instant},
};

use curvelax::{
    ensemble::{Snapshot, Spec},
    files::{Existing, state::checkpoint},
    report::{Cause, Progress, ReportOptions, ResultFormat, Stop},
    session::{Host, PlacedStudy, ResumePlace, begin, resume},
};
use tempfile::TempDir;

use crate::common::command::{curvelax, done};

/// Smooth and rough members in one cell, and events.
const MIXTURE: &str = "run --accurate --shape ellipse:choice(1.3,4),1 --amplitude 0.02 --modes 2..=5 --backend cpu \
                       --event half=excess<=0.5*start";
/// Tables with rows of levels, and those that follow from them.
const TABLES: [&str; 6] =
    ["summary.csv", "levels.csv", "event_levels.csv", "event_statistics.csv", "ensemble.csv", "explained.csv"];

/// The rows of a table, each by the names of its columns.
fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    csv::Reader::from_path(path).unwrap().into_deserialize().map(Result::unwrap).collect()
}

fn number<T: std::str::FromStr>(row: &BTreeMap<String, String>, column: &str) -> T {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {:?}", row[column]))
}

/// The members of a table, and the levels at which each has a row.
fn levels(path: &Path) -> BTreeMap<u64, Vec<u64>> {
    let mut all: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
    rows(path).iter().for_each(|row| all.entry(number(row, "member")).or_default().push(number(row, "level")));
    all
}

/// Checks that two folders have the same tables.
#[track_caller]
fn same(home: &Path, one: &str, other: &str) {
    for table in TABLES {
        let [one, other] = [one, other].map(|out| fs::read(home.join(out).join(table)).unwrap());
        assert_eq!(one, other, "{table}");
    }
}

#[test]
fn limits_in_f32_are_those_in_f64_within_their_errors() {
    let home = TempDir::new().unwrap();
    let curves =
        "run --accurate --shape ellipse:choice(1.05,8),1 --amplitude 0.02 --modes 2..=5 --backend cpu --points 300";
    let lobes = "run --accurate --shape flower:4:0.15 --amplitude 0.05 --backend cpu --points 128";
    let crystals = "run --accurate --shape ellipse:2,1 --amplitude 0.05 --energy cos:4,0.03 --backend cpu --points 100";
    let mut farthest = 0.0_f64;
    for (place, spec) in [curves, lobes, crystals].into_iter().enumerate() {
        let [single, double] = ["f32", "f64"].map(|precision| {
            let out = format!("{precision}-{place}");
            done(home.path(), &format!("{spec} --curves 6 --precision {precision} --out {out}"));
            rows(&home.path().join(out).join("summary.csv"))
        });
        for (single, double) in single.iter().zip(&double) {
            let off = number::<f64>(single, "t_limit") - number::<f64>(double, "t_limit");
            let [error, exact] = [single, double].map(|row| number::<f64>(row, "t_error"));
            assert!(off.abs() < error && error < 2e-3 * number::<f64>(single, "t_limit"), "{single:?} {double:?}");
            farthest = farthest.max(off.abs() / exact);
        }
    }
    // The control: errors that know nothing of rounding miss.
    println!("{farthest} errors of f64");
    assert!(farthest > 1.0);
    // Beyond the nodes of f32 members continue in f64.
    let numbers: BTreeSet<(bool, String)> = rows(&home.path().join("f32-0/levels.csv"))
        .iter()
        .map(|row| (number::<u64>(row, "points") > 400, row["precision"].clone()))
        .collect();
    assert_eq!(numbers, BTreeSet::from([(false, "f32".to_owned()), (true, "f64".to_owned())]));
}

#[test]
fn the_error_of_a_limit_is_the_same_share_of_it_whatever_the_mobility() {
    let home = TempDir::new().unwrap();
    let [slow, fast] = [1.0, 1e4].map(|mobility| {
        let spec =
            format!("run --accurate --curves 2 --points 64 --mobility {mobility} --backend cpu --out {mobility}");
        done(home.path(), &spec);
        let rows = rows(&home.path().join(mobility.to_string()).join("summary.csv"));
        rows.iter()
            .map(|row| ["t_limit", "t_error"].map(|name| mobility * number::<f64>(row, name)))
            .collect::<Vec<_>>()
    });
    for (slow, fast) in slow.into_iter().flatten().zip(fast.into_iter().flatten()) {
        assert!((slow / fast - 1.0).abs() < 1e-9, "{slow} {fast}");
    }
}

#[test]
fn limits_by_sweeps_in_f32_are_those_of_f64() {
    let home = TempDir::new().unwrap();
    let spec = "run --accurate --shape ellipse:1.5,1 --amplitude 0.05 --curves 4 --points 64 --backend cpu";
    let sweeps = "--precision f32 --solver gauss-seidel";
    let [single, double] = [sweeps, "--precision f64"].map(|method| {
        let out = home.path().join(&method[12..15]);
        done(home.path(), &format!("{spec} {method} --out {}", out.display()));
        rows(&out.join("summary.csv"))
    });
    for (single, double) in single.iter().zip(&double) {
        let off = number::<f64>(single, "t_limit") - number::<f64>(double, "t_limit");
        assert!(number::<u64>(single, "sweeps_k") > 0 && off != 0.0, "{single:?}");
        assert!(off.abs() < number::<f64>(single, "t_error"), "{single:?} {double:?}");
    }
    // Sweeps with a factor of their own, or to a larger tolerance, may leave more than limits can bear.
    for (more, remedy) in [("--sor 1", "use --sor auto"), ("--tolerance 1e-5", "use 1e-6 or less")] {
        let output = curvelax(home.path(), &format!("{spec} {sweeps} {more} --out refused"));
        let said = String::from_utf8(output.stderr).unwrap();
        let refused = said.contains(&format!("{more}: ")) && said.contains(remedy);
        assert!(output.status.code() == Some(2) && refused, "{said}");
    }
}

#[test]
fn only_rough_members_get_more_nodes_and_their_limit_rests_on_them() {
    let home = TempDir::new().unwrap();
    let told = done(home.path(), &format!("{MIXTURE} --points 64 --curves 12 --out out"));
    let out = home.path().join("out");
    let levels = levels(&out.join("levels.csv"));
    let is_rough: Vec<bool> =
        rows(&out.join("members.csv")).iter().map(|row| number::<f64>(row, "shape_1") > 2.0).collect();
    let count = is_rough.iter().filter(|rough| **rough).count();
    assert!((1..12).contains(&count), "{is_rough:?}");
    let mut most = 0;
    for (row, rough) in rows(&out.join("summary.csv")).iter().zip(&is_rough) {
        let (own, points) = (&levels[&number(row, "member")], number::<u64>(row, "points"));
        // All levels one after another, to the one that the limit rests on.
        assert_eq!(*own, (1..=own.len() as u64).collect::<Vec<_>>());
        assert_eq!((own.len() > 3, points > 64), (*rough, *rough), "{row:?}");
        assert_eq!(points, (64.0 * (0.5 * (own.len() as f64 - 3.0)).exp2()).round() as u64);
        assert!(number::<f64>(row, "t_error") < 1e-2 * number::<f64>(row, "t_limit"), "{row:?}");
        most = most.max(points);
    }
    assert!(told.contains(&format!("{count} of 12 members needed more nodes for t_limit, up to {most}")), "{told}");
    // Those of the events are at the same levels.
    assert_eq!(levels, self::levels(&out.join("event_levels.csv")));
    // Without --refine there is nothing finer than the member.
    done(home.path(), &format!("{MIXTURE} --points 64 --refine=false --curves 12 --out pilot"));
    let pilot = home.path().join("pilot");
    assert!(self::levels(&pilot.join("levels.csv")).values().all(|own| *own == [1, 2, 3]));
    assert!(rows(&pilot.join("summary.csv")).iter().all(|row| row["points"] == "64"));
}

#[test]
fn a_limit_on_more_nodes_is_that_of_a_member_with_more_nodes() {
    let home = TempDir::new().unwrap();
    let rough = "run --accurate --shape ellipse:4,1 --amplitude 0.02 --modes 2..=5 --curves 4 --backend cpu";
    done(home.path(), &format!("{rough} --points 64 --out coarse"));
    done(home.path(), &format!("{rough} --points 512 --out fine"));
    let [coarse, fine] = ["coarse", "fine"].map(|out| rows(&home.path().join(out).join("summary.csv")));
    for (coarse, fine) in coarse.iter().zip(&fine) {
        let [limit, truth] = [coarse, fine].map(|row| number::<f64>(row, "t_limit"));
        let own = number::<f64>(coarse, "t_relax");
        // The control: n nodes of its own are far off.
        assert!((limit - truth).abs() < 2e-4 * truth && (own - truth).abs() > 1e-2 * truth, "{own} {limit} {truth}");
    }
}

#[test]
fn one_member_alone_and_shards_give_the_rows_of_the_whole() {
    let home = TempDir::new().unwrap();
    done(home.path(), &format!("{MIXTURE} --sweep points=64,76 --curves 12 --out whole"));
    let whole = home.path().join("whole");
    let levels = levels(&whole.join("levels.csv"));
    let of_member = |out: &Path, table: &str, member: u64| -> Vec<_> {
        rows(&out.join(table)).into_iter().filter(|row| number::<u64>(row, "member") == member).collect()
    };
    let rough: Vec<u64> = levels.iter().filter(|(_, own)| own.len() > 3).map(|(member, _)| *member).collect();
    // In both cells.
    assert!(rough[0] < 12 && *rough.last().unwrap() >= 12, "{rough:?}");
    for member in [rough[0], *rough.last().unwrap(), 0] {
        done(home.path(), &format!("{MIXTURE} --sweep points=64,76 --curves 12 --only {member} --force --out one"));
        for table in ["summary.csv", "levels.csv", "event_levels.csv"] {
            let [one, all] = [&home.path().join("one"), &whole].map(|out| of_member(out, table, member));
            assert!(!one.is_empty() && one == all, "{table}, member {member}");
        }
    }
    for index in 0..3 {
        let shard = format!("--shard {index}/3 --quiet --out shard-{index}");
        done(home.path(), &format!("{MIXTURE} --sweep points=64,76 --curves 12 {shard}"));
    }
    done(home.path(), "merge shard-0 shard-1 shard-2 --quiet --out merged");
    same(home.path(), "whole", "merged");
}

/// Stops its runs as soon as so many members have ended, at levels or as they are; never without a number.
struct Patient(Option<u64>);

impl Host for Patient {
    fn say(&self, _: &str) {}

    fn form(&self) -> ResultFormat {
        ResultFormat::Json
    }

    fn options(&self) -> curvelax::Result<ReportOptions> {
        Ok(self.options_with(Stop::default()))
    }

    fn options_with(&self, stop: Stop) -> ReportOptions {
        let (enough, asked) = (self.0, stop.clone());
        let tell = move |done: u64, total: u64, share: f64| {
            assert!(done <= total && share <= 1.0, "{done} of {total}, {share}");
            if enough.is_some_and(|enough| done >= enough) {
                asked.ask(Cause::Terminate);
            }
        };
        let progress = Progress::Callback(Box::new(tell));
        let (since, every, see) = (Instant::now(), Duration::ZERO, Box::new(|_: &[Snapshot]| ()));
        ReportOptions { since, progress, every, stop, patience: Duration::MAX, see }
    }
}

#[test]
fn a_run_that_is_interrupted_at_finer_levels_ends_as_if_it_were_not() {
    let home = TempDir::new().unwrap();
    let text = "shape = 'ellipse:choice(1.3,4),1'\namplitude = 0.02\nmodes = '2..=5'\npoints = 64\nadaptive = 1e-3\n\
                pull = 'auto'\nt-end = 'auto'\nrefine = true\nbackend = 'cpu'\nthreads = 1\nevent = ['half = excess <= 0.5 * start']";
    let spec = Spec { curves: 60, ..Spec::from_toml(text).unwrap() };
    let options = |host: &Patient| host.options().unwrap();
    let run = |out: &str, host: Patient| {
        let placed = PlacedStudy::plan(spec.clone(), None, &host).unwrap();
        begin(placed, &home.path().join(out), Existing::Refused, options(&host), &host)
    };
    run("whole", Patient(None)).unwrap();
    let whole = levels(&home.path().join("whole/levels.csv"));
    let all = whole.values().map(|own| own.len() as u64).sum::<u64>() + 60;
    assert!(all > 300, "{all}");
    let mut stages = BTreeSet::new();
    for enough in [1, 175, 190, 220, all - 70] {
        let out = format!("stopped-{enough}");
        let stopped = run(&out, Patient(Some(enough))).unwrap_err();
        assert_eq!(stopped.exit_code(), 75, "{stopped}");
        let out_path = home.path().join(&out);
        stages.insert(checkpoint::read(&out_path.join(".curvelax.state")).ok().unwrap().0.stage);
        // Once more a little later, and to the end.
        let again = resume(&out_path, ResumePlace::default(), &Patient(Some(enough + 15)));
        again.err().into_iter().for_each(|error| assert_eq!(error.exit_code(), 75, "{out}: {error}"));
        if out_path.join(".curvelax.state").exists() {
            resume(&out_path, ResumePlace::default(), &Patient(None)).unwrap();
        }
        same(home.path(), "whole", &out);
    }
    // The first three stages are those of the first levels.
    assert!(stages.iter().filter(|stage| **stage > 2).count() > 2 && stages.contains(&0), "{stages:?}");
}

#[test]
fn an_ensemble_with_one_rough_member_in_twenty_costs_little_more() {
    let home = TempDir::new().unwrap();
    let values = format!("{}4", "1.5,".repeat(19));
    let run = format!("run --accurate --shape ellipse:choice({values}),1 --curves 100 --backend cpu");
    done(home.path(), &format!("{run} --out out"));
    let out = home.path().join("out");
    let (mut usual, mut more, mut finer) = (0, 0, BTreeMap::new());
    for row in rows(&out.join("levels.csv")) {
        let work = number::<u64>(&row, "points") * number::<u64>(&row, "solves");
        match number::<u64>(&row, "level") {
            1..=3 => usual += work,
            _ => {
                more += work;
                finer.insert(number::<u64>(&row, "member"), ());
            }
        }
    }
    usual += rows(&out.join("summary.csv")).iter().map(|row| 100 * number::<u64>(row, "solves")).sum::<u64>();
    assert!((2..=8).contains(&finer.len()), "{finer:?}");
    assert!(2 * more < usual, "{more} besides {usual}");
    assert!(more > 0);
}

#[test]
fn a_dry_run_foretells_members_that_need_more_nodes() {
    let home = TempDir::new().unwrap();
    let estimate = |flags: &str| -> serde_json::Value {
        let flags = format!("run --accurate --curves 64 --backend cpu --dry-run --json {flags}");
        serde_json::from_str(&done(home.path(), &flags)).unwrap()
    };
    let [smooth, rough] = ["ellipse:1.3,1", "ellipse:4,1"].map(|shape| estimate(&format!("--shape {shape}")));
    assert_eq!((&smooth["finer_members"], &rough["finer_members"]), (&0.into(), &64.into()));
    assert_eq!((&smooth["level_members"], &rough["level_members"]), (&192.into(), &192.into()));
    assert_eq!(rough["most_points"], 1600);
    assert!(rough["memory_bytes"].as_u64() > smooth["memory_bytes"].as_u64(), "{rough} {smooth}");
    // A run without limits has no finer levels.
    let without = estimate("--refine=false --shape ellipse:4,1");
    assert_eq!((&without["finer_members"], &without["most_points"]), (&serde_json::Value::Null, &100.into()));
}

#[test]
fn tables_with_a_wrong_number_of_nodes_are_refused() {
    let home = TempDir::new().unwrap();
    done(home.path(), &format!("{MIXTURE} --points 64 --curves 4 --quiet --out out"));
    let summary = home.path().join("out/summary.csv");
    let text = fs::read_to_string(&summary).unwrap();
    // `points` is followed by what only other members have.
    fs::write(&summary, text.replacen(",64,,,,,,\n", ",65,,,,,,\n", 1)).unwrap();
    let output = curvelax(home.path(), "plot out");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && said.contains("column points: expected 64"), "{said}");
}
