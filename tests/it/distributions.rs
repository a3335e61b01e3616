//! Distributions in the spec, as a user meets them: what is refused, and that a member is the same in any shard, alone,
//! after an interruption and on a GPU.

use std::{collections::BTreeMap, fs, path::Path};

use crate::common::command::{curvelax, done, stopped_run};
use curvelax::{
    backend::gpu::Gpu,
    curve::Shape,
    ensemble::{Spec, Study},
    flow::Flow,
};
use tempfile::TempDir;

/// Everything that can be drawn, as TOML.
const DRAWN: &str = "curves = 23\npoints = 32\nshape = 'ellipse:uniform(1.2..3),loguniform(0.5..1)'\n\
                     flow = 'elastic:lognormal(0.5,0.2)'\namplitude = 'uniform(0.01..0.1)'\ndecay = 'choice(1,1.5,2)'\n\
                     adaptive = 0.01\nt-end = 'auto'\nperturbation = 'gaussian'\n";

/// A folder with the spec, with `design` and `more` in it.
fn home(design: &str, more: &str) -> TempDir {
    let home = TempDir::new().unwrap();
    fs::write(home.path().join("spec.toml"), format!("{DRAWN}design = '{design}'\n{more}")).unwrap();
    home
}

/// The tables of a run.
fn tables(folder: &Path) -> BTreeMap<String, String> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let tables = entries.filter(|path| path.extension().is_some_and(|extension| extension == "csv"));
    tables
        .map(|path| (path.file_name().unwrap().to_str().unwrap().into(), fs::read_to_string(&path).unwrap()))
        .collect()
}

/// The rows of a summary by member.
fn rows(folder: &Path) -> BTreeMap<u64, String> {
    let text = fs::read_to_string(folder.join("summary.csv")).unwrap();
    let member = |row: &str| row.split(',').next().unwrap().parse().unwrap();
    text.lines().skip(1).map(|row| (member(row), row.to_owned())).collect()
}

#[test]
fn a_column_of_a_table_is_a_value_for_each_member_of_each_cell() {
    let home = TempDir::new().unwrap();
    fs::write(home.path().join("sizes.csv"), "label,size\na,0.02\nb,0.1\nc,0.05\n").unwrap();
    let run = |amplitude: &str, more: &str, out: &str| {
        let flags =
            "--curves 3 --points 32 --adaptive=0.01 --t-end 0.1 --backend cpu --quiet --sweep flow=willmore,elastic:1";
        done(home.path(), &format!("run {flags} --amplitude {amplitude} {more} --out {out}"));
        tables(&home.path().join(out))
    };
    let from_table = run("table(sizes.csv,size)", "", "table");
    let values: Vec<f64> = {
        let members = &from_table["members.csv"];
        let place = members.lines().next().unwrap().split(',').position(|name| name == "amplitude").expect(members);
        members.lines().skip(1).map(|row| row.split(',').nth(place).unwrap().parse().unwrap()).collect()
    };
    assert_eq!(values, [0.02, 0.1, 0.05, 0.02, 0.1, 0.05]);
    // The run can be repeated without the table, and a design changes nothing of it.
    fs::remove_file(home.path().join("sizes.csv")).unwrap();
    assert_eq!(run("each(0.02,0.1,0.05)", "", "each"), from_table);
    assert_eq!(run("each(0.02,0.1,0.05)", "--design lhs", "lhs")["summary.csv"], from_table["summary.csv"]);
    assert_ne!(run("each(0.02,0.05,0.1)", "", "other")["summary.csv"], from_table["summary.csv"]);
    // A cut law stays within.
    fs::write(home.path().join("cut.toml"), "amplitude = 'lognormal(0.05,1) in 0.04..0.06'").unwrap();
    done(
        home.path(),
        "run cut.toml --curves 50 --points 32 --adaptive=0.01 --t-end 0.01 --backend cpu --quiet --out cut",
    );
    let cut = tables(&home.path().join("cut"));
    let place = cut["members.csv"].lines().next().unwrap().split(',').position(|name| name == "amplitude").unwrap();
    let drawn = |row: &str| row.split(',').nth(place).unwrap().parse::<f64>().unwrap();
    assert!(
        cut["members.csv"].lines().skip(1).all(|row| (0.04..=0.06).contains(&drawn(row))),
        "{}",
        cut["members.csv"]
    );
}

