//! One curve through the scheme itself: the 2:1 ellipse under surface diffusion, its length and area over time.
//!
//!     cargo run --release --example one_curve

use curvelax::{
    curve::{RadialFactor, Sampler, Sampling, Shape, polygon},
    flow::Flow,
    scheme::{
        Parameters, State, Workspace,
        step::{self, Method},
    },
    solver::{Blocks, Order, Solver},
};
use glam::DVec2;

const POINTS: usize = 100;
const TAU: f64 = 1e-3;

fn main() -> curvelax::Result<()> {
    let ellipse = Shape::Ellipse { a: 2.0, b: 1.0 }.resolve()?;
    let nodes = Sampler::new(ellipse, Sampling::Arclength, POINTS)?.sample(&RadialFactor::default());

    let [c1, c2, c3, ..] = Flow::SurfaceDiffusion.coefficients();
    let parameters = Parameters { c1, c2, c3, tau: TAU, omega: 1.0, ..Parameters::default() };
    let method = Method { solver: Solver::Direct, order: Order::Coloured, max_sweeps: 1, redistribution: true };
    let blocks = Blocks::new(POINTS).expect("6 nodes or more");

    let mut state = State::<f64>::from_nodes(&nodes);
    let mut work = Workspace::new(blocks);
    println!("{:>5} {:>9} {:>9} {:>12}", "t", "length", "area", "excess");
    for steps in 0..=2000 {
        if steps % 250 == 0 {
            let nodes: Vec<DVec2> = state.positions().collect();
            let (length, area, excess) = (polygon::length(&nodes), polygon::signed_area(&nodes), polygon::excess(&nodes));
            println!("{:>5} {length:>9.6} {area:>9.6} {excess:>12.3e}", f64::from(steps) * TAU);
        }
        step::step(&state, &parameters, &method, &mut work);
        step::accept(&mut state, &mut work);
    }
    Ok(())
}
