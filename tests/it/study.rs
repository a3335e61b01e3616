//! Studies from outside: cells, their members and their tables.

use crate::common::{
    command::program,
    program::{Done, FILES, run, run_with},
};

const BASE: &str = "--curves 5 --points 34 --t-end 0.05 --series 0.02 --snapshots 0.03 --adaptive=1e-3";

/// The rows of a table without member and cell, for the members of one cell.
fn rows(done: &Done, name: &str, cell: u64) -> Vec<String> {
    let skipped = if ["summary.csv", "members.csv"].contains(&name) { 2 } else { 1 };
    let members: Vec<u64> = (5 * cell..5 * cell + 5).collect();
    let rest = |line: String| line.splitn(skipped + 1, ',').last().unwrap().to_owned();
    done.lines_of(name, &members).into_iter().map(rest).collect()
}

#[test]
fn a_cell_is_the_ensemble_of_its_values_bit_for_bit() {
    let sweep = "--common-random-numbers --sweep flow=willmore,elastic:0.3 --sweep amplitude=0.02,0.1";
    let study = run(&format!("{BASE} {sweep}"));
    assert_eq!(study.summary().len(), 20);
    let cells: Vec<String> = study.summary().iter().map(|row| row["cell"].clone()).collect();
    assert_eq!(cells, (0..20).map(|member| (member / 5).to_string()).collect::<Vec<_>>());
    for (cell, flags) in
        [(0, "willmore --amplitude 0.02"), (1, "willmore --amplitude 0.1"), (3, "elastic:0.3 --amplitude 0.1")]
    {
        let alone = run(&format!("{BASE} --flow {flags}"));
        for name in FILES {
            assert_eq!(rows(&study, name, cell), rows(&alone, name, 0), "{flags}: {name}");
        }
        assert_ne!(rows(&study, "summary.csv", 2), rows(&alone, "summary.csv", 0), "the values do not matter");
    }
}

#[test]
fn the_specs_of_the_examples_are_right() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let files: Vec<_> =
        std::fs::read_dir(root.join("examples/specs")).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(files.len() >= 4);
    for file in files {
        let output = program(root).arg("run").arg(&file).arg("--print-spec").output().unwrap();
        let printed = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success() && printed.contains("[sweep]"), "{}: {:?}", file.display(), output.stderr);
    }
}

#[test]
fn members_of_all_cells_differ_unless_their_random_numbers_are_common() {
    let study = run(&format!("{BASE} --sweep omega=1,1"));
    assert_ne!(rows(&study, "summary.csv", 0), rows(&study, "summary.csv", 1));
    let common = run(&format!("{BASE} --sweep omega=1,1 --common-random-numbers"));
    assert_eq!(rows(&common, "summary.csv", 0), rows(&common, "summary.csv", 1));
}

#[test]
fn what_cannot_run_side_by_side_runs_one_after_another() {
    let sweep = "--common-random-numbers --sweep solver=direct,gauss-seidel --sweep points=34,35";
    let study = run(&format!("{} {sweep}", BASE.replace("--points 34", "")));
    for (cell, flags) in
        [(0, "--solver direct"), (1, "--solver direct --points 35"), (3, "--solver gauss-seidel --points 35")]
    {
        let alone =
            run(&format!("{} {flags}", BASE.replace("--points 34", if cell == 0 { "--points 34" } else { "" })));
        for name in FILES {
            assert_eq!(rows(&study, name, cell), rows(&alone, name, 0), "{flags}: {name}");
        }
    }
}

#[test]
fn a_spec_file_has_the_same_study_and_single_members_of_it_can_be_run_again() {
    let sweep = "--sweep flow=willmore,elastic:0.3 --sweep amplitude=0.02,0.1";
    let study = run(&format!("{BASE} {sweep}"));
    let file = "curves = 5\npoints = 34\nt-end = 0.05\nseries = 0.02\nsnapshots = [0.03]\nadaptive = 1e-3\n\n\
        [sweep]\nflow = ['willmore', 'elastic:0.3']\namplitude = [0.02, 0.1]\n";
    let again = run_with(&[("spec.toml", file)], "spec.toml");
    assert_eq!(again.texts(), study.texts());
    let only = run(&format!("{BASE} {sweep} --only 19,3,7"));
    for name in FILES {
        assert_eq!(only.lines_of(name, &[3, 7, 19]), study.lines_of(name, &[3, 7, 19]), "{name}");
        assert_eq!(only.text(name).lines().count(), 1 + study.lines_of(name, &[3, 7, 19]).len(), "{name}");
    }
}
