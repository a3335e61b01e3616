//! The referee: an independent solver of the same flows for smooth closed curves, with a known error.
//!
//! # Equations
//!
//! In equal arclength a curve of length L is its tangent angle `α + ϑ(α)`, `0 ≤ α < 2π`, with ϑ periodic. Let `ℓ =
//! L/2π`, `κ = 1 + ϑ'` (which is kℓ), `B = ℓ³ b(κ/ℓ)` and `f = κ(B - κ'')`. In the time τ with `dt = ℓ⁴ dτ` the flow is
//!
//! ```text
//! dϑ/dτ = -ϑ'''' + B' + Vκ,   V' = f - <f>,   d ln ℓ/dτ = -<f>,   dA/dτ = -2πℓ² <B>.
//! ```
//!
//! The stiff part then has constant coefficients, whatever the length does. In t a circle under Willmore flow becomes
//! round algebraically, in τ exponentially.
//!
//! # Method
//!
//! The unknowns are ln ℓ, t, A and the Fourier coefficients of ϑ up to n/3. Products are formed on n nodes, and those
//! of two factors have no aliases. A step is an exponential Euler step, which solves the stiff part exactly,
//! extrapolated from 1, 2, … 8 parts to order 8. With the coefficients `ê_m` of `e^{i(α+ϑ)}`, `L² - 4πA = L² Σ (1 -
//! 1/m)|ê_m|²` and `A = πℓ² Σ |ê_m|²/m`, so that the excess `L²/(4πA) - 1` is a quotient of sums without cancellation.
//! It is the limit n → ∞ of the scheme's, which is measured from the regular polygon.
//!
//! Everything is computed twice, with n and 2n nodes and with two tolerances, and n is doubled until both agree. The
//! difference is the error that is told; the coarse solution has most of it.
//!
//! Nothing is shared with the scheme but the shapes and the coefficients of b.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use super::fourier::{Fourier, conjugate, set_real, signed};
use curvelax_base::error::{Error, Result};
use curvelax_flow::flow::{Flow, MAX_DEGREE};

/// Parts of the last step that is extrapolated from, and so the order.
const ORDER: usize = 8;
/// Bounds on the points at which the formula of a curve is evaluated.
const SAMPLES: [usize; 2] = [256, 1 << 14];
/// Coefficients of the speed above this part of its mean, in the last third, mean that the formula is not resolved.
const RESOLVED: f64 = 1e-11;
/// Bounds on n.
const NODES: [usize; 2] = [64, 1 << 13];
/// Coefficients of κ beyond the first n are below this part of all.
const NEGLIGIBLE: f64 = 1e-8;
/// Tolerances of the coarse solution and of all finer ones: the error of a step relative to ϑ, ln ℓ and t.
const TOLERANCES: [f64; 2] = [1e-9, 1e-11];
/// Smallest root mean square of ϑ that errors are relative to: below it, rounding would be a matter of length of steps.
const MIN_BEND: f64 = 0.1;
/// Relative difference of two solutions that agree.
const AGREED: f64 = 1e-6;
/// Part of the excess at the start below which the excess is not judged relative to itself, and smallest such start.
const MIN_EXCESS: f64 = 1e-3;
/// Least error that is told: rounding.
const ROUNDING: f64 = 1e-12;
/// First step, in τ, and bounds on the growth of the next.
const FIRST: f64 = 1e-6;
const GROWTH: [f64; 2] = [0.2, 4.0];
/// Steps times nodes after which a curve does not reach what is asked for. One that does takes some 60 steps.
const MAX_WORK: usize = 1 << 21;
/// Coefficients of ϑ below this are rounding.
const VANISHED: f64 = 1e-13;
/// Root mean square of ϑ below which a curve is a circle.
const ROUND: f64 = 1e-9;
/// Iterations of a search within a step, and the error in its unit at which it ends.
const MAX_SEARCH: usize = 60;
const FOUND: f64 = 1e-13;

