//! One curve over time: the paper's 2:1 ellipse under surface diffusion keeps its area and becomes a circle.
//!
//!     cargo run --release --example one_curve

use curvelax::{
    ensemble::{Spec, Study},
    relax,
};

fn main() -> curvelax::Result<()> {
    let study = Study::new(Spec { curves: 1, amplitude: 0.0.into(), series: Some(0.25), ..Spec::default() })?;
    let mut members = Vec::new();
    relax(&study, &mut members)?;

    println!("{:>5} {:>9} {:>9} {:>12}", "t", "length", "area", "excess");
    for row in &members[0].rows.series {
        println!("{:>5} {:>9.6} {:>9.6} {:>12.3e}", row.t, row.at.length, row.at.area, row.at.excess);
    }
    let t_relax = members[0].outcome.t_relax.map_or("not reached".into(), |t| format!("t = {t:.4}"));
    println!("1 % of the initial excess: {t_relax}");
    Ok(())
}
