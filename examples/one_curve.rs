//! One curve over time: the paper's 2:1 ellipse under surface diffusion keeps its area and becomes a circle.
//!
//!     cargo run --release --example one_curve

use curvelax::{
    ensemble::{Cell, Ended, Family, Sink, Spec},
    placement,
    simulate::simulate,
};

/// Prints the series of every member.
struct Print;

impl Sink for Print {
    fn member(&mut self, ended: &Ended) -> curvelax::Result<()> {
        println!("{:>5} {:>9} {:>9} {:>12}", "t", "length", "area", "excess");
        for row in &ended.rows.series {
            println!("{:>5} {:>9.6} {:>9.6} {:>12.3e}", row.t, row.at.length, row.at.area, row.at.excess);
        }
        let t_relax = ended.outcome.t_relax.map_or("not reached".into(), |t| format!("t = {t:.4}"));
        println!("1 % of the initial excess: {t_relax}");
        Ok(())
    }
}

fn main() -> curvelax::Result<()> {
    let spec = Spec { curves: 1, amplitude: 0.0, series: Some(0.25), ..Spec::default() }.validate()?;
    let family = Family::new(&spec)?;
    let choice = placement::choose(&spec, family.points())?;
    let precision = choice.precision();
    let (mut backend, _) = choice.open(&spec, family.points())?;
    simulate(&[Cell::only(spec, family)], precision, backend.as_mut(), 0, &mut Print)
}