/// A curve at a time, by the referee.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Truth {
    /// Time, in length⁴.
    pub t: f64,
    /// Length.
    pub length: f64,
    /// Area.
    pub area: f64,
    /// `∮(½k² + λ) ds`; λ = 0 unless the flow is elastic.
    pub energy: f64,
    /// `L²/(4πA) - 1`.
    pub excess: f64,
    /// Relative difference from a solution with half the nodes and a wider tolerance: of the time, if that was looked
    /// for, otherwise the largest of the observables. At least the difference of the area from the integral of its own
    /// equation.
    pub error: f64,
    /// Nodes at the start.
    pub nodes: usize,
}

/// A smooth curve and a flow.
pub struct Referee {
    /// Fourier coefficients 1, 2, … of ϑ at the start.
    bend: Vec<DVec2>,
    /// `ℓ` at the start: the unit of length inside.
    unit: f64,
    /// Coefficients of b in that unit.
    law: [f64; MAX_DEGREE],
    penalty: f64,
    excess: f64,
}

impl Referee {
    /// Prepares the closed curve `u ↦ point(u)`, of period 1, counter-clockwise, under `flow`.
    ///
    /// ```
    /// use curvelax_flow::flow::Flow;
    /// use curvelax_study::truth::Referee;
    /// use glam::DVec2;
    ///
    /// let ellipse = |u: f64| DVec2::from_angle(std::f64::consts::TAU * u) * DVec2::new(2.0, 1.0);
    /// let referee = Referee::new(ellipse, &Flow::SurfaceDiffusion)?;
    /// assert!((referee.at(0.5)?.length - 8.93765992).abs() < 1e-8);
    /// # Ok::<(), curvelax_base::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Request`] if it is not smooth, or does not turn round once, and for a crystal.
    pub fn new(point: impl Fn(f64) -> DVec2, flow: &Flow) -> Result<Referee> {
        if flow.is_crystal() {
            return Err(refused("its energy or its mobility depends on the direction, and here neither does"));
        }
        let mut samples = SAMPLES[0];
        let (bend, unit) = loop {
            if let Some(resolved) = resolve(&point, samples)? {
                break resolved;
            }
            samples *= 2;
            if samples > SAMPLES[1] {
                let points = SAMPLES[1];
                return Err(refused(&format!("{points} points do not resolve it, as if it had a corner or a cusp")));
            }
        };
        let mut law = flow.coefficients();
        law.iter_mut().zip(2..).for_each(|(c, j)| *c *= unit.powi(4 - j));
        let mut referee = Referee { bend, unit, law, penalty: flow.length_penalty(), excess: 0.0 };
        referee.excess = SpectralRun::new(&referee, referee.nodes(), TOLERANCES[1]).shape().excess;
        Ok(referee)
    }

    /// The excess at the start.
    pub fn excess(&self) -> f64 {
        self.excess
    }

    /// The curve at the time `t`, not negative, in length⁴.
    ///
    /// # Errors
    /// [`Error::Failed`] if solutions of n and 2n nodes do not agree, or the curve does not exist for so long.
    pub fn at(&self, t: f64) -> Result<Truth> {
        let end = t / self.unit.powi(4);
        let what = format!("at t = {t:e}");
        let difference = |coarse: &Truth, fine: &Truth| {
            let observables = |of: &Truth| [of.length, of.area, of.energy];
            let pairs = observables(coarse).into_iter().zip(observables(fine));
            let excess =
                (coarse.excess - fine.excess).abs() / fine.excess.max(MIN_EXCESS * self.excess.max(MIN_EXCESS));
            pairs.map(|(one, other)| (one / other - 1.0).abs()).fold(excess, f64::max)
        };
        self.agreed(&what, |run| if end > 0.0 { 1.0 - run.form.rest[TIME] / end } else { 0.0 }, difference)
    }

    /// The first time at which the excess is at or below `excess`, of which it is a root. A dip that is over within a
    /// step is not seen; steps are short beside the time in which a shape changes.
    ///
    /// # Errors
    /// [`Error::Request`] for a circle; [`Error::Failed`] if solutions of n and 2n nodes do not agree, or the excess
    /// does not fall so far.
    pub fn time_of_excess(&self, excess: f64) -> Result<Truth> {
        if self.bend.iter().all(|c| c.length() < ROUND) {
            return Err(refused("it is a circle and has no relaxation time"));
        }
        let what = format!("until the excess is {excess:e}");
        let difference =
            |coarse: &Truth, fine: &Truth| if coarse.t == fine.t { 0.0 } else { (coarse.t / fine.t - 1.0).abs() };
        self.agreed(&what, |run| (run.shape().excess / excess).ln(), difference)
    }

