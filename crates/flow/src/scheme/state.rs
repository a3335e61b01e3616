//! The state of one curve, and the workspace of a step. Twin of `shaders/state.wgsl`.
//!
//! Increments are added to a curve, and changes of one formed, only here.

use glam::DVec2;

use super::{Parameters, law::Law};
use crate::{
    number::{Number, Real},
    solver::{Blocks, Memory, Ring, Solves},
};

/// Fields of a curve.
pub const CURVE_FIELDS: usize = 4;
/// Fields of the errors of an attempt.
pub const GAP_FIELDS: usize = 8;
/// Fields of the increments of a state, and of the earlier ones.
pub const INCREMENT_FIELDS: usize = 6;
/// Fields of a state, in the order of [`State::fields`].
pub const STATE_FIELDS: usize = 9 * CURVE_FIELDS + INCREMENT_FIELDS;
/// Fields of a state that the next step reads, which come first: the curve, the increments and the earlier ones, and
/// how the curve moves.
pub const NEEDED_FIELDS: usize = 3 * CURVE_FIELDS + INCREMENT_FIELDS;
/// Fields of a state whose entries are places: x and y of the curve, of the one before and of the part.
const FIELDS_OF_PLACES: [usize; 6] = {
    let (before, part) = (3 * CURVE_FIELDS + INCREMENT_FIELDS, 6 * CURVE_FIELDS + INCREMENT_FIELDS);
    [0, 1, before, before + 1, part, part + 1]
};
/// Fields of a state that mean something between two attempts, which come first.
pub const LASTING_FIELDS: usize = 6 * CURVE_FIELDS + INCREMENT_FIELDS;

/// A polygon of `n` nodes with the scheme's own curvatures and lengths.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve<N> {
    /// Nodes, x coordinate.
    pub x: Ring<N>,
    /// Nodes, y coordinate.
    pub y: Ring<N>,
    /// Curvature on the segment that ends at the node.
    pub k: Ring<N>,
    /// Length of that segment, as the scheme evolves it, less [`Parameters::r_offset`].
    pub r: Ring<N>,
}

/// The change of k, x and y over a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Increments<N> {
    /// Of the curvatures.
    pub k: Ring<N>,
    /// Of the nodes, x coordinate.
    pub x: Ring<N>,
    /// Of the nodes, y coordinate.
    pub y: Ring<N>,
}

/// The errors of an adaptive attempt so far, as changes of k and r; of the geometric form, of x and y, too.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaps<N> {
    /// Of order J-1.
    pub own: Curve<N>,
    /// Of order J-2.
    pub lower: Curve<N>,
}

/// A curve in progress: the state of a member between two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct State<N> {
    /// The last accepted curve.
    pub curve: Curve<N>,
    /// Increments of the last solve, where sweeps start; see [`start`](super::start).
    pub increments: Increments<N>,
    /// What sweeps remember next to them.
    pub earlier: Increments<N>,
    /// The derivative of the curve at the end of the last adaptive step, times the length of that step.
    pub slope: Curve<N>,
    /// The second derivative, times the square of the length.
    pub bend: Curve<N>,
    /// The curve before the last step. During an adaptive attempt: the change that it makes, so far.
    pub before: Curve<N>,
    /// The derivative there, times the length of the step before. During an attempt: that at its end, so far.
    pub slope_before: Curve<N>,
    /// The second derivative there.
    pub bend_before: Curve<N>,
    /// During an adaptive attempt: the curve at the end of the last part.
    pub part: Curve<N>,
    /// During an adaptive attempt: its errors.
    pub gaps: Gaps<N>,
}

impl<N: Number> Curve<N> {
    /// Creates a curve of zeros, to be filled.
    pub fn zeros(n: usize) -> Curve<N> {
        let ring = || Ring::zeros(n);
        Curve { x: ring(), y: ring(), k: ring(), r: ring() }
    }

    /// Returns the number of nodes.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Returns whether there are no nodes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the places of the nodes, x and y.
    #[inline(always)]
    pub fn nodes(&self) -> [&Ring<N>; 2] {
        [&self.x, &self.y]
    }

    /// Returns the fields in the order in which the device stores them.
    pub fn fields(&self) -> [&Ring<N>; CURVE_FIELDS] {
        [&self.x, &self.y, &self.k, &self.r]
    }

    /// Returns the fields in the same order, mutably.
    pub fn fields_mut(&mut self) -> [&mut Ring<N>; CURVE_FIELDS] {
        [&mut self.x, &mut self.y, &mut self.k, &mut self.r]
    }

