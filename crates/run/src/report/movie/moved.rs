//! A member at any time between those of its portrait.

use glam::DVec2;

use curvelax_ensemble::Status;

/// The nodes of a member at some times, in pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct MovedMember {
    /// How it ended.
    pub status: Status,
    /// Ascending times, and equally many nodes at each.
    frames: Vec<(f64, Vec<DVec2>)>,
}

impl MovedMember {
    /// A member with these `frames`: ascending times, and equally many nodes at each.
    pub fn new(status: Status, frames: Vec<(f64, Vec<DVec2>)>) -> MovedMember {
        MovedMember { status, frames }
    }

    /// The times.
    pub fn times(&self) -> impl Iterator<Item = f64> + '_ {
        self.frames.iter().map(|(t, _)| *t)
    }

    /// The nodes at the start.
    pub fn start(&self) -> &[DVec2] {
        self.frames.first().map_or(&[], |(_, nodes)| nodes)
    }

    /// The nodes at `t`; those of the last time behind it. None if the member has no state.
    pub fn at(&self, t: f64) -> Vec<DVec2> {
        let after = self.frames.partition_point(|(at, _)| *at <= t);
        match (after.checked_sub(1).map(|i| &self.frames[i]), self.frames.get(after)) {
            (Some((low, from)), Some((high, to))) => {
                let share = (t - low) / (high - low);
                from.iter().zip(to).map(|(a, b)| *a + share * (*b - *a)).collect()
            }
            (None, Some((_, nodes))) | (Some((_, nodes)), None) => nodes.clone(),
            (None, None) => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_move_on_straight_lines_and_stay_where_they_end() {
        let at = |x: f64| vec![DVec2::new(x, 1.0), DVec2::ZERO, DVec2::Y];
        let member = MovedMember::new(Status::Relaxed, vec![(0.0, at(0.0)), (1.0, at(4.0)), (3.0, at(8.0))]);
        for (t, x) in [(0.0, 0.0), (0.25, 1.0), (1.0, 4.0), (2.0, 6.0), (3.0, 8.0), (9.0, 8.0)] {
            assert_eq!(member.at(t), at(x), "{t}");
        }
        assert_eq!(MovedMember::new(Status::Nonfinite, vec![]).at(1.0), []);
    }
}