    /// Follows the curve until `goal` falls to 0, with ever more nodes until the `difference` of two solutions is
    /// small.
    fn agreed(
        &self,
        what: &str,
        goal: impl Fn(&mut SpectralRun) -> f64,
        difference: impl Fn(&Truth, &Truth) -> f64,
    ) -> Result<Truth> {
        let solution = |nodes: usize, tolerance: f64| {
            let mut run = SpectralRun::new(self, nodes, tolerance);
            run.until(&goal)
                .map_err(|problem| Error::Failed(format!("the referee, {what}, with {nodes} nodes: {problem}")))?;
            Ok(self.truth(&mut run, nodes))
        };
        let mut nodes = self.nodes();
        let mut coarse = solution(nodes, TOLERANCES[0])?;
        loop {
            nodes *= 2;
            let fine = solution(nodes, TOLERANCES[1])?;
            let error = difference(&coarse, &fine).max(fine.error);
            if error <= AGREED {
                return Ok(Truth { error: error.max(ROUNDING), ..fine });
            }
            if nodes >= NODES[1] {
                return Err(Error::Failed(format!(
                    "the referee, {what}: solutions with {} and {nodes} nodes differ by {error:.1e}, and {AGREED:e} is \
                     allowed: the curve is too rough, or becomes singular",
                    nodes / 2
                )));
            }
            coarse = fine;
        }
    }

    /// Nodes of the first solution: enough for the curve at the start.
    fn nodes(&self) -> usize {
        let least = NEGLIGIBLE * largest(&self.bend, MIN_BEND);
        let last = (0..self.bend.len()).rev().find(|i| weight(&self.bend, *i) > least).unwrap_or(0);
        (3 * (last + 2)).next_power_of_two().clamp(NODES[0], NODES[1] / 2)
    }

    /// What a solution shows, in the user's units; its error is that of the area against its own equation.
    fn truth(&self, run: &mut SpectralRun, nodes: usize) -> Truth {
        let ShapeRatios { excess, area, .. } = run.shape();
        let [ln_size, t, own_area] = run.form.rest;
        let size = self.unit * ln_size.exp();
        let error = (area * (2.0 * ln_size).exp() / own_area - 1.0).abs();
        let bent: f64 = run.form.bend.iter().zip(1..).map(|(c, m)| f64::from(m * m) * c.length_squared()).sum();
        let (length, area) = (TAU * size, area * size * size);
        let energy = PI / size * (1.0 + 2.0 * bent) + self.penalty * length;
        Truth { t: t * self.unit.powi(4), length, area, energy, excess, error, nodes }
    }
}

fn refused(problem: &str) -> Error {
    Error::Request(format!("the referee solves for smooth curves that turn round once: {problem}"))
}

