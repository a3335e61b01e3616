//! The state of one curve, and the workspace of a step.

use glam::DVec2;

use crate::{
    number::{Number, Real},
    solver::{Blocks, Memory, Ring, Solves},
};

/// Fields of a curve.
pub const CURVE_FIELDS: usize = 4;
/// Fields of a state, in the order of [`State::fields`].
pub const STATE_FIELDS: usize = 3 * CURVE_FIELDS + 6;
/// Fields of a state that the next step reads, which come first: the curve, the increments and the earlier ones.
pub const NEEDED_FIELDS: usize = CURVE_FIELDS + 6;

/// A polygon of `n` nodes with the scheme's own curvatures and lengths.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve<N> {
    /// Nodes, x coordinate.
    pub x: Ring<N>,
    /// Nodes, y coordinate.
    pub y: Ring<N>,
    /// Curvature on the segment that ends at the node.
    pub k: Ring<N>,
    /// Length of that segment, as the scheme evolves it.
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

/// A curve in progress: the state of a member between two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct State<N> {
    /// The last accepted curve.
    pub curve: Curve<N>,
    /// Increments of the last solve, where sweeps start; see [`Start`](super::start::Start).
    pub increments: Increments<N>,
    /// What sweeps remember next to them.
    pub earlier: Increments<N>,
    /// The curve in the middle of the last extrapolated step. During an attempt: the result of its whole step.
    pub middle: Curve<N>,
    /// The curve before the last step. During an attempt: the result of its first half step.
    pub before: Curve<N>,
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

    /// Returns the fields in the order in which the device stores them.
    pub fn fields(&self) -> [&Ring<N>; CURVE_FIELDS] {
        [&self.x, &self.y, &self.k, &self.r]
    }

    /// Returns the fields in the same order, mutably.
    pub fn fields_mut(&mut self) -> [&mut Ring<N>; CURVE_FIELDS] {
        [&mut self.x, &mut self.y, &mut self.k, &mut self.r]
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
        self.x.nodes().iter().zip(self.y.nodes()).map(|(x, y)| DVec2::new(x.to_f64(), y.to_f64()))
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
            x: ring(&|i| nodes[i].x),
            y: ring(&|i| nodes[i].y),
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

impl<N: Number> State<N> {
    /// Creates a state of zeros, to be filled.
    pub fn zeros(n: usize) -> State<N> {
        let (curve, increments) = (|| Curve::zeros(n), || Increments::zeros(n));
        State { curve: curve(), increments: increments(), earlier: increments(), middle: curve(), before: curve() }
    }

    /// Returns the fields in the order in which the device stores them.
    pub fn fields(&self) -> [&Ring<N>; STATE_FIELDS] {
        let [a, b, c, d] = self.curve.fields();
        let Increments { k, x, y } = &self.increments;
        let Increments { k: ek, x: ex, y: ey } = &self.earlier;
        let [e, f, g, h] = self.middle.fields();
        let [l, m, n, o] = self.before.fields();
        [a, b, c, d, k, x, y, ek, ex, ey, e, f, g, h, l, m, n, o]
    }

    /// Returns the fields in the same order, mutably.
    pub fn fields_mut(&mut self) -> [&mut Ring<N>; STATE_FIELDS] {
        let [a, b, c, d] = self.curve.fields_mut();
        let Increments { k, x, y } = &mut self.increments;
        let Increments { k: ek, x: ex, y: ey } = &mut self.earlier;
        let [e, f, g, h] = self.middle.fields_mut();
        let [l, m, n, o] = self.before.fields_mut();
        [a, b, c, d, k, x, y, ek, ex, ey, e, f, g, h, l, m, n, o]
    }
}

impl<T: Real> State<T> {
    /// Creates the state before the first step.
    pub fn from_nodes(nodes: &[DVec2]) -> State<T> {
        let curve = Curve::from_nodes(nodes);
        let increments = Increments::zeros(nodes.len());
        State { middle: curve.clone(), before: curve.clone(), earlier: increments.clone(), increments, curve }
    }

    /// Returns all fields one after another, `18n` numbers.
    pub fn to_numbers(&self) -> Vec<T> {
        self.fields().into_iter().flat_map(|field| field.nodes().iter().copied()).collect()
    }

    /// Inverts [`State::to_numbers`].
    pub fn from_numbers(numbers: &[T]) -> State<T> {
        let n = numbers.len() / STATE_FIELDS;
        let field = |f: usize| Ring::from_nodes(numbers[f * n..(f + 1) * n].iter().copied());
        let curve = |f: usize| Curve { x: field(f), y: field(f + 1), k: field(f + 2), r: field(f + 3) };
        let increments = |f: usize| Increments { k: field(f), x: field(f + 1), y: field(f + 2) };
        let (curve_at, middle_at, before_at) = (0, NEEDED_FIELDS, NEEDED_FIELDS + CURVE_FIELDS);
        State {
            curve: curve(curve_at),
            increments: increments(CURVE_FIELDS),
            earlier: increments(CURVE_FIELDS + 3),
            middle: curve(middle_at),
            before: curve(before_at),
        }
    }

    /// Converts the state to another precision, rounded to the nearest numbers.
    pub fn convert<U: Real>(&self) -> State<U> {
        let numbers: Vec<U> = self.to_numbers().into_iter().map(|v| U::of(v.to_f64())).collect();
        State::from_numbers(&numbers)
    }
}

/// The motion of the old curve, and the reciprocals of its lengths, then of the new ones.
#[derive(Clone, Debug)]
pub struct Motion<N> {
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
        Workspace::with(blocks, S::memory(blocks.n), S::memory(blocks.n))
    }

    /// Returns the numbers that it holds per node.
    pub const fn numbers<S: Solves>() -> usize {
        10 + S::FACTS.numbers_per_node
    }

    fn with(blocks: Blocks, curvature: Memory<N, 1>, position: Memory<N, 2>) -> Workspace<N> {
        let n = blocks.n;
        let ring = || Ring::zeros(n);
        let nodes = || vec![N::default(); n];
        Workspace {
            blocks,
            motion: Motion { b: ring(), beta: nodes(), rkb: nodes(), alpha: ring(), ir: ring(), iq: ring() },
            new: Curve::zeros(n),
            curvature,
            position,
            traced: false,
        }
    }
}

/// Returns the edge that ends at node i: `[Δx, Δy, |e|]`.
#[inline(always)]
pub fn edge<N: Number>(curve: &Curve<N>, i: usize) -> [N; 3] {
    let ([_, xm, x, ..], [_, ym, y, ..]) = (curve.x.window(i), curve.y.window(i));
    let (dx, dy) = (x - xm, y - ym);
    [dx, dy, (dx * dx + dy * dy).sqrt()]
}