#[test]
fn an_impossible_distribution_is_one_clear_message_before_any_work() {
    for (arguments, parts) in [
        (
            "--shape ellipse:normal(1,0.5),1",
            &["half-axis -", "for member ", " more of 256;", "cut it: DISTRIBUTION in A..B"][..],
        ),
        ("--shape circle:uniform(-1..3)", &["the radius -", "for member "]),
        ("--shape circle:uniform(-3..1)", &["the radius -1 ", "at the medians of its distributions"]),
        ("--shape circle:normal(3,0.5) --accurate --accuracy 0.01", &["the radius -", "--accuracy adds members"]),
        ("--shape ellipse:normal(1,-0.5),1", &["the standard deviation must be above 0", "normal(MEAN,SD)"]),
        ("--shape ellipse:uniform(3..1),1", &["the range is empty"]),
        ("--shape ellipse:unifrom(1..2),1", &["did you mean `uniform`?"]),
        ("--shape ellipse:uniform(1..2", &["no closing parenthesis"]),
        ("--flow elastic:lognormal(0.5,0)", &["must be above 0", "standard deviation of the logarithm"]),
        ("--flow willmore:uniform(0..1)", &["willmore takes no argument"]),
        ("--amplitude normal(0.05,0.025)", &["--amplitude -", "for member ", "0 to 0.5"]),
        ("--amplitude uniform(0.1..0.9)", &["for member ", "0 to 0.5"]),
        ("--decay uniform(0..40)", &["--decay ", "for member ", "-4 to 20"]),
        ("--shape flower:choice(2,30):0.1", &["100 nodes resolve no mode above 25"]),
        ("--amplitude each(0.1,0.2) --curves 3", &["--amplitude each(...): 2 values for 3 members", "use --curves 2"]),
        ("--amplitude table(sizes.csv,radius)", &["sizes.csv"]),
        ("--amplitude gamma(-1,2)", &["the shape must be 0.1 to 10000", "gamma(SHAPE,SCALE)"]),
        ("--design halton", &["'halton'", "random, sobol, lhs"]),
        ("--perturbation normal", &["'normal'", "gaussian"]),
        (
            "--sweep amplitude=0.1,normal(0.05,0.025)",
            &["--amplitude -", "for member ", "(in the cell amplitude = normal(0.05,0.025))"],
        ),
    ] {
        let home = TempDir::new().unwrap();
        let output = curvelax(home.path(), &format!("run {arguments} --out out"));
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert_eq!(message.matches("error: ").count(), 1, "{arguments}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments}: {message}");
        assert!(!home.path().join("out").exists(), "{arguments}");
    }
    // What could be drawn, but was not, stands in no way.
    let home = TempDir::new().unwrap();
    done(home.path(), "run --shape circle:normal(3,0.5) --curves 9 --t-end 0.01 --quiet --out out");
}

