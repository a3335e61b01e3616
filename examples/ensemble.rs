//! An ensemble without files: 32 perturbed ellipses under Willmore flow, relaxation times into a list.
//!
//!     cargo run --release --example ensemble

use curvelax::{
    ensemble::{Spec, Study},
    flow::Flow,
    relax,
};

fn main() -> curvelax::Result<()> {
    let spec = Spec {
        curves: 32,
        flow: Flow::Willmore.into(),
        t_end: Some(8.0.into()),
        stop_when_relaxed: Some(true),
        ..Spec::default()
    };
    let mut members = Vec::new();
    let platform = relax(&Study::new(spec)?, &mut members)?;

    let mut times: Vec<f64> = members.iter().filter_map(|member| member.outcome.t_relax).collect();
    times.sort_by(f64::total_cmp);
    println!("on {}: {} of {} members relaxed", platform.name(), times.len(), members.len());
    if let (Some(first), Some(last)) = (times.first(), times.last()) {
        println!("t_relax from {first:.4} to {last:.4}, median {:.4}", times[times.len() / 2]);
    }
    Ok(())
}
