//! Checks of what acts on the curves: crystals, driving forces and constraints.

use std::f64::consts::PI;

use crate::request::{
    spec::{Pace, PositionForm, Spec},
    values::check_reduced_area,
};
use curvelax_base::{
    error::{Error, Result},
    text::{number, rounded},
};
use curvelax_curve::Sampling;
use curvelax_flow::{flow::Flow, forcing::Conserved};

impl Spec {
    /// Refuses what crystals do not have, and waves that the nodes do not resolve.
    pub(super) fn check_crystals(&self) -> Result<()> {
        let (energy, diffusivity) = (&self.energy, &self.diffusivity);
        let given = energy.as_ref().map(|of| ("energy", of.to_string()));
        let Some((key, value)) = given.or(diffusivity.as_ref().map(|of| ("diffusivity", of.to_string()))) else {
            return Ok(());
        };
        let refused = |problem: &str, allowed: &str| Err(Error::value(key, &value, problem, allowed));
        if self.flow != Flow::SurfaceDiffusion.into() {
            let problem = format!("--flow {} has none, only surface-diffusion has", self.flow);
            return refused(&problem, &format!("leave out --{key} or --flow"));
        }
        self.check_geometric("with it a crystal creeps at rest", &format!("--{key} {value}"))?;
        let highest = self.highest_wave().unwrap_or(0);
        match highest as usize > self.points / 4 {
            true => {
                let problem = format!("{} nodes resolve no wave above {}", self.points, self.points / 4);
                refused(&problem, &format!("use --points {} or more, or a lower M", 4 * highest))
            }
            false => Ok(()),
        }
    }

    /// Refuses the paper's form, for the reason `in_paper`, where something is `given` for which nodes move in the
    /// geometric form.
    fn check_geometric(&self, in_paper: &str, given: &str) -> Result<()> {
        match self.form {
            Some(PositionForm::Paper) => {
                let problem = format!("{in_paper}, and {given} is given");
                Err(Error::value("form", "paper", &problem, "use --form geometric, or leave it out"))
            }
            _ => Ok(()),
        }
    }

    /// Refuses what a driven flow does not have.
    pub(super) fn check_forcing(&self) -> Result<()> {
        self.check_conserved()?;
        self.check_stretch()?;
        let Some(drive) = &self.drive else { return Ok(()) };
        if let Some(conserved) = self.conserve {
            let reason = match conserved.keeps_area() {
                true => "the pressure that keeps the area takes any force away",
                false => "the scheme has no multiplier that keeps the length against a force",
            };
            let problem = format!("--conserve {conserved} is given, and {reason}");
            return Err(Error::value("drive", drive, &problem, "leave out one of the two"));
        }
        let given = format!("--drive {drive}");
        self.check_geometric("its steps do not see errors of the nodes", &given)
    }

    /// Refuses what a flow that keeps its area or its length does not have.
    fn check_conserved(&self) -> Result<()> {
        let Some(conserved) = self.conserve else {
            return match &self.conserve_at {
                Some(at) if !self.sweep.has("conserve") => {
                    let problem = "nothing is kept there";
                    Err(Error::value("conserve-at", listed(at), problem, "add --conserve, or leave it out"))
                }
                _ => Ok(()),
            };
        };
        let refused = |problem: &str, allowed: &str| Err(Error::value("conserve", conserved, problem, allowed));
        if self.has_crystals() || *self.flow.typical() == Flow::SurfaceDiffusion {
            let allowed = "leave it out, or use --flow willmore, elastic or poly";
            return refused("surface diffusion keeps the area anyway, and could not keep the length", allowed);
        }
        let given = format!("--conserve {conserved}");
        self.check_geometric("it would not keep anything exactly", &given)?;
        if conserved == Conserved::AreaAndLength {
            if let (true, Pace::Fixed(_)) = (self.refine, self.pace()) {
                let problem = format!("what fixed steps leave in the energy at rest is not known, with {given}");
                return Err(Error::value("refine", true, &problem, "use --adaptive, and no --tau"));
            }
            if let Some(excess) = self.relax_at {
                let problem = "with area and length the excess stays as it is";
                return Err(Error::value("relax-at", number(excess), problem, "use --relax-to, a share of the energy"));
            }
            if self.stop_when_relaxed == Some(true) {
                let problem = "with area and length the end is known only when it is reached";
                return Err(Error::value("stop-when-relaxed", true, problem, "leave it out"));
            }
        }
        self.check_kept(conserved)
    }

    /// Checks the numbers of `--conserve-at`.
    fn check_kept(&self, conserved: Conserved) -> Result<()> {
        let Some(at) = &self.conserve_at else { return Ok(()) };
        let refused = |problem: &str, allowed: &str| Err(Error::value("conserve-at", listed(at), problem, allowed));
        let count = if conserved == Conserved::AreaAndLength { 2 } else { 1 };
        if at.len() != count {
            let problem = format!("--conserve {conserved} keeps {count} of the two");
            return refused(&problem, if count == 2 { "give the area and the length" } else { "give one number" });
        }
        if !at.iter().all(|number| *number > 0.0 && number.is_finite()) {
            return refused("not an area or a length", "use finite numbers above 0");
        }
        match at[..] {
            [area, length] => {
                let n = self.points as f64;
                let [circle, regular] = [PI, n * (PI / n).tan()].map(|square| 2.0 * (square * area).sqrt());
                let what = match length {
                    _ if length <= circle => "a circle".to_string(),
                    _ if length <= regular => format!("a regular polygon of {n} nodes"),
                    _ => return Ok(()),
                };
                let allowed = format!("use a length above {}, or a smaller area", rounded(regular, 8));
                refused(&format!("{what} of this area is as long or longer"), &allowed)
            }
            _ => Ok(()),
        }
    }

    fn check_stretch(&self) -> Result<()> {
        let Some(reduced) = &self.reduced_area else { return Ok(()) };
        let refused = |problem: &str, allowed: &str| Err(Error::value("reduced-area", reduced, problem, allowed));
        if self.conserve != Some(Conserved::AreaAndLength) && !self.sweep.has("conserve") {
            return refused("it is kept only with --conserve area,length", "add that");
        }
        if let Some(at) = &self.conserve_at {
            let problem = format!("--conserve-at {} gives another one", listed(at));
            return refused(&problem, "leave out one of the two");
        }
        if self.sampling == Sampling::Points {
            return refused("points that are nodes stay where they are", "use --sampling arclength");
        }
        check_reduced_area(*reduced.typical())
    }
}

/// Numbers with commas between them.
fn listed(numbers: &[f64]) -> String {
    numbers.iter().copied().map(number).collect::<Vec<_>>().join(",")
}
