//! `plots/portraits.json`: the first members at the start, during the run and at the end.
//!
//! All their pictures are drawn from this file, so that they can be redrawn from it. A coordinate is an integer below
//! 4096, written as two digits of base64. Each member has its own scale and does not depend on the others.

use std::path::Path;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::names::{self, parsed, spoilt, text_of};
use curvelax_base::{
    drawable::is_drawable,
    error::{Error, Result, shortened},
    input,
};
use curvelax_ensemble::{Outcome, Portrait, Status};

/// The digits of base64, two to a coordinate.
pub const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// The largest coordinate.
const LARGEST: f64 = 4095.0;

/// One member at several times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Film {
    /// Index of the member.
    pub member: u64,
    /// The name of its outline; empty if it has none.
    #[serde(default)]
    pub label: String,
    /// How it ended.
    pub status: Status,
    /// Its relaxation time.
    pub t_relax: Option<f64>,
    /// Number of its nodes; every m-th is stored.
    pub points: usize,
    /// Place of the coordinates (0, 0), in the user's frame.
    corner: [f64; 2],
    /// Length of one unit of the coordinates.
    unit: f64,
    /// Ascending times, from 0 to the last accepted state.
    pub times: Vec<f64>,
    /// Coordinates x, y, x, y, … of the nodes at each time.
    nodes: Vec<String>,
}

/// The content of the file.
#[derive(Serialize, Deserialize)]
struct Portraits {
    members: Vec<Film>,
}

impl Film {
    /// Rounds the portrait of a member. Times at which a node is not finite, or too large to draw, are left out.
    pub fn new(outcome: &Outcome, portrait: &Portrait) -> Film {
        let Portrait { before, frames, after } = portrait;
        let stride = Portrait::stride(before.len());
        let kept = |nodes: &[DVec2]| nodes.iter().copied().step_by(stride).collect::<Vec<_>>();
        let (before_kept, after_kept) = (kept(before), kept(after));
        let inside = frames.iter().filter(|(t, _)| *t > 0.0 && *t < outcome.t_end);
        let inside = inside.map(|(t, nodes)| (*t, nodes));
        // A member that ended at once has one time only.
        let end = (outcome.t_end > 0.0).then_some((outcome.t_end, &after_kept));
        let all = [(0.0, &before_kept)].into_iter().chain(inside).chain(end);
        let held = |nodes: &[DVec2]| nodes.iter().all(|p| p.to_array().iter().all(|v| is_drawable(*v)));
        let shown: Vec<(f64, &Vec<DVec2>)> = all.filter(|(_, nodes)| held(nodes)).collect();

        let places = || shown.iter().flat_map(|(_, nodes)| nodes.iter().copied());
        let low = places().reduce(DVec2::min).unwrap_or_default();
        let largest = (places().reduce(DVec2::max).unwrap_or_default() - low).max_element();
        let unit = if largest > 0.0 { largest / LARGEST } else { 1.0 };
        let coordinates = |nodes: &Vec<DVec2>| {
            let places = nodes.iter().flat_map(|p| ((*p - low) / unit).to_array());
            digits(places.map(|v| v.round().clamp(0.0, LARGEST) as u16))
        };
        let Outcome { member, status, t_relax, .. } = *outcome;
        let (times, nodes) = shown.iter().map(|(t, nodes)| (*t, coordinates(nodes))).unzip();
        let label = outcome.label.clone();
        Film { member, label, status, t_relax, points: before.len(), corner: low.to_array(), unit, times, nodes }
    }

    /// Its name for people: that of its outline, cut to `most` characters, or its number.
    pub fn name(&self, most: usize) -> String {
        match &self.label[..] {
            "" => format!("member {}", self.member),
            label => shortened(label, most),
        }
    }

    /// The nodes at each time; their number is always the same.
    pub fn frames(&self) -> Vec<Vec<DVec2>> {
        let place = |digits: &[u8]| {
            let [x, y] = [0, 2].map(|at| (64 * value(digits[at]) + value(digits[at + 1])) as f64);
            DVec2::from_array(self.corner) + self.unit * DVec2::new(x, y)
        };
        self.nodes.iter().map(|text| text.as_bytes().chunks_exact(4).map(place).collect()).collect()
    }

    /// What is wrong with it, if this program did not write it.
    pub fn fault(&self) -> Option<&'static str> {
        let known = |text: &String| text.bytes().all(|digit| DIGITS.contains(&digit));
        let equal = |text: &String| text.len().is_multiple_of(4) && text.len() == self.nodes[0].len();
        let place = self.corner.iter().all(|v| is_drawable(*v));
        let unit = self.unit > 0.0 && is_drawable(self.unit);
        match () {
            _ if self.times.len() != self.nodes.len() => Some("as many times as states"),
            _ if !self.times.is_sorted_by(|a, b| a < b) => Some("ascending times"),
            _ if !self.nodes.iter().all(known) => Some("digits of base64"),
            _ if !self.nodes.iter().all(equal) => Some("equally many nodes at all times"),
            _ if !place || !unit => Some("a corner and a positive unit"),
            _ => None,
        }
    }
}