#[test]
fn shards_one_member_and_a_changed_number_of_threads_give_the_rows_of_the_whole() {
    for design in ["random", "sobol", "lhs"] {
        let home = home(design, "");
        done(home.path(), "run spec.toml --backend cpu --quiet --threads 2 --out whole");
        done(home.path(), "run spec.toml --backend cpu --quiet --threads 1 --only 7,22 --out few");
        for shard in 0..3 {
            done(home.path(), &format!("run spec.toml --backend cpu --quiet --shard {shard}/3 --out part{shard}"));
        }
        done(home.path(), "merge part0 part1 part2 --quiet --out merged");
        let [whole, few] = ["whole", "few"].map(|name| rows(&home.path().join(name)));
        assert_eq!(whole.len(), 23);
        assert_eq!(few.keys().copied().collect::<Vec<_>>(), [7, 22]);
        assert!(few.iter().all(|(member, row)| whole[member] == *row), "{design}: {few:?}");
        let [whole, merged] = ["whole", "merged"].map(|name| tables(&home.path().join(name)));
        assert!(whole == merged, "{design}: the shards differ from the whole");
        // The negative control: another seed.
        done(home.path(), "run spec.toml --backend cpu --quiet --seed 2 --out other");
        assert_ne!(tables(&home.path().join("other"))["summary.csv"], whole["summary.csv"]);
    }
}

#[test]
fn a_stopped_run_resumes_to_the_files_of_one_that_was_not() {
    let home = home("lhs", "");
    let common = "--backend cpu --quiet --threads 1 --curves 1200 --points 100 --adaptive=1e-4 spec.toml";
    done(home.path(), &format!("run {common} --out whole"));
    stopped_run(home.path(), &format!("run {common}"), "part");
    done(home.path(), "resume part --quiet");
    let [whole, part] = ["whole", "part"].map(|name| tables(&home.path().join(name)));
    assert!(whole == part);
}

#[test]
fn designs_give_different_members_and_cells_of_a_sweep_their_own() {
    let values = |design: &str, more: &str, member: u64| {
        let spec = Spec::from_toml(&format!("{DRAWN}design = '{design}'\n{more}")).unwrap();
        let study = Study::new(spec).unwrap();
        let cell = &study.cells()[(member / 23) as usize];
        cell.family.drawn(cell.drawn_as(member))
    };
    let swept = "[sweep]\nomega = [1, 2]\n";
    for design in ["random", "sobol", "lhs"] {
        assert_eq!(values(design, "", 5), values(design, swept, 5), "{design}");
        assert_ne!(values(design, swept, 5), values(design, swept, 28), "{design}");
        let common = format!("common-random-numbers = true\n{swept}");
        assert_eq!(values(design, &common, 5), values(design, &common, 28), "{design}");
    }
    assert_ne!(values("random", "", 5), values("sobol", "", 5));
}

#[test]
fn a_latin_hypercube_has_one_member_in_each_slice_of_every_number() {
    let spec = Spec::from_toml(&format!("{DRAWN}design = 'lhs'")).unwrap();
    let study = Study::new(spec).unwrap();
    let cell = &study.cells()[0];
    let mut slices: Vec<u64> = (0..23)
        .map(|member| match *cell.spec.values(member).unwrap().shape {
            Shape::Ellipse { a, .. } => ((a - 1.2) / 1.8 * 23.0) as u64,
            _ => panic!(),
        })
        .collect();
    slices.sort_unstable();
    assert!(slices.into_iter().eq(0..23));
}

#[test]
fn a_cap_does_not_depend_on_the_members_that_run() {
    let cap = |more: &str| Study::new(Spec::from_toml(&format!("{DRAWN}{more}")).unwrap()).unwrap().spec().final_time();
    assert_eq!(cap(""), cap("only = [7]"));
    assert_eq!(cap(""), cap("shard = '2/3'"));
    let fixed = Study::new(Spec::from_toml("shape = 'ellipse:2.1,0.7'\nt-end = 'auto'").unwrap()).unwrap();
    assert!(cap("") > fixed.spec().final_time());
}

