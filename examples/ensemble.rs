//! An ensemble without files: 32 perturbed ellipses under Willmore flow, relaxation times into a list.
//!
//!     cargo run --release --example ensemble

use curvelax::{
    ensemble::{Cell, Ended, Family, Sink, Spec},
    flow::Flow,
    placement,
    simulate::simulate,
};

/// Keeps the relaxation times, in member order.
#[derive(Default)]
struct Times(Vec<f64>);

impl Sink for Times {
    fn member(&mut self, ended: &Ended) -> curvelax::Result<()> {
        self.0.extend(ended.outcome.t_relax);
        Ok(())
    }
}

fn main() -> curvelax::Result<()> {
    let spec = Spec { curves: 32, flow: Flow::Willmore, t_end: 8.0, stop_when_relaxed: true, ..Spec::default() };
    let spec = spec.validate()?;
    let family = Family::new(&spec)?;

    let choice = placement::choose(&spec, family.points())?;
    println!("{}", choice.sentence(&spec));
    let precision = choice.precision();
    let (mut backend, _) = choice.open(&spec, family.points())?;

    let mut times = Times::default();
    simulate(&[Cell::only(spec.clone(), family)], precision, backend.as_mut(), 0, &mut times)?;

    let Times(mut times) = times;
    times.sort_by(f64::total_cmp);
    println!("{} of {} members relaxed", times.len(), spec.curves);
    if let (Some(first), Some(last)) = (times.first(), times.last()) {
        println!("t_relax from {first:.4} to {last:.4}, median {:.4}", times[times.len() / 2]);
    }
    Ok(())
}
