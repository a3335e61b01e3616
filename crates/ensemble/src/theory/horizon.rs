//! How long a curve is expected to take to relax: for the cap of `--t-end auto`, and for warnings about times and rates
//! that do not suit a curve.
//!
//! By linear theory a nearly round curve is a circle of radius R(t), `R' = -b(1/R)`, with a share e_m of the excess in
//! each mode m ≥ 2, and
//!
//! ```text
//! (ln e_m)' = -2 (rate_m(R) + R'/R)
//! ```
//!
//! since the excess goes as the square of the mode's amplitude over the radius. The shares at the start are those of
//! the tangent's direction over the arclength: on a nearly round curve a mode θ_m of it has the excess ½ m²/(m²-1)
//! θ_m². They are scaled to the curve's own excess. R(0) is L/2π, which a thin curve takes longer to leave than the
//! radius of the circle of the same area. Surface diffusion, b = 0, brings a thin curve down to the circle of its area;
//! R is there the geometric mean of the two. The time of theory is 0.4 to 8 times the real one, for ellipses from 1.1:1
//! to 20:1, flowers, the nonconvex curve, the astroid and islands under many flows, to shares of the excess from 0.5 to
//! 10⁻⁶ (table in docs/internals/method.md).
//!
//! A driving force F adds -F to R', and to first order nothing to the rates. A flow that keeps the area or the length
//! keeps the radius of the circle of that area or length; the multiplier λ of the length, b(1/R) + λ/R = 0, changes the
//! rates ([`Forcing::linear_rate`]).
//!
//! The excess of a crystal over its Wulff shape has its own size, by the surface energy of the curve, and falls at its
//! slowest rate. A driven one is none of theory: a force that is the same in all directions has another shape at rest.

use std::f64::consts::TAU;

use glam::{DMat2, DVec2};

use super::rates;
use curvelax_curve::polygon;
use curvelax_flow::{
    crystal::{Energy, HIGHEST_WAVE},
    equilibrium::Equilibrium,
    flow::Flow,
    forcing::{Conserved, Forcing},
};

/// The highest mode that is followed; higher ones vanish before they matter.
const MODES: usize = 32;
/// Nodes from which modes are computed: more tell nothing new about the lowest ones.
const NODES: usize = 1024;
/// Largest change of the excess and of the radius in one step, relatively.
const STEP: f64 = 0.05;
/// Steps after which a curve is considered not to relax; those that do take hundreds.
const MAX_STEPS: u32 = 20_000;
/// An excess that grows by this factor does not fall again.
const GROWN: f64 = 1e3;
/// A circle that shrinks to this share of its radius vanishes.
const VANISHED: f64 = 1e-3;

/// The size of a curve and its distance from a circle.
#[derive(Clone, Debug)]
pub struct CurveScale {
    /// Radius of the circle of the same area; of the same length if the curve is not simple.
    pub radius: f64,
    /// Its length over 2π.
    pub radius_of_length: f64,
    /// Whether its tangent turns once.
    pub simple: bool,
    /// Its excess.
    pub excess: f64,
    /// The parts of the excess in the modes from 2 on.
    parts: Vec<f64>,
    nodes: usize,
    area: f64,
    /// The sums over the edges of their length times the powers of their direction, from the 0th on, by which surface
    /// energies are known.
    powers: Vec<DVec2>,
}

impl CurveScale {
    /// Measures a polygon.
    pub fn of(nodes: &[DVec2]) -> CurveScale {
        let simple = polygon::turning_number(nodes).abs() == 1;
        let (radius, radius_of_length) = (rates::radius(nodes), polygon::length(nodes) / TAU);
        let (length, area) = (polygon::length(nodes), polygon::signed_area(nodes));
        let excess = if simple { Equilibrium::Circle.excess(length, area, nodes.len()).max(0.0) } else { 0.0 };
        let mut parts = if simple { parts(nodes) } else { Vec::new() };
        let sum: f64 = parts.iter().sum();
        if sum > 0.0 {
            parts.iter_mut().for_each(|part| *part *= excess / sum);
        }
        let mut powers = vec![DVec2::ZERO; HIGHEST_WAVE as usize + 1];
        for edge in polygon::edges(nodes).filter(|edge| *edge != DVec2::ZERO) {
            let (tangent, mut power) = (edge.normalize(), DVec2::new(edge.length(), 0.0));
            for sum in &mut powers {
                *sum += power;
                power = power.rotate(tangent);
            }
        }
        CurveScale { radius, radius_of_length, simple, excess, parts, nodes: nodes.len(), area, powers }
    }