/// The Fourier coefficients of ϑ and ℓ of a curve from `samples` points at equal steps of u; `None` if they are too
/// few.
///
/// The coefficients are integrals over α, which are taken over u: a periodic integrand has no error but aliases.
fn resolve(point: &impl Fn(f64) -> DVec2, samples: usize) -> Result<Option<(Vec<DVec2>, f64)>> {
    let (fourier, share) = (Fourier::new(samples), 1.0 / samples as f64);
    let mut position: Vec<DVec2> = (0..samples).map(|j| point(j as f64 * share)).collect();
    fourier.transform(&mut position);
    let mut velocity = vec![DVec2::ZERO; samples];
    for (m, c) in position.iter().enumerate() {
        velocity[(samples - m) % samples] = signed(m, samples) * share * c.perp();
    }
    fourier.transform(&mut velocity);
    let mut speed: Vec<DVec2> = velocity.iter().map(|v| DVec2::new(v.length(), 0.0)).collect();
    fourier.transform(&mut speed);
    let unit = share * speed[0].x;
    let tail = speed[samples / 3..samples / 2].iter().map(|c| share * c.length()).fold(0.0, f64::max);
    if tail.is_nan() || tail > RESOLVED * unit {
        return Ok(None);
    }
    let turns = (0..samples).map(|j| velocity[j].angle_to(velocity[(j + 1) % samples]));
    let turning = (turns.clone().sum::<f64>() / TAU).round() + 0.0; // no -0
    if turning != 1.0 {
        return Err(refused(&format!("this one turns {turning} times")));
    }
    let mut way = vec![DVec2::ZERO; samples];
    for m in 1..samples / 2 {
        set_real(&mut way, m, -share / (unit * m as f64) * speed[m].perp());
    }
    fourier.transform(&mut way);
    let mut bend = vec![DVec2::ZERO; samples.min(NODES[1]) / 3];
    let mut angle = velocity[0].to_angle();
    for (j, turn) in turns.enumerate() {
        let alpha = TAU * j as f64 * share + way[j].x;
        let wave = DVec2::from_angle(-alpha);
        let mut term = (angle - alpha) * share * velocity[j].length() / unit * wave;
        for c in &mut bend {
            *c += term;
            term = wave.rotate(term);
        }
        angle += turn;
    }
    // As long as there are higher ones to compute.
    let tail = (2 * bend.len() / 3..bend.len()).map(|m| weight(&bend, m)).fold(0.0, f64::max);
    Ok((samples > NODES[1] || tail <= 0.1 * NEGLIGIBLE * largest(&bend, 1.0)).then_some((bend, unit)))
}

/// Amplitude of the coefficient at `i` in ϑ'.
fn weight(bend: &[DVec2], i: usize) -> f64 {
    (i + 1) as f64 * bend[i].length()
}

/// The largest of these amplitudes, or `least`.
fn largest(bend: &[DVec2], least: f64) -> f64 {
    (0..bend.len()).map(|i| weight(bend, i)).fold(least, f64::max)
}

/// The curve at a time: Fourier coefficients 1, 2, … of ϑ; [`SIZE`], [`TIME`] and [`AREA`]. Or their velocities in τ,
/// without the stiff part.
#[derive(Clone, Debug)]
struct TangentAngle {
    bend: Vec<DVec2>,
    rest: [f64; 3],
}

/// Place of ln ℓ.
const SIZE: usize = 0;
/// Place of t.
const TIME: usize = 1;
/// Place of the area by its own equation, from which that of the shape departs by the error.
const AREA: usize = 2;

impl TangentAngle {
    fn new(modes: usize) -> TangentAngle {
        TangentAngle { bend: vec![DVec2::ZERO; modes], rest: [0.0; 3] }
    }

    /// Adds `factor` times the difference of two others.
    fn add(&mut self, factor: f64, new: &TangentAngle, old: &TangentAngle) {
        for ((sum, new), old) in self.bend.iter_mut().zip(&new.bend).zip(&old.bend) {
            *sum += factor * (*new - *old);
        }
        for ((sum, new), old) in self.rest.iter_mut().zip(&new.rest).zip(&old.rest) {
            *sum += factor * (new - old);
        }
    }

    /// Root mean square of ϑ over √2.
    fn size(&self) -> f64 {
        self.bend.iter().map(|c| c.length_squared()).sum::<f64>().sqrt()
    }
}

/// The shape of a curve.
struct ShapeRatios {
    excess: f64,
    /// Area over ℓ².
    area: f64,
}

/// A solution under way.
struct SpectralRun {
    form: TangentAngle,
    velocity: TangentAngle,
    tolerance: f64,
    law: [f64; MAX_DEGREE],
    fourier: Fourier,
    /// Two fields on the nodes.
    grid: Vec<DVec2>,
    kappa: Vec<f64>,
}

impl SpectralRun {
    fn new(referee: &Referee, nodes: usize, tolerance: f64) -> SpectralRun {
        let modes = (nodes / 3).min(referee.bend.len());
        let mut run = SpectralRun {
            form: TangentAngle { bend: referee.bend[..modes].to_vec(), rest: [0.0; 3] },
            velocity: TangentAngle::new(modes),
            tolerance,
            law: referee.law,
            fourier: Fourier::new(nodes),
            grid: vec![DVec2::ZERO; nodes],
            kappa: vec![0.0; nodes],
        };
        run.form.rest[AREA] = run.shape().area;
        run
    }

