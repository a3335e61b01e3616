//! Rings of three to a million nodes, ensembles of zero to ten million members: they run, or are refused before any
//! work.

use serde_json::Value;
use tempfile::TempDir;

use crate::{
    Found, Outcome,
    program::{Ended, Running, curvelax},
};

fn run(arguments: &str) -> (TempDir, Ended) {
    let home = TempDir::new().unwrap();
    let ended = Running::start(&mut curvelax(home.path(), &format!("run --backend cpu {arguments} --out out"))).end();
    (home, ended)
}

/// Three steps of a ring of n nodes, or a specific refusal.
pub fn rings(sizes: &[usize]) -> Outcome {
    let few = "--curves 1 --quiet --solver direct --tau 1e-12 --t-end 3e-12";
    for size in [0, 1, 2, 3, 4, 5, 1_000_001] {
        let (home, ended) = run(&format!("{few} --amplitude 0 --points {size}"));
        assert_eq!(ended.code, Some(2), "{ended:?}");
        assert!(ended.errors().len() == 1 && ended.said.contains("use 6 to 1000000"), "{ended:?}");
        assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0, "{size}: something was written");
    }
    for size in sizes {
        let (home, ended) = run(&format!("{few} --amplitude 0 --points {size} --snapshots 3e-12"));
        assert_eq!((ended.code, &*ended.said), (Some(0), ""), "{size}");
        let rows = std::fs::read_to_string(home.path().join("out/snapshots.csv")).unwrap().lines().count();
        assert_eq!(rows, size + 1);
    }
    Found::new(7 + sizes.len(), format!("{} refused by name, {} done", 7, sizes.len()))
}

/// No members, one, and ten million in a dry run.
pub fn members() -> Outcome {
    let (home, ended) = run("--curves 0 --quiet");
    assert!(ended.code == Some(2) && ended.said.contains("--curves 0"), "{ended:?}");
    assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
    let (_home, ended) = run("--curves 1 --quiet --t-end 0.01");
    assert_eq!((ended.code, &*ended.said), (Some(0), ""));
    let home = TempDir::new().unwrap();
    let dry = "run --backend cpu --threads 1 --curves 10000000 --tau 0.01 --dry-run --json";
    let output = curvelax(home.path(), dry).output().unwrap();
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let bytes = json["memory_bytes"].as_f64().unwrap();
    assert!(output.status.success() && (1e8..5e8).contains(&bytes) && json["members"] == 10_000_000, "{json}");
    Found::new(3, format!("10⁷ members use {:.0} MB by the dry run", bytes / 1e6))
}