    /// Its excess under a flow, 0 if it is not simple.
    pub fn excess_under(&self, flow: &Flow) -> f64 {
        match flow.equilibrium() {
            Equilibrium::Circle => self.excess,
            of @ Equilibrium::Wulff(energy) if self.simple => {
                of.excess(self.tension(&energy), self.area.abs(), self.nodes).max(0.0)
            }
            Equilibrium::Wulff(_) => 0.0,
        }
    }

    /// Its surface energy.
    fn tension(&self, energy: &Energy) -> f64 {
        let waves = energy.waves().numbers();
        self.powers[0].x + waves.iter().map(|[m, a, b]| self.powers[*m as usize].dot(DVec2::new(*a, *b))).sum::<f64>()
    }

    /// 24/R⁴, the rate at which the excess of a nearly round curve of this size decays under surface diffusion.
    pub fn rate(&self) -> f64 {
        rates::relaxation_rate(self.radius)
    }

    /// The radius from which the theory starts.
    pub fn first_radius(&self, flow: &Flow, forcing: &Forcing) -> f64 {
        match flow {
            _ if forcing.conserved.is_some() => {
                let of_length = if forcing.kept[1] == 0.0 { self.radius_of_length } else { forcing.kept[1] / TAU };
                forcing.radius_at_rest(self.radius, of_length).unwrap_or(of_length)
            }
            Flow::SurfaceDiffusion => (self.radius * self.radius_of_length).sqrt(),
            _ => self.radius_of_length,
        }
    }

    /// The time after which the excess has fallen to `threshold`, for unit mobility, with `more` excess in the modes
    /// from 2 on, by theory; `None` if by theory it never does, and for a curve that is not simple.
    pub fn relaxes_after(&self, flow: &Flow, forcing: &Forcing, more: &[f64], threshold: f64) -> Option<f64> {
        if forcing.conserved == Some(Conserved::AreaAndLength) || (flow.is_crystal() && forcing.acts()) {
            return None;
        }
        if flow.is_crystal() {
            let fall = (self.excess_under(flow) + more.iter().sum::<f64>()) / threshold;
            let t = fall.max(1.0).ln() / (2.0 * flow.linear_rate(2, self.radius));
            return (self.simple && t.is_finite()).then_some(t);
        }
        // The modes are those of a circle.
        let count = self.parts.len().max(more.len());
        let part = |parts: &[f64], i: usize| parts.get(i).copied().unwrap_or(0.0);
        let mut parts: Vec<f64> = (0..count).map(|i| part(&self.parts, i) + part(more, i)).collect();
        let start = self.first_radius(flow, forcing);
        let (mut radius, mut t) = (start, 0.0);
        let most = GROWN * parts.iter().sum::<f64>();
        for _ in 0..MAX_STEPS {
            let excess: f64 = parts.iter().sum();
            if excess <= threshold {
                return self.simple.then_some(t);
            }
            let slope = forcing.growth(flow, radius);
            let rate = |i: usize| 2.0 * (forcing.linear_rate(flow, i as u32 + 2, radius) + slope / radius);
            let fall = parts.iter().enumerate().map(|(i, part)| part * rate(i)).sum::<f64>() / excess;
            let h = STEP / fall.abs().max(slope.abs() / radius);
            parts.iter_mut().enumerate().for_each(|(i, part)| *part *= (-h * rate(i)).exp());
            (radius, t) = (radius + h * slope, t + h);
            if !(excess <= most && h.is_finite() && radius > VANISHED * start) {
                return None;
            }
        }
        None
    }
}