    /// Advances to where `goal`, positive so far, is 0.
    fn until(&mut self, goal: &impl Fn(&mut SpectralRun) -> f64) -> Result<(), String> {
        let (mut before, mut length) = (goal(self), FIRST);
        if before <= 0.0 {
            return Ok(());
        }
        let mut work = 0;
        while work < MAX_WORK {
            self.trim();
            work += self.grid.len();
            self.set_velocity();
            let old = self.form.clone();
            let next = self.accepted(&mut length)?;
            let after = goal(self);
            if after <= 0.0 {
                return self.search(goal, &old, [before, after], length);
            }
            (before, length) = (after, next);
        }
        Err("not reached: the curve takes too many steps, as if it came to rest before".into())
    }

    /// Makes a step of at most `length`, which becomes its length, and returns that of the next.
    fn accepted(&mut self, length: &mut f64) -> Result<f64, String> {
        let old = self.form.clone();
        loop {
            let error = self.step(&old, *length);
            let factor = (0.9 * (self.tolerance / error).powf(1.0 / ORDER as f64)).clamp(GROWTH[0], GROWTH[1]);
            if error <= self.tolerance {
                return Ok(*length * factor);
            }
            *length *= factor;
            if *length < FIRST * FIRST {
                return Err("its steps become ever shorter: the curve becomes singular".into());
            }
        }
    }

    /// Repeats the last step with another length until `goal`, which had these values at both ends, is 0.
    fn search(
        &mut self,
        goal: &impl Fn(&mut SpectralRun) -> f64,
        old: &TangentAngle,
        values: [f64; 2],
        length: f64,
    ) -> Result<(), String> {
        let ([mut low, mut high], [mut above, mut below]) = ([0.0, length], values);
        for _ in 0..MAX_SEARCH {
            let middle = low + (high - low) * above / (above - below);
            self.step(old, middle);
            let value = goal(self);
            if value.abs() < FOUND || middle == low || middle == high {
                return Ok(());
            }
            // The Illinois rule: an end that stays counts for less, so that the other does not stay there.
            if value > 0.0 {
                (low, above, below) = (middle, value, 0.5 * below);
            } else {
                (high, below, above) = (middle, value, 0.5 * above);
            }
        }
        Ok(())
    }

    /// Makes a step from `old`, of which the velocity is known, and returns its error: the difference of orders 8 and
    /// 7.
    fn step(&mut self, old: &TangentAngle, length: f64) -> f64 {
        let (mut sum, mut gap) = (old.clone(), TangentAngle::new(old.bend.len()));
        let first = self.velocity.clone();
        for parts in 1..=ORDER {
            let h = length / parts as f64;
            let decays: Vec<f64> = (1..=old.bend.len()).map(|m| (-h * (m as f64).powi(4)).exp_m1()).collect();
            self.form.clone_from(old);
            for part in 0..parts {
                match part {
                    0 => self.velocity.clone_from(&first),
                    _ => self.set_velocity(),
                }
                self.euler(h, &decays);
            }
            let weight = |least: usize| {
                let others = (least..=ORDER).filter(|other| *other != parts);
                others.map(|other| parts as f64 / (parts as f64 - other as f64)).product::<f64>()
            };
            let (high, low) = (weight(1), if parts == 1 { 0.0 } else { weight(2) });
            sum.add(high, &self.form, old);
            gap.add(high - low, &self.form, old);
        }
        self.velocity = first;
        self.form = sum;
        // A maximum passes over what is not a number.
        let is_finite = self.form.bend.iter().all(|c| c.is_finite()) && self.form.rest.iter().all(|v| v.is_finite());
        if !is_finite {
            return f64::INFINITY;
        }
        let bend = gap.size() / self.form.size().max(MIN_BEND);
        bend.max(gap.rest[SIZE].abs()).max((gap.rest[TIME] / self.form.rest[TIME]).abs())
    }

