//! The state of one curve, and the workspace of a step.

use glam::DVec2;

use crate::{
    number::{Number, Real},
    solver::{Blocks, Ring, System},
};

/// Fields of a state, in the order of [`State::fields`].
pub const STATE_FIELDS: usize = 7;

/// A curve with `n` nodes and the increments of its last step.
#[derive(Clone, Debug, PartialEq)]
pub struct State<N> {
    /// Nodes, x coordinate.
    pub x: Ring<N>,
    /// Nodes, y coordinate.
    pub y: Ring<N>,
    /// Curvature on the segment that ends at the node.
    pub k: Ring<N>,
    /// Length of that segment, as the scheme evolves it.
    pub r: Ring<N>,
    /// Last increment of k: where the next solve starts.
    pub dk: Ring<N>,
    /// Last increment of x.
    pub dx: Ring<N>,
    /// Last increment of y.
    pub dy: Ring<N>,
}

impl<N: Number> State<N> {
    /// A state of zeros, to be filled.
    pub fn zeros(n: usize) -> State<N> {
        let ring = || Ring::zeros(n);
        State { x: ring(), y: ring(), k: ring(), r: ring(), dk: ring(), dx: ring(), dy: ring() }
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there are no nodes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl<T: Real> State<T> {
    /// The nodes.
    pub fn positions(&self) -> impl Iterator<Item = DVec2> {
        self.x.nodes().iter().zip(self.y.nodes()).map(|(x, y)| DVec2::new(x.to_f64(), y.to_f64()))
    }

    /// The initial state of the polygon `nodes` (n ≥ 6, counter-clockwise): `r_i = |R_i|` and
    /// `k_i = angle(R_{i-1}, R_{i+1}) / 2r_i`, computed in f64 and rounded.
    ///
    /// The angle is taken as the sum of the two vertex angles, so that a corner that turns by more than π over
    /// three segments keeps its sign.
    pub fn from_nodes(nodes: &[DVec2]) -> State<T> {
        let n = nodes.len();
        let edge = |i: usize| nodes[i % n] - nodes[(i + n - 1) % n];
        let vertex_angle = |i: usize| {
            let (before, after) = (edge(i), edge(i + 1));
            before.perp_dot(after).atan2(before.dot(after))
        };
        let ring = |value: &dyn Fn(usize) -> f64| Ring::from_nodes((0..n).map(|i| T::of(value(i))));
        State {
            x: ring(&|i| nodes[i].x),
            y: ring(&|i| nodes[i].y),
            k: ring(&|i| (vertex_angle(i + n - 1) + vertex_angle(i)) / (2.0 * edge(i).length())),
            r: ring(&|i| edge(i).length()),
            ..State::zeros(n)
        }
    }

    /// The fields in the order in which the device stores them.
    pub fn fields(&self) -> [&Ring<T>; STATE_FIELDS] {
        [&self.x, &self.y, &self.k, &self.r, &self.dk, &self.dx, &self.dy]
    }

    /// The same state in f64, exactly.
    pub fn widened(&self) -> State<f64> {
        let numbers: Vec<f64> = self.to_numbers().into_iter().map(T::to_f64).collect();
        State::from_numbers(&numbers)
    }

    /// All fields one after another, `7n` numbers.
    pub fn to_numbers(&self) -> Vec<T> {
        self.fields().into_iter().flat_map(|field| field.nodes().iter().copied()).collect()
    }

    /// The inverse of [`State::to_numbers`].
    pub fn from_numbers(numbers: &[T]) -> State<T> {
        let n = numbers.len() / STATE_FIELDS;
        let field = |f: usize| Ring::from_nodes(numbers[f * n..(f + 1) * n].iter().copied());
        State { x: field(0), y: field(1), k: field(2), r: field(3), dk: field(4), dx: field(5), dy: field(6) }
    }
}

/// What a step computes on the way from the old state to the new one.
#[derive(Clone, Debug)]
pub struct Workspace<N> {
    /// The cut of the ring.
    pub blocks: Blocks,
    /// Normal velocity β of the old state.
    pub beta: Vec<N>,
    /// `r·k·β` of the old state.
    pub rkb: Vec<N>,
    /// Tangential velocity α at the nodes.
    pub alpha: Ring<N>,
    /// New lengths.
    pub r: Ring<N>,
    /// New curvatures.
    pub k: Ring<N>,
    /// New positions.
    pub x: Ring<N>,
    /// New positions.
    pub y: Ring<N>,
    /// 1/r of the new lengths.
    pub ir: Ring<N>,
    /// 1/q of the new lengths.
    pub iq: Ring<N>,
    /// Increments, as solved.
    pub dk: Ring<N>,
    /// Increments, as solved.
    pub dx: Ring<N>,
    /// Increments, as solved.
    pub dy: Ring<N>,
    /// Curvature system.
    pub curvature: System<N, 1>,
    /// Position system.
    pub position: System<N, 2>,
}

impl<N: Number> Workspace<N> {
    /// A workspace for rings cut by `blocks`.
    pub fn new(blocks: Blocks) -> Workspace<N> {
        let n = blocks.n;
        let ring = || Ring::zeros(n);
        Workspace {
            blocks,
            beta: vec![N::default(); n],
            rkb: vec![N::default(); n],
            alpha: ring(),
            r: ring(),
            k: ring(),
            x: ring(),
            y: ring(),
            ir: ring(),
            iq: ring(),
            dk: ring(),
            dx: ring(),
            dy: ring(),
            curvature: System::zeros(n),
            position: System::zeros(n),
        }
    }
}
