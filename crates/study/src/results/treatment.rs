//! How members were treated before they ran or for their limits: corners that were rounded off, nodes that were added.

use serde::{Deserialize, Serialize};

use curvelax_base::text::{count, plural, significant};
use curvelax_ensemble::{Mollified, Outcome, Treated, member::mollifier::MAX_VERTEX_TURN};

/// How corners of members were rounded off (`ensemble/mollifier.rs`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MollifiedMembers {
    /// Members that were changed.
    pub members: u64,
    /// Maximum rounds for one member.
    pub most_rounds: u32,
    /// Largest relative change of area, before it was put back.
    pub largest_area_change: f64,
    /// Members that are not resolved, for one of the next three reasons.
    pub unresolved: u64,
    /// Members that cross themselves at the start, though their outline does not.
    pub crossed: u64,
    /// Members that start with a turn of more than 1.5 rad at a node.
    pub sharp: u64,
    /// Members whose area changed by more than a tenth.
    pub distorted: u64,
    /// Members of outlines without corners, a spline each.
    #[serde(default)]
    pub splines: u64,
    /// Members of outlines with corners among other points.
    #[serde(default)]
    pub cornered: u64,
    /// Members of outlines all of whose points are corners.
    #[serde(default)]
    pub polygons: u64,
    /// Members of outlines whose corners were rounded before nodes were placed, and the largest relative change of area
    /// by that, before it was put back.
    #[serde(default)]
    pub rounded: u64,
    /// See there.
    #[serde(default)]
    pub outline_area_change: f64,
}

impl MollifiedMembers {
    /// Adds one member.
    pub(super) fn add(&mut self, mollified: &Mollified) {
        let faults = [mollified.crossed, mollified.sharp, mollified.distorted()];
        let [crossed, sharp, distorted] = faults.map(u64::from);
        let Treated { points, corners, rounded, area_change } = mollified.outline;
        self.merge(&MollifiedMembers {
            members: u64::from(mollified.rounds > 0),
            most_rounds: mollified.rounds,
            largest_area_change: mollified.area_change.abs(),
            unresolved: u64::from(faults.contains(&true)),
            crossed,
            sharp,
            distorted,
            splines: u64::from(points > 0 && corners == 0),
            cornered: u64::from(0 < corners && corners < points),
            polygons: u64::from(points > 0 && corners >= points),
            rounded: u64::from(rounded),
            outline_area_change: area_change.abs(),
        });
    }

    /// Adds other members.
    pub(super) fn merge(&mut self, other: &MollifiedMembers) {
        let mut other = *other;
        for (own, other) in self.counts().into_iter().zip(other.counts()) {
            *own = own.saturating_add(*other);
        }
        self.most_rounds = self.most_rounds.max(other.most_rounds);
        self.largest_area_change = self.largest_area_change.max(other.largest_area_change);
        self.outline_area_change = self.outline_area_change.max(other.outline_area_change);
    }

    fn counts(&mut self) -> [&mut u64; 9] {
        let MollifiedMembers { members, unresolved, crossed, sharp, distorted, .. } = self;
        let MollifiedMembers { splines, cornered, polygons, rounded, .. } = self;
        [members, unresolved, crossed, sharp, distorted, splines, cornered, polygons, rounded]
    }

    /// What their outlines were taken as, and how corners were rounded; `None` if there are none.
    pub fn outlines(&self) -> Option<String> {
        let MollifiedMembers { splines, cornered, polygons, rounded, outline_area_change, .. } = *self;
        let parts = [(splines, "by a spline"), (cornered, "by a spline with corners"), (polygons, "as a polygon")];
        let parts = parts.into_iter().filter(|(count, _)| *count > 0);
        let parts: Vec<String> = parts.map(|(count, what)| format!("{count} interpolated {what}")).collect();
        let change = significant(100.0 * outline_area_change, 2);
        let round = match rounded {
            0 => String::new(),
            _ => {
                format!("; corners of {rounded} were rounded: the area changed by at most {change} % and was restored")
            }
        };
        (!parts.is_empty()).then(|| format!("{}{round}", parts.join(", ")))
    }

    /// What was done for their nodes, as a sentence without its stop; `None` if nothing was.
    pub fn smoothing(&self) -> Option<String> {
        let MollifiedMembers { members, largest_area_change, crossed, distorted, .. } = *self;
        // Of those two kinds some are left with another area.
        let restored = if crossed + distorted == 0 { " and was restored" } else { "" };
        (members > 0).then(|| {
            format!(
                "corners of {} were rounded further, until {} n nodes resolved them: the area changed by at most {} \
                 %{restored}",
                count(members, "member"),
                if members == 1 { "its" } else { "their" },
                significant(100.0 * largest_area_change, 2)
            )
        })
    }

    /// What the user should know, if anything.
    pub(super) fn warning(&self, all: u64) -> Option<String> {
        let MollifiedMembers { unresolved, crossed, sharp, distorted, .. } = self;
        (*unresolved > 0).then(|| {
            let parts = [
                (crossed, "with crossings that the outline has not".to_owned()),
                (sharp, format!("with a turn left above {MAX_VERTEX_TURN} rad")),
                (distorted, format!("with an area changed by more than {} %", 100.0 * Mollified::DISTORTED)),
            ];
            let parts = parts.into_iter().filter(|(count, _)| **count > 0);
            let parts: Vec<String> = parts.map(|(count, what)| format!("{count} {what}")).collect();
            format!(
                "{unresolved} of {all} {} started from an outline with parts thinner than the spacing of the nodes: {}; \
                 use more --points or a simpler outline",
                plural(all, "member"),
                parts.join(", ")
            )
        })
    }
}

/// Members with limits that rest on more nodes than the members have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FinerMembers {
    /// Members with limits.
    judged: u64,
    /// Those that needed more nodes, and the most that any of them did.
    finer: u64,
    most: u64,
    /// Members whose differences do not fall as they should at their finest level: their errors are bounds.
    bounds: u64,
}

impl FinerMembers {
    pub(super) fn add(&mut self, outcome: &Outcome) {
        let Some(limit) = outcome.judged.as_ref().or(outcome.judged_vanishing.as_ref()) else { return };
        self.judged += 1;
        self.bounds += u64::from(!limit.asymptotic);
        if outcome.is_finer {
            self.finer += 1;
            self.most = self.most.max(outcome.points);
        }
    }

    /// How many needed more nodes, of how many, and up to how many nodes; `None` if none did.
    pub fn counted(&self) -> Option<(String, String)> {
        let FinerMembers { judged, finer, most, .. } = *self;
        (finer > 0).then(|| (format!("{finer} of {judged}"), format!("up to n = {most}")))
    }

    /// How many needed more nodes, and up to how many; `None` if n nodes were enough for all.
    pub fn in_words(&self) -> Option<String> {
        let FinerMembers { judged, finer, most, .. } = *self;
        let all = plural(judged, "member");
        (finer > 0).then(|| format!("{finer} of {judged} {all} needed more nodes for t_limit, up to {most}"))
    }

    /// Of how many the error is only a bound; `None` if it is of none.
    pub fn bounds_in_words(&self) -> Option<String> {
        let FinerMembers { judged, bounds, .. } = *self;
        (bounds > 0).then(|| {
            format!(
                "is a cautious bound for {bounds} of {judged} {}: their order of convergence is not steady yet",
                plural(judged, "member")
            )
        })
    }
}