#[test]
fn every_member_has_the_rate_of_theory_of_its_own_flow() {
    let home = home("sobol", "");
    done(home.path(), "run spec.toml --backend cpu --quiet --out out");
    let text = fs::read_to_string(home.path().join("out/rates.csv")).unwrap();
    let mut theory: Vec<&str> = text.lines().skip(1).map(|row| row.split(',').nth(4).unwrap()).collect();
    let count = theory.len();
    theory.sort_unstable();
    theory.dedup();
    assert!(count > 10 && theory.len() == count, "{text}");
    // No line of one flow's theory over the mean of all.
    let picture = fs::read_to_string(home.path().join("out/plots/excess.svg")).unwrap();
    assert!(!picture.contains("exp(−"), "{picture}");
    done(home.path(), "run --curves 4 --quiet --backend cpu --out plain");
    assert!(fs::read_to_string(home.path().join("plain/plots/excess.svg")).unwrap().contains("exp(−"));
}

#[test]
fn levels_run_the_same_members_at_fewer_nodes() {
    let home = home("random", "");
    done(home.path(), "run spec.toml --accurate --points 64 --curves 6 --backend cpu --quiet --out out");
    let text = fs::read_to_string(home.path().join("out/summary.csv")).unwrap();
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let column = |name: &str| names.iter().position(|own| *own == name).unwrap();
    for row in text.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let number = |name: &str| cells[column(name)].parse::<f64>().unwrap();
        // Another member would have another time.
        assert!((number("t_limit") / number("t_relax") - 1.0).abs() < 0.05, "{row}");
    }
}

#[test]
fn a_spec_without_distributions_is_written_without_the_new_keys() {
    let home = TempDir::new().unwrap();
    let text = done(home.path(), "run --print-spec");
    assert!(!text.contains("design") && !text.contains("perturbation"), "{text}");
    let text = done(home.path(), "run --amplitude uniform(0.01..0.1) --design sobol --print-spec");
    assert!(text.contains("amplitude = \"uniform(0.01..0.1)\"") && text.contains("design = \"sobol\""), "{text}");
    fs::write(home.path().join("again.toml"), &text).unwrap();
    assert_eq!(done(home.path(), "run again.toml --print-spec"), text);
}

#[test]
fn a_gpu_relaxes_the_members_that_a_cpu_does() {
    if Gpu::list().is_empty() {
        assert!(std::env::var_os("ALLOW_NO_GPU").is_some(), "no adapter; ALLOW_NO_GPU=1 allows for that");
        return;
    }
    let home = home("sobol", "");
    let common = "spec.toml --curves 5 --flow elastic:lognormal(0.5,0.2) --quiet --adaptive=0.01";
    done(home.path(), &format!("run {common} --backend cpu --out cpu"));
    done(home.path(), &format!("run {common} --backend gpu --out gpu"));
    let times = |name: &str| -> Vec<f64> {
        let text = fs::read_to_string(home.path().join(name).join("summary.csv")).unwrap();
        let at = text.lines().next().unwrap().split(',').position(|own| own == "t_relax").unwrap();
        text.lines().skip(1).map(|row| row.split(',').nth(at).unwrap().parse().unwrap()).collect()
    };
    let [cpu, gpu] = ["cpu", "gpu"].map(times);
    assert_eq!(cpu.len(), 5);
    assert!(cpu.iter().zip(&gpu).all(|(cpu, gpu)| (gpu / cpu - 1.0).abs() < 1e-3), "{cpu:?} {gpu:?}");
    // All differ, by much more than that.
    assert!((1..5).all(|i| (cpu[i] / cpu[i - 1] - 1.0).abs() > 0.01), "{cpu:?}");
}

#[test]
fn flows_that_are_drawn_are_those_of_the_members() {
    let spec = Spec::from_toml(&format!("{DRAWN}[sweep]\nomega = [1, 2]")).unwrap();
    let study = Study::new(spec).unwrap();
    for cell in study.cells() {
        for index in cell.members() {
            let numbers: BTreeMap<String, f64> = cell.family.drawn(cell.drawn_as(index)).into_iter().collect();
            assert_eq!(cell.member(index).unwrap().flow, Some(Flow::Elastic(numbers["flow_1"])));
        }
    }
}