    /// An exponential Euler step h: `c ← e^{-m⁴h} c + (1 - e^{-m⁴h})/m⁴ · v`, with the decays `e^{-m⁴h} - 1`.
    fn euler(&mut self, h: f64, decays: &[f64]) {
        let modes = self.form.bend.iter_mut().zip(&self.velocity.bend).zip(decays.iter().zip(1..));
        for ((c, v), (decay, m)) in modes {
            *c += *decay * (*c - *v / f64::from(m).powi(4));
        }
        for (value, v) in self.form.rest.iter_mut().zip(self.velocity.rest) {
            *value += h * v;
        }
    }

    /// Computes the velocity of the form without the stiff part.
    fn set_velocity(&mut self) {
        let SpectralRun { form, velocity, law, fourier, grid, kappa, .. } = self;
        let (n, modes, share) = (grid.len(), form.bend.len(), 1.0 / grid.len() as f64);
        // κ + iκ''
        grid.fill(DVec2::ZERO);
        grid[0] = DVec2::X;
        for (i, c) in form.bend.iter().enumerate() {
            let m = (i + 1) as f64;
            let (slope, both) = (m * c.perp(), DVec2::new(1.0, -m * m));
            grid[n - 1 - i] = both.rotate(slope);
            grid[i + 1] = both.rotate(conjugate(slope));
        }
        fourier.transform(grid);
        // f + iB
        let size = form.rest[SIZE].exp();
        let mut scaled = *law;
        scaled.iter_mut().zip(2..).for_each(|(c, j)| *c *= size.powi(4 - j));
        for (at, kappa) in grid.iter_mut().zip(kappa.iter_mut()) {
            let b = scaled.iter().rev().fold(0.0, |sum, c| (sum + c) * at.x);
            *kappa = at.x;
            *at = DVec2::new(at.x * (b - at.y), b);
        }
        fourier.transform(grid);
        let mean = share * grid[0];
        velocity.rest = [-mean.x, size.powi(4), -TAU * size * size * mean.y];
        // V
        for i in 0..modes {
            let (z, w) = (grid[i + 1], conjugate(grid[n - 1 - i]));
            let (f, b) = (0.5 * share * (z + w), -0.5 * share * (z - w).perp());
            let m = (i + 1) as f64;
            velocity.bend[i] = m * b.perp();
            set_real(grid, i + 1, -1.0 / m * f.perp());
        }
        grid[0] = DVec2::ZERO;
        grid[modes + 1..n - modes].fill(DVec2::ZERO);
        fourier.transform(grid);
        // Vκ
        for (at, kappa) in grid.iter_mut().zip(kappa.iter()) {
            *at = DVec2::new(at.x * kappa, 0.0);
        }
        fourier.transform(grid);
        for (v, product) in velocity.bend.iter_mut().zip(&grid[1..]) {
            *v += share * *product;
        }
    }

    /// Shape of the curve.
    fn shape(&mut self) -> ShapeRatios {
        let SpectralRun { form, fourier, grid, .. } = self;
        let n = grid.len();
        grid.fill(DVec2::ZERO);
        form.bend.iter().enumerate().for_each(|(i, c)| set_real(grid, i + 1, *c));
        fourier.transform(grid);
        for (j, at) in grid.iter_mut().enumerate() {
            *at = DVec2::from_angle(TAU * j as f64 / n as f64 + at.x);
        }
        fourier.transform(grid);
        let (mut deficit, mut area) = (0.0, 0.0);
        for (m, c) in grid.iter().enumerate().skip(1) {
            let (m, power) = (signed(m, n), c.length_squared() / (n * n) as f64);
            deficit += (1.0 - 1.0 / m) * power;
            area += power / m;
        }
        ShapeRatios { excess: deficit / area, area: PI * area }
    }

    /// Halves the nodes while the upper half of the coefficients has vanished.
    fn trim(&mut self) {
        while self.grid.len() > NODES[0] {
            let half = self.grid.len() / 2;
            if self.form.bend.iter().skip(half / 3).any(|c| c.length() > VANISHED) {
                return;
            }
            self.fourier = Fourier::new(half);
            (self.grid, self.kappa) = (vec![DVec2::ZERO; half], vec![0.0; half]);
            self.form.bend.truncate(half / 3);
            self.velocity.bend.truncate(half / 3);
        }
    }
}
