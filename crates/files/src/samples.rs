//! A film as a run leaves it, for the tests of several crates.

use std::f64::consts::TAU;

use glam::DVec2;

use crate::portraits::Film;
use curvelax_ensemble::{Outcome, Portrait, Status};
use curvelax_study::samples::outcome;

/// A perturbed ellipse of n nodes that ends as a circle, or part of the way there if it has not relaxed.
pub fn film(member: u64, n: usize, status: Status, t_relax: Option<f64>) -> Film {
    let size = 1.0 + 0.1 * (member % 3) as f64;
    let nodes = |t: f64| -> Vec<DVec2> {
        let rest = (-2.0 * t).exp();
        let node = |u: f64| {
            let wave = 1.0 + rest * 0.15 * ((3.0 + (member % 4) as f64) * u + member as f64).cos();
            DVec2::new((1.0 + rest) * u.cos(), u.sin() * (1.0 + 0.4 * (1.0 - rest))) * wave * size
        };
        (0..n).map(|i| node(TAU * i as f64 / n as f64)).collect()
    };
    let end = Outcome { t_end: if t_relax.is_some() { 2.0 } else { 0.5 }, ..outcome(member, status, t_relax) };
    let kept = |t: f64| nodes(t).into_iter().step_by(Portrait::stride(n)).collect();
    let frames = (1..30).map(|i| 0.1 * f64::from(i)).map(|t| (t, kept(t))).collect();
    Film::new(&end, &Portrait { before: nodes(0.0), frames, after: nodes(end.t_end) })
}
