//! The branches of the scheme that a member takes: members must share them to run side by side.
//!
//! Members in the lanes of a number are advanced by one stream of instructions. Masks select what differs from lane to
//! lane; what decides which instructions are run at all is here, and nowhere else. Branches are read only from the
//! parameters of single members, compared by [`Group`](super::run::Group), and passed to the stages: no stage asks a
//! number of several lanes which branch to take.

use super::{Parameters, law::Kind};
use crate::number::{Number, Real};

/// The branches of one member, or of a group of members that share them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Branches {
    /// The step is adaptive, extrapolated from several steps of the paper.
    pub adaptive: bool,
    /// Nodes are redistributed along the curve.
    pub redistributed: bool,
    /// k and r are pulled towards the polygon's own.
    pub pulled: bool,
    /// The nodes are moved by the force of the polygon.
    pub geometric: bool,
    /// It pauses where an observable reaches a level.
    pub watched: bool,
    /// What of the law decides which instructions are run.
    pub law: Kind,
}

impl Branches {
    /// Returns whether solutions are refined: those of adaptive steps in f32. Fixed steps are off by more.
    pub fn is_refined<N: Number>(&self) -> bool {
        N::IS_SHORT && self.adaptive
    }
}

impl<T: Real> Parameters<T> {
    /// Returns the branches that a member with these parameters takes.
    pub fn branches(&self) -> Branches {
        let zero = T::of(0.0);
        let positive = |value: T| !value.le(zero);
        Branches {
            adaptive: positive(self.adaptive),
            redistributed: T::of(0.5).le(self.redistribution),
            pulled: positive(self.pull),
            geometric: T::of(0.5).le(self.geometric),
            watched: T::of(0.5).le(self.watched),
            law: self.kind_of_law(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::Flow;

    #[test]
    fn every_parameter_that_steers_shows_in_the_branches() {
        let branches = |flow: &str, change: fn(&mut Parameters<f64>)| {
            let mut p = Parameters::of_flow(&flow.parse::<Flow>().unwrap(), 1.0);
            change(&mut p);
            p.branches()
        };
        let paper = branches("surface-diffusion", |_| {});
        let none = Branches {
            adaptive: false,
            redistributed: true,
            pulled: false,
            geometric: false,
            watched: false,
            law: Kind::default(),
        };
        assert_eq!(paper, none);
        let adaptive = branches("surface-diffusion", |p| p.adaptive = 1e-3);
        assert_eq!(adaptive, Branches { adaptive: true, ..paper });
        let free = branches("surface-diffusion", |p| p.redistribution = 0.0);
        assert_eq!(free, Branches { redistributed: false, ..paper });
        assert_eq!(branches("surface-diffusion", |p| p.pull = 2.0), Branches { pulled: true, ..paper });
        let geometric = branches("surface-diffusion", |p| p.geometric = 1.0);
        assert_eq!(geometric, Branches { geometric: true, ..paper });
        assert_eq!(branches("surface-diffusion", |p| p.watched = 1.0), Branches { watched: true, ..paper });
        for (flow, degree) in [("surface-diffusion", 0), ("poly:0,-1,0,-0.0", 2), ("willmore", 3)] {
            let of_flow = branches(flow, |_| {});
            assert_eq!((of_flow.law.degree, Branches { law: paper.law, ..of_flow }), (degree, paper), "{flow}");
        }
    }
}
