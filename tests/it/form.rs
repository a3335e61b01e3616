//! `--form`: the paper's position equation or the force of the polygon, from outside.

use std::{collections::BTreeMap, fs, path::Path};

use tempfile::TempDir;

use crate::common::command::{curvelax, stopped_run};

/// A sweep over all forms.
const FORMS: &str = "--backend cpu --curves 5 --points 34 --adaptive --t-end 0.2 --common-random-numbers \
                     --sweep form=paper,geometric,auto";

fn run(home: &Path, arguments: &str) {
    let output = curvelax(home, &format!("{arguments} --quiet"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Excess at the end of the first member of each cell.
fn ends(table: &str) -> Vec<String> {
    let mut rows = table.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let column = rows.next().unwrap().iter().position(|name| *name == "excess_end").unwrap();
    rows.step_by(5).map(|row| row[column].to_owned()).collect()
}

#[test]
fn forms_are_swept_side_by_side_and_in_shards() {
    let home = TempDir::new().unwrap();
    run(home.path(), &format!("run {FORMS} --out whole"));
    (0..2).for_each(|i| run(home.path(), &format!("run {FORMS} --shard {i}/2 --out part-{i}")));
    run(home.path(), "merge part-0 part-1 --out merged");
    let table = |folder: &str| fs::read_to_string(home.path().join(folder).join("summary.csv")).unwrap();
    assert_eq!(table("whole"), table("merged"));
    let [paper, geometric, auto] = &ends(&table("whole"))[..] else { panic!("three cells") };
    assert_eq!(paper, auto);
    let [paper, geometric] = [paper, geometric].map(|excess| excess.parse::<f64>().unwrap());
    // Two discretisations of one flow, at 34 nodes.
    let apart = (geometric / paper - 1.0).abs();
    assert!((1e-4..0.3).contains(&apart), "{apart:e}");
}

#[test]
fn a_form_is_printed_as_it_was_given_and_another_word_is_refused() {
    let home = TempDir::new().unwrap();
    let spec = |arguments: &str| String::from_utf8(curvelax(home.path(), arguments).stdout).unwrap();
    for form in ["geometric", "auto"] {
        let printed = spec(&format!("run --form {form} --print-spec"));
        assert!(printed.contains(&format!("form = \"{form}\"\n")), "{printed}");
        fs::write(home.path().join("again.toml"), &printed).unwrap();
        assert_eq!(spec("run again.toml --print-spec"), printed);
    }
    assert!(!spec("run --form paper --print-spec").contains("form ="));
    let wrong = curvelax(home.path(), "run --form geometrc --out new");
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("'geometric'") && !home.path().join("new").exists());
}

/// Steps of this curve stay near the limit of an explicit step. It made 109 610 of them before it was given up.
#[test]
fn a_member_that_creeps_is_given_up_after_the_steps_that_its_tolerance_allows() {
    let home = TempDir::new().unwrap();
    let creeping = "run --backend cpu --form geometric --shape nonconvex --amplitude 0 --curves 1 --points 128 --adaptive=1e-3 \
                    --pull 0 --refine=false";
    run(home.path(), &format!("{creeping} --out out"));
    let mut table = csv::Reader::from_path(home.path().join("out/summary.csv")).unwrap();
    let row: BTreeMap<String, String> = table.deserialize().next().unwrap().unwrap();
    let [steps, end] = ["steps", "t_end"].map(|column| row[column].parse::<f64>().unwrap());
    assert!((10_400.0..12_000.0).contains(&steps) && end < 2.0, "{row:?}");
}

#[test]
fn a_stopped_run_with_the_force_of_the_polygon_resumes_to_the_same_tables() {
    let home = TempDir::new().unwrap();
    let long = "run --backend cpu --form geometric --curves 3 --points 34 --tau 2.5e-6 --t-end 1 --solver direct";
    run(home.path(), &format!("{long} --out whole"));
    stopped_run(home.path(), long, "part");
    run(home.path(), "resume part");
    let table = |folder: &str| fs::read_to_string(home.path().join(folder).join("summary.csv")).unwrap();
    assert_eq!(table("whole"), table("part"));
    // The control: the paper's form gives other curves.
    run(home.path(), &format!("{} --out paper", long.replace("geometric", "paper")));
    assert_ne!(ends(&table("whole")), ends(&table("paper")));
}