    /// Closes all rings.
    #[inline(always)]
    pub fn close(&mut self) {
        for field in self.fields_mut() {
            field.close();
        }
    }

    /// Copies `other` in the lanes of `mask`.
    #[inline(always)]
    pub fn put(&mut self, mask: N::Mask, other: &Curve<N>) {
        for (own, other) in self.fields_mut().into_iter().zip(other.fields()) {
            for i in 0..other.len() {
                own[i] = N::select(mask, other[i], own[i]);
            }
            own.close();
        }
    }
}

impl<T: Real> Curve<T> {
    /// Returns the nodes.
    pub fn positions(&self) -> impl Iterator<Item = DVec2> {
        self.x.nodes().iter().zip(self.y.nodes()).map(|(x, y)| DVec2::new(T::exact(*x), T::exact(*y)))
    }

    /// Creates the initial curve through the polygon `nodes` (n ≥ 6): `r_i = |R_i|` and
    /// `k_i = angle(R_{i-1}, R_{i+1}) / 2r_i`, computed in f64 and rounded.
    ///
    /// The angle is the sum of the two vertex angles, so that a corner that turns by more than π over
    /// three segments keeps its sign.
    pub fn from_nodes(nodes: &[DVec2]) -> Curve<T> {
        let n = nodes.len();
        let edge = |i: usize| nodes[i % n] - nodes[(i + n - 1) % n];
        let vertex_angle = |i: usize| {
            let (before, after) = (edge(i), edge(i + 1));
            before.perp_dot(after).atan2(before.dot(after))
        };
        let ring = |value: &dyn Fn(usize) -> f64| Ring::from_nodes((0..n).map(|i| T::of(value(i))));
        Curve {
            x: Ring::from_nodes(nodes.iter().map(|node| T::nearest(node.x))),
            y: Ring::from_nodes(nodes.iter().map(|node| T::nearest(node.y))),
            k: ring(&|i| (vertex_angle(i + n - 1) + vertex_angle(i)) / (2.0 * edge(i).length())),
            r: ring(&|i| edge(i).length()),
        }
    }
}

impl<N: Number> Increments<N> {
    /// Creates zero increments.
    pub fn zeros(n: usize) -> Increments<N> {
        Increments { k: Ring::zeros(n), x: Ring::zeros(n), y: Ring::zeros(n) }
    }
}

impl<N: Number> Gaps<N> {
    /// Creates errors of zero.
    pub fn zeros(n: usize) -> Gaps<N> {
        Gaps { own: Curve::zeros(n), lower: Curve::zeros(n) }
    }

    /// Returns the fields in the order in which the device stores them.
    pub fn fields(&self) -> [&Ring<N>; GAP_FIELDS] {
        let Gaps { own: Curve { x, y, k, r }, lower } = self;
        [k, r, &lower.k, &lower.r, x, y, &lower.x, &lower.y]
    }

    /// Returns the fields in the same order, mutably.
    pub fn fields_mut(&mut self) -> [&mut Ring<N>; GAP_FIELDS] {
        let Gaps { own: Curve { x, y, k, r }, lower } = self;
        [k, r, &mut lower.k, &mut lower.r, x, y, &mut lower.x, &mut lower.y]
    }
}

impl<N: Number> State<N> {
    /// Creates a state of zeros, to be filled.
    pub fn zeros(n: usize) -> State<N> {
        State::starting(Curve::zeros(n))
    }

    /// Creates the state of `curve` before the first step.
    fn starting(curve: Curve<N>) -> State<N> {
        let n = curve.len();
        let (zeros, increments) = (|| Curve::zeros(n), || Increments::zeros(n));
        State {
            before: curve.clone(),
            curve,
            increments: increments(),
            earlier: increments(),
            slope: zeros(),
            bend: zeros(),
            slope_before: zeros(),
            bend_before: zeros(),
            part: zeros(),
            gaps: Gaps::zeros(n),
        }
    }

    /// Returns the fields in the order in which the device stores them.
    pub fn fields(&self) -> impl Iterator<Item = &Ring<N>> {
        let State { curve, increments, earlier, slope, bend, before, slope_before, bend_before, part, gaps } = self;
        let Increments { k, x, y } = increments;
        let Increments { k: ek, x: ex, y: ey } = earlier;
        let first = curve.fields().into_iter().chain([k, x, y, ek, ex, ey]);
        let others = [slope, bend, before, slope_before, bend_before, part].into_iter().flat_map(Curve::fields);
        first.chain(others).chain(gaps.fields())
    }

