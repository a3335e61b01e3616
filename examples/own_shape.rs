//! Shapes of your own, by a formula and by a list of points, relaxed through the library and printed.
//!
//!     cargo run --release --example own_shape

use std::f64::consts::TAU;

use curvelax::{
    curve::{BaseCurve, Outline},
    ensemble::{Spec, Study, request::spec::OrAuto},
    relax,
};
use glam::DVec2;

fn main() -> curvelax::Result<()> {
    // A bean: u in [0, 1] goes round once, in either sense.
    let bean = BaseCurve::from_formula(|u| {
        let (sin, cos) = (TAU * u).sin_cos();
        (1.0 + 0.5 * sin) * DVec2::new(cos, 1.3 * sin)
    });
    // The corners of an L; those that n nodes do not resolve are rounded off.
    let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
    let letter = BaseCurve::from_outline(Outline::from_points(&corners.map(DVec2::from))?);

    for (name, curve) in [("bean", bean), ("letter L", letter)] {
        // Steps that adapt, on to an excess that does not depend on n.
        let spec = Spec {
            curves: 1,
            amplitude: 0.0.into(),
            adaptive: Some(1e-3),
            pull: OrAuto::Auto,
            relax_at: Some(0.01),
            stop_when_relaxed: Some(true),
            ..Spec::default()
        };
        let mut members = Vec::new();
        relax(&Study::of_curve(spec, curve)?, &mut members)?;

        let outcome = &members[0].outcome;
        let (start, end) = (outcome.start, outcome.end);
        let t_relax = outcome.t_relax.map_or("not reached".into(), |t| format!("{t:.5}"));
        println!(
            "{name:<8} area {:.4} to {:.4}, length {:.4} to {:.4}, {} after {} steps, t_relax {t_relax}",
            start.area,
            end.area,
            start.length,
            end.length,
            outcome.status.name(),
            outcome.steps,
        );
        if let Some(portrait) = &members[0].portrait {
            let shown = portrait.after.iter().step_by(portrait.after.len() / 4);
            println!("{:<8} some nodes: {}", "", shown.map(|node| format!("{node:.3}")).collect::<Vec<_>>().join(" "));
        }
    }
    Ok(())
}
