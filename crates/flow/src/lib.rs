//! The semi-implicit Lagrangian scheme of K. Mikula and D. Ševčovič, *Numerical aspects of evolution of plane curves
//! satisfying the fourth order geometric equation*: one member, in any number type and in lanes, without files or
//! threads.
//!
//! | module | holds |
//! |---|---|
//! | [`number`] | the number type of the scheme, alone and in lanes |
//! | [`flow`] | the law b(k) |
//! | [`crystal`] | surface energies and mobilities that depend on the direction |
//! | [`forcing`] | driving forces, and the area and length that are kept |
//! | [`equilibrium`] | what a flow relaxes to, and the distance from it |
//! | [`solver`] | periodic pentadiagonal systems: rows, sweeps, direct solution |
//! | [`scheme`] | the step, one file per stage, named as in `shaders/` |

pub mod crystal;
pub mod equilibrium;
pub mod flow;
pub mod forcing;
pub mod number;
pub mod scheme;
pub mod solver;