    /// Returns the fields in the same order, mutably.
    pub fn fields_mut(&mut self) -> impl Iterator<Item = &mut Ring<N>> {
        let State { curve, increments, earlier, slope, bend, before, slope_before, bend_before, part, gaps } = self;
        let Increments { k, x, y } = increments;
        let Increments { k: ek, x: ex, y: ey } = earlier;
        let first = curve.fields_mut().into_iter().chain([k, x, y, ek, ex, ey]);
        let others = [slope, bend, before, slope_before, bend_before, part].into_iter().flat_map(Curve::fields_mut);
        first.chain(others).chain(gaps.fields_mut())
    }
}

impl<T: Real> State<T> {
    /// Creates the state before the first step, with whole lengths.
    pub fn from_nodes(nodes: &[DVec2]) -> State<T> {
        State::starting(Curve::from_nodes(nodes))
    }

    /// Creates the state before the first step, with lengths less `r_offset`.
    pub fn with_offset(nodes: &[DVec2], r_offset: T) -> State<T> {
        let mut curve = Curve::from_nodes(nodes);
        for i in 0..nodes.len() {
            curve.r[i] = curve.r[i] - r_offset;
        }
        curve.r.close();
        State::starting(curve)
    }

    /// Returns all fields one after another: [`STATE_FIELDS`] numbers for each node.
    pub fn to_numbers(&self) -> Vec<T> {
        self.fields().flat_map(|field| field.nodes().iter().copied()).collect()
    }

    /// Inverts [`State::to_numbers`].
    pub fn from_numbers(numbers: &[T]) -> State<T> {
        let n = numbers.len() / STATE_FIELDS;
        let mut state = State::zeros(n);
        if n > 0 {
            for (field, numbers) in state.fields_mut().zip(numbers.chunks_exact(n)) {
                *field = Ring::from_nodes(numbers.iter().copied());
            }
        }
        state
    }

    /// Converts the state to another precision, rounded to the nearest numbers.
    pub fn convert<U: Real>(&self) -> State<U> {
        let mut state = State::zeros(self.curve.len());
        for (field, (to, from)) in state.fields_mut().zip(self.fields()).enumerate() {
            let converted = |v: &T| match FIELDS_OF_PLACES.contains(&field) {
                true => U::nearest(T::exact(*v)),
                false => U::of(v.to_f64()),
            };
            *to = Ring::from_nodes(from.nodes().iter().map(converted));
        }
        state
    }
}

/// The motion of the old curve, and the reciprocals of its lengths, then of the new ones.
#[derive(Clone, Debug)]
pub struct Motion<N> {
    /// The law of this step.
    pub law: Law<N>,
    /// The force along the inward normal, beside the law.
    pub force: N,
    /// What stands for φ in the position equation where forces act.
    pub damping: N,
    /// `b(k)`.
    pub b: Ring<N>,
    /// Normal velocity β.
    pub beta: Vec<N>,
    /// `r·k·β`.
    pub rkb: Vec<N>,
    /// Tangential velocity α at the nodes.
    pub alpha: Ring<N>,
    /// 1/r.
    pub ir: Ring<N>,
    /// 1/q.
    pub iq: Ring<N>,
    /// Lengths of the old polygon's edges, of the geometric form.
    pub edge: Ring<N>,
    /// The old polygon's own curvature at its nodes, of the geometric form; of a crystal g times that.
    pub bent: Ring<N>,
    /// g = γ + γ″ on the segments of a crystal.
    pub stiffness: Ring<N>,
    /// g at its nodes.
    pub stiffness_there: Ring<N>,
    /// `w = g k` of its old curvatures.
    pub weighted: Ring<N>,
    /// M on its segments.
    pub mobile: Ring<N>,
    /// M at its nodes.
    pub mobile_there: Ring<N>,
}

/// Intermediate results of a step from the old curve to the new one.
#[derive(Clone, Debug)]
pub struct Workspace<N> {
    /// The cut of the ring.
    pub blocks: Blocks,
    /// How the old curve moves.
    pub motion: Motion<N>,
    /// The new curve.
    pub new: Curve<N>,
    /// The curvature system and its solver.
    pub curvature: Memory<N, 1>,
    /// The position system and its solver.
    pub position: Memory<N, 2>,
    /// What a refined curvature lacks; empty in f64.
    pub lacks_curvature: [Ring<N>; 1],
    /// What refined positions lack; empty in f64.
    pub lacks_positions: [Ring<N>; 2],
    /// How far the nodes of the new curve have moved, where forces move them.
    pub by: [Ring<N>; 2],
    /// The gradients of the new curve's area and length, x and y of each, where they are kept.
    pub gradients: [Ring<N>; 4],
    /// How often solutions are refined, where they are.
    pub refinements: N,
    /// Whether to fill the rows of the systems even if the solver does not need them.
    pub traced: bool,
}