/// The text of the file.
pub fn to_json(films: &[Film]) -> Result<String> {
    let text = serde_json::to_string(&Portraits { members: films.into() });
    let text = text.map_err(|e| Error::Failed(format!("cannot write {}: {e}", names::PORTRAITS)))?;
    // One line per member: long, but readable.
    Ok(text.replace("{\"member\":", "\n{\"member\":") + "\n")
}

/// Reads the file at `path`.
///
/// # Errors
/// [`Error::Request`] naming the file, and the member if there is one.
pub fn read(path: &Path) -> Result<Vec<Film>> {
    let text = text_of(path, input::MAX_PORTRAITS)?;
    let Portraits { members } = parsed(path, &text)?;
    match members.iter().find_map(|film| Some((film.member, film.fault()?))) {
        Some((member, expected)) => Err(spoilt(path, &format!("member {member}"), &format!("expected {expected}"))),
        None => Ok(members),
    }
}

/// Checks that this program wrote them; otherwise returns the fault.
pub(super) fn check(films: &[Film]) -> std::result::Result<(), String> {
    match films.iter().find_map(|film| Some((film.member, film.fault()?))) {
        Some((member, fault)) => Err(format!("the portrait of member {member} has not {fault}")),
        None => Ok(()),
    }
}

/// Two digits for each coordinate.
fn digits(coordinates: impl Iterator<Item = u16>) -> String {
    coordinates.flat_map(|v| [v >> 6, v & 63]).map(|digit| char::from(DIGITS[usize::from(digit)])).collect()
}

/// The value of a digit.
fn value(digit: u8) -> usize {
    DIGITS.iter().position(|own| *own == digit).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::film;
    use curvelax_study::samples::outcome;

    #[test]
    fn nodes_read_back_to_a_thousandth_and_films_to_the_same_bits() {
        let triangle = vec![DVec2::new(-1e6, 3.0), DVec2::new(1e6, 4.0), DVec2::new(0.1, 1.0 / 3.0)];
        let later: Vec<DVec2> = triangle.iter().map(|p| 0.7 * *p).collect();
        let nan = vec![DVec2::NAN; 3];
        let frames = vec![(0.0, nan.clone()), (0.1, later.clone()), (0.2, nan), (9.0, later.clone())];
        let portrait = Portrait { before: triangle.clone(), frames, after: later.clone() };
        let film = Film::new(&outcome(3, Status::Singular, Some(0.1 + 0.2)), &portrait);
        assert_eq!(film.times, [0.0, 0.1, 2.0]);
        for (frame, nodes) in film.frames().iter().zip([&triangle, &later, &later]) {
            assert!(frame.iter().zip(nodes).all(|(a, b)| a.distance(*b) < 2e6 / 4095.0), "{frame:?}");
            assert_eq!(frame.len(), 3);
        }
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("portraits.json");
        std::fs::write(&path, to_json(&[film.clone(), film.clone()]).unwrap()).unwrap();
        assert_eq!(read(&path).unwrap(), [film.clone(), film]);
    }

    #[test]
    fn films_that_were_not_written_here_are_refused() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("portraits.json");
        let good = to_json(&[film(5, 12, Status::Relaxed, Some(0.1))]).unwrap();
        let twisted = |from: &str, to: &str| {
            assert!(good.contains(from), "{good}");
            std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
            read(&path).map_err(|e| e.to_string())
        };
        assert!(twisted("", "").is_ok());
        for (from, to, said) in [
            ("[0.0,0.1", "[0.1", "member 5: expected as many times as states"),
            ("[0.0,0.1", "[0.1,0.0", "member 5: expected ascending times"),
            ("\"nodes\":[\"", "\"nodes\":[\"!!!!", "member 5: expected digits of base64"),
            ("\"nodes\":[\"", "\"nodes\":[\"AAAA", "member 5: expected equally many nodes"),
            ("\"unit\":", "\"unit\":-", "member 5: expected a corner and a positive unit"),
            ("relaxed", "slack", "unknown value `slack`"),
            ("}\n", "\n", "it ends inside"),
        ] {
            let error = twisted(from, to).unwrap_err();
            assert!(error.contains(said) && error.contains("portraits.json"), "{error}");
        }
    }

    #[test]
    fn a_member_that_ended_at_once_has_one_time() {
        let triangle = vec![DVec2::ZERO, DVec2::X, DVec2::Y];
        let portrait = Portrait { before: triangle.clone(), frames: vec![], after: triangle };
        let at_once = Outcome { t_end: 0.0, ..outcome(0, Status::Relaxed, Some(0.0)) };
        assert_eq!(Film::new(&at_once, &portrait).times, [0.0]);
    }

    #[test]
    fn many_nodes_and_none_are_kept_small() {
        assert!(film(0, 5000, Status::Relaxed, Some(0.1)).frames()[0].len() <= Portrait::MAX_NODES);
        let empty = Portrait { before: vec![DVec2::INFINITY; 9], frames: vec![], after: vec![DVec2::NAN; 9] };
        let film = Film::new(&outcome(0, Status::Nonfinite, None), &empty);

        assert!(film.frames().is_empty() && !to_json(&[film]).unwrap().contains("null,null"));
    }
}
