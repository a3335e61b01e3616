//! The semi-implicit Lagrangian scheme of Mikula and Ševčovič, written once, generic over the number.
//!
//! *Theory.* One step of length τ ([`step`](step::Steps::step)) goes through four stages, each in its own file with a
//! WGSL twin of the same stem in `shaders/`:
//!
//! 1. [`redistribution`]: velocity β and tangential velocity α of the old state, then the new lengths r;
//! 2. [`curvature`]: the pentadiagonal system for the increment of k;
//! 3. [`position`]: one matrix, two right-hand sides, for the increments of x and y;
//! 4. [`observe`]: sums and maxima of the new state, which determine status and relaxation events.
//!
//! The paper's `𝓑_i` averages φ over segments i and i-1; this is a misprint (`docs/internals/method.md`), and the
//! average here is over i and i+1. Both systems are written for the increment δ over the step: the right-hand side is
//! the residual of the old state in node differences, so no digits are lost to the size of x.
//!
//! [`forcing`] adds to stages 1 and 3 what acts beside the flow.
//!
//! With adaptive steps, [`extrapolation`] combines rows of 1, 2, … J of them into one of order J, [`pace`] chooses the
//! length and the order and tracks the time, and [`dense`] gives what lies inside a step. [`decay`] records how fast
//! the excess falls.
//!
//! *Practice.* Node i = 1…n of the paper is index i-1 here. `k[i]` and `r[i]` live on the segment that ends at node i,
//! `q[i]` between the middles of segments i and i+1. A [`Curve`] is x, y, k and r; a [`State`] is a curve with what the
//! next step needs from the last one; a [`Workspace`] holds the intermediate results of a step, and serves as its trace
//! for the conformance test.

pub mod branches;
pub mod curvature;
pub mod decay;
pub mod dense;
pub mod evolve;
pub mod excess;
pub mod extrapolation;
pub mod forces;
pub mod forcing;
pub mod law;
pub mod member;
pub mod observe;
pub mod pace;
pub mod position;
pub mod pull;
pub mod redistribution;
pub mod run;
pub mod start;
pub mod state;
pub mod status;
pub mod step;

pub use branches::Branches;
pub use member::Parameters;
pub use state::{Curve, Increments, Motion, State, Workspace};
pub use status::Status;