impl<N: Number> Workspace<N> {
    /// Creates a workspace for rings cut by `blocks`, whatever the solver.
    pub fn new(blocks: Blocks) -> Workspace<N> {
        Workspace::with(blocks, Memory::any(blocks.n), Memory::any(blocks.n))
    }

    /// Creates a workspace with what the solver `S` needs.
    pub fn for_solver<S: Solves>(blocks: Blocks) -> Workspace<N> {
        Workspace::with(blocks, Memory::of_solver::<S>(blocks.n), Memory::of_solver::<S>(blocks.n))
    }

    /// Returns the numbers that it holds per node.
    pub const fn numbers<S: Solves>() -> usize {
        // What k, x and y lack, and what the solver stores for it.
        let refined = if N::IS_SHORT { 3 + S::FACTS.numbers_to_refine } else { 0 };
        23 + S::FACTS.numbers_per_node + refined
    }

    fn with(blocks: Blocks, curvature: Memory<N, 1>, position: Memory<N, 2>) -> Workspace<N> {
        let n = blocks.n;
        let ring = || Ring::zeros(n);
        let short_ring = || Ring::zeros(if N::IS_SHORT { n } else { 0 });
        let nodes = || vec![N::default(); n];
        Workspace {
            blocks,
            motion: Motion {
                law: Law::default(),
                force: N::default(),
                damping: N::default(),
                b: ring(),
                beta: nodes(),
                rkb: nodes(),
                alpha: ring(),
                ir: ring(),
                iq: ring(),
                edge: ring(),
                bent: ring(),
                stiffness: ring(),
                stiffness_there: ring(),
                weighted: ring(),
                mobile: ring(),
                mobile_there: ring(),
            },
            new: Curve::zeros(n),
            curvature,
            position,
            lacks_curvature: [short_ring()],
            lacks_positions: [short_ring(), short_ring()],
            by: std::array::from_fn(|_| ring()),
            gradients: std::array::from_fn(|_| ring()),
            refinements: N::of(1.0),
            traced: false,
        }
    }
}

impl<N: Number> Parameters<N> {
    /// Returns the length of a segment, of which `stored` is in the state.
    #[inline(always)]
    pub fn length_of(&self, stored: N) -> N {
        stored + self.r_offset
    }
}

/// Whether the entries of a field of a curve are places.
#[inline(always)]
pub fn is_of_places(field: usize) -> bool {
    field < 2
}

/// Returns an entry of this field of a curve after an increment.
#[inline(always)]
pub fn advanced<N: Number>(field: usize, old: N, increment: N) -> N {
    if is_of_places(field) { N::moved(old, increment) } else { old + increment }
}

/// Returns how an entry of this field of a curve has changed.
#[inline(always)]
pub fn change_from<N: Number>(field: usize, old: N, new: N) -> N {
    if is_of_places(field) { N::apart(old, new) } else { new - old }
}

/// Fills this field of a curve from that of an old one and the increments.
#[inline(always)]
pub fn advance<N: Number>(field: usize, old: &Ring<N>, increment: &Ring<N>, new: &mut Ring<N>) {
    for i in 0..old.len() {
        new[i] = advanced(field, old[i], increment[i]);
    }
    new.close();
}

/// Returns the edge that ends at node i: `[Δx, Δy, |e|]`.
#[inline(always)]
pub fn edge<N: Number>(nodes: [&Ring<N>; 2], i: usize) -> [N; 3] {
    let [[_, dx, ..], [_, dy, ..]] = nodes.map(|ring| ring.rises_of_places(i));
    [dx, dy, (dx * dx + dy * dy).sqrt()]
}

/// Twice the sine of half the angle from edge `[x, y, length]` to the next one: the gap between the unit tangents.
#[inline(always)]
pub fn vertex_turn<N: Number>([ex, ey, e]: [N; 3], [fx, fy, f]: [N; 3]) -> N {
    ((ex * fy - ey * fx) / (e * f + (ex * fx + ey * fy))).twice_sin_atan()
}