/// The parts of the excess in the modes from 2 on of a curve whose tangent turns once, up to a common factor.
fn parts(nodes: &[DVec2]) -> Vec<f64> {
    let every = nodes.len().div_ceil(NODES);
    let nodes: Vec<DVec2> = nodes.iter().copied().step_by(every).collect();
    let edges: Vec<DVec2> = polygon::edges(&nodes).collect();
    let length = polygon::length(&nodes);
    let turn = if polygon::signed_area(&nodes) < 0.0 { -TAU } else { TAU };
    let (mut direction, mut at) = (0.0, 0.0);
    let mut sums = vec![DVec2::ZERO; MODES.min(nodes.len() / 4)];
    for (i, edge) in edges.iter().enumerate() {
        let middle = (at + 0.5 * edge.length()) / length;
        let gap = (direction - turn * middle) * edge.length() / length;
        // The powers of e^(2πi s/L), so that a node needs one sine.
        let spin = DMat2::from_angle(TAU * middle);
        let mut wave = spin * (spin * DVec2::X);
        for sum in &mut sums {
            *sum += 2.0 * gap * wave;
            wave = spin * wave;
        }
        at += edge.length();
        direction += edge.angle_to(edges[(i + 1) % edges.len()]);
    }
    let part = |(i, sum): (usize, &DVec2)| {
        let m2 = ((i + 2) * (i + 2)) as f64;
        0.5 * m2 / (m2 - 1.0) * sum.length_squared()
    };
    sums.iter().enumerate().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(n: usize, at: impl Fn(f64) -> DVec2) -> CurveScale {
        let nodes: Vec<DVec2> = (0..n).map(|i| at(TAU * i as f64 / n as f64)).collect();
        CurveScale::of(&nodes)
    }

    fn wavy(m: u32, a: f64, radius: f64) -> CurveScale {
        curve(400, move |t| DVec2::from_angle(t) * radius * (1.0 + a * (f64::from(m) * t).cos()))
    }

    #[test]
    fn a_small_mode_relaxes_as_its_exact_solution_does() {
        for (m, radius, fall) in [(2, 1.0_f64, 100.0_f64), (3, 0.1, 2.0), (5, 30.0, 1e6)] {
            let (scale, m2) = (wavy(m, 1e-3, radius), f64::from(m * m));
            let threshold = scale.excess / fall;
            let near = |found: Option<f64>, exact: f64| (found.unwrap() / exact - 1.0).abs() < 0.06;
            let time = |flow: Flow| scale.relaxes_after(&flow, &Forcing::default(), &[], threshold);
            let r4 = radius.powi(4);
            assert!(near(time(Flow::SurfaceDiffusion), fall.ln() * r4 / (2.0 * m2 * (m2 - 1.0))), "mode {m}");
            let exponent = (m2 - 1.0) * (m2 - 1.5) + 0.5;
            assert!(near(time(Flow::Willmore), 0.5 * r4 * (fall.powf(1.0 / exponent) - 1.0)), "mode {m}");
            let steady = Flow::Elastic(0.5 / (radius * radius));
            assert!(near(time(steady), fall.ln() * r4 / (2.0 * (m2 - 1.0).powi(2))), "mode {m}");
        }
    }

    #[test]
    fn modes_beyond_the_slowest_leave_first() {
        // A hundredth of the excess in mode 2, the rest in mode 6: to half of it only mode 6 matters.
        let both = curve(400, |t| DVec2::from_angle(t) * (1.0 + 1e-3 * (6.0 * t).cos() + 3e-4 * (2.0 * t).cos()));
        let time = |share: f64| {
            both.relaxes_after(&Flow::SurfaceDiffusion, &Forcing::default(), &[], share * both.excess).unwrap()
        };
        let (half, hundredth) = (time(0.5), time(1e-4));
        assert!((half / (2_f64.ln() / 2520.0) - 1.0).abs() < 0.1 && hundredth > 0.1, "{half} {hundredth}");
        // More excess in mode 2 takes longer.
        let more = [both.excess];
        assert!(
            both.relaxes_after(&Flow::SurfaceDiffusion, &Forcing::default(), &more, 0.5 * both.excess).unwrap()
                > 10.0 * half
        );
    }

    #[test]
    fn a_time_scales_with_the_fourth_power_of_the_length_without_rounding() {
        let time = |radius: f64| {
            let scale = wavy(3, 0.2, radius);
            scale.relaxes_after(&Flow::SurfaceDiffusion, &Forcing::default(), &[], 0.01 * scale.excess).unwrap()
        };
        assert_eq!(time(1024.0), time(1.0) * 1024_f64.powi(4));
        assert_eq!(time(2_f64.powi(-30)), time(1.0) * 2_f64.powi(-120));
    }

    #[test]
    fn a_flow_that_makes_a_curve_vanish_or_unstable_has_no_time_and_neither_has_an_immersed_one() {
        let scale = wavy(2, 0.01, 1.0);
        let to = |flow: &str, share: f64| {
            scale.relaxes_after(&flow.parse().unwrap(), &Forcing::default(), &[], share * scale.excess)
        };
        // The circle vanishes at t = 1/160, and the excess goes as a power of what is left.
        assert!(to("poly:0,0,40", 0.01).is_some() && to("poly:0,0,40", 1e-60).is_none());
        // b' = -10 makes mode 2 grow on the unit circle.
        assert_eq!(to("poly:-10", 0.01), None);
        let eight = curve(400, |t| DVec2::new(t.sin(), t.sin() * t.cos()));
        assert!(
            !eight.simple && eight.relaxes_after(&Flow::SurfaceDiffusion, &Forcing::default(), &[], 0.01).is_none()
        );
        assert!((eight.radius - eight.radius_of_length).abs() == 0.0);
    }
}
