//! Whole pictures and pages.

use std::time::Duration;

use glam::DVec2;

use super::*;
use curvelax_draw::svg::dots;
use curvelax_ensemble::{Outcome, Status, schedule::grid};
use curvelax_files::samples::film;
use curvelax_study::{
    results::tally::Tally,
    samples::{outcome, platform},
};

/// Names and texts of the pictures of a run of `spec` with this `tally`.
fn pictures(spec: &Spec, mut tally: Tally, films: &[Film]) -> Vec<(&'static str, String)> {
    let provenance = &Provenance::new(spec, &platform(), &tally, &[], Duration::ZERO, Duration::from_secs(1));
    let statistics = &EnsembleStatistics::new(spec, &mut tally).unwrap();
    let excess = &tally.mean_excess(spec).unwrap();
    let explained = &Explained::default();
    FinishedRun { provenance, tally: &tally, statistics, excess, explained, films }.pictures().unwrap()
}

/// 10⁵ members, all different, a third of them censored at various times.
fn many(cells: u64) -> Tally {
    let mut tally = Tally::default();
    for member in 0..100_000_u64 {
        let share = member as f64 / 1e5;
        let t = 0.3 + share.powi(3) + 0.1 * (share * 1e4).sin();
        let relaxed = member % 3 > 0;
        let status = if relaxed { Status::Relaxed } else { Status::Singular };
        let mut outcome = Outcome { cell: member % cells, t_end: t, ..outcome(member, status, relaxed.then_some(t)) };
        (outcome.rate, outcome.rate_theory) = (Some(20.0 + t), Some(24.0));
        (outcome.end.mesh_ratio, outcome.end.metric_drift) = (1.0 + share, 1e-3 + share * share);
        outcome.start.area = 1.0;
        tally.add(&outcome).unwrap();
        let excess = grid(1.0).map(|at| (-24.0 * t * at).exp()).collect::<Vec<_>>();
        tally.add_excess(outcome.cell, &excess);
    }
    tally
}

#[test]
fn pictures_of_1e5_members_are_small() {
    let films: Vec<Film> = (0..12).map(|member| film(member, 100, Status::Relaxed, Some(0.4))).collect();
    let marks: Vec<DVec2> = (0..100_000).map(|i| DVec2::new(0.006 * f64::from(i), 1.0)).collect();
    for cells in [1, 8, 500] {
        let mut spec = Spec { curves: 100_000 / cells, ..Spec::default() };
        if cells > 1 {
            let values = (1..=cells).map(|value| value.to_string()).collect::<Vec<_>>().join(",");
            spec.sweep.set(format!("omega={values}").parse().unwrap());
        }
        let drawn = pictures(&spec, many(cells), &films);
        for (name, text) in &drawn {
            let most = if *name == names::REPORT { 800_000 } else { 120_000 };
            assert!(text.len() < most, "{name} of {cells} cells: {} bytes", text.len());
        }
        assert!(drawn.len() >= 5);
    }
    assert!(dots(&marks).len() > 800_000, "marks one by one would be seen");
}

/// Words that are not numbers where numbers should be.
fn none_of(text: &str) -> Vec<&str> {
    let words = text.split(|c: char| !c.is_alphanumeric());
    // Letters of a path may come before it.
    let is_none = |word: &&str| word.contains("NaN") || ["inf", "Infinity"].contains(word);
    words.filter(is_none).collect()
}

#[test]
fn few_members_and_none_are_drawn_without_a_number_that_is_none() {
    let none = Tally::default();
    let of = |members: &[Outcome]| {
        let mut tally = Tally::default();
        members.iter().for_each(|member| tally.add(member).unwrap());
        tally
    };
    let relaxed = outcome(0, Status::Relaxed, Some(0.0));
    let censored = Outcome { t_end: 0.0, ..outcome(1, Status::Singular, None) };
    let mut unknown = outcome(2, Status::Nonfinite, None);
    (unknown.end.mesh_ratio, unknown.end.metric_drift, unknown.start.area) = (f64::INFINITY, f64::NAN, f64::NAN);
    for (tally, sentence) in [
        (none, "There are no members."),
        (of(std::slice::from_ref(&relaxed)), "Nothing: every member relaxed"),
        (of(std::slice::from_ref(&censored)), "<strong>0</strong> of 1 member relaxed"),
        (of(&vec![censored.clone(); 9]), "No member relaxed, so there are no relaxation times"),
        (of(&[relaxed, censored, unknown]), "<strong>1</strong> of 3 members relaxed"),
    ] {
        for sweep in ["", "omega=1,2", "shape=circle:1;astroid"] {
            let mut spec = Spec::default();
            if !sweep.is_empty() {
                spec.sweep.set(sweep.parse().unwrap());
            }
            for (name, text) in pictures(&spec, tally.clone(), &[]) {
                let bad = none_of(&text);
                assert!(bad.is_empty(), "{name}: {bad:?}");
                assert!(name != names::REPORT || text.contains(sentence), "no {sentence:?}");
            }
        }
    }
    assert_eq!(none_of("d=\"MNaN 3\" inf -inf;information NaN"), ["MNaN", "inf", "inf", "NaN"]);
}
