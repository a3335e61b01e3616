//! A few moving members: their nodes at some times, small enough to be part of a page.
//!
//! All members share one scale if they can be seen at it. A coordinate is an integer below 4096, written as two digits
//! of base64. The script `page.js` reads them and moves the nodes on straight lines from one time to the next.

use glam::DVec2;

use crate::report::members_layout::PanelLayout;
use curvelax_base::text::significant;
use curvelax_curve::polygon;
use curvelax_draw::{
    axis::{Scale, tick_step},
    svg::escape,
};
use curvelax_files::portraits::DIGITS;

/// Maximum number of members shown.
pub const MAX_MEMBERS: usize = 6;
/// Maximum times, and nodes, of a member: more would not fit into a small page, and show no more.
const MAX_TIMES: usize = 61;
const MAX_NODES: usize = 200;
/// Maximum positions of the slider.
const MAX_MARKS: usize = 121;
/// Maximum number of nodes that are marked.
const MAX_DOTS: usize = 120;
/// The largest coordinate, and the free space round a curve.
const LARGEST: f64 = 4095.0;
const PADDING: f64 = 200.0;
/// Minimum height of a panel, as a fraction of its width.
const MIN_HEIGHT: f64 = 0.5;

/// A member at several times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MovingMember {
    /// What it is and how it ended: `member 3: relaxed at t = 0.41`.
    pub label: String,
    /// Its status, which sets its colour.
    pub status: &'static str,
    /// Ascending times, in length⁴.
    pub times: Vec<f64>,
    /// Its nodes at each time; their number is always the same.
    pub nodes: Vec<Vec<DVec2>>,
}

impl MovingMember {
    /// The times that can be shown, thinned, and the nodes at each.
    fn frames(&self) -> Vec<(f64, Vec<DVec2>)> {
        let count = self.nodes.first().map_or(0, Vec::len);
        let usable = |(t, nodes): &(&f64, &Vec<DVec2>)| {
            let known = |p: &DVec2| Scale::Linear.holds(p.x) && Scale::Linear.holds(p.y);
            t.is_finite() && nodes.len() == count && count > 0 && nodes.iter().all(known)
        };
        let frames: Vec<(&f64, &Vec<DVec2>)> = self.times.iter().zip(&self.nodes).filter(usable).collect();
        let stride = count.div_ceil(MAX_NODES).max(1);
        let node = |nodes: &Vec<DVec2>| nodes.iter().copied().step_by(stride).collect();
        spread(frames.len(), MAX_TIMES).map(|i| (*frames[i].0, node(frames[i].1))).collect()
    }
}

/// Members that can be shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Player {
    members: Vec<PlayedMember>,
    /// Coordinates in a unit of length, if these are the same for all.
    scale: Option<f64>,
    /// Height of a panel, in coordinates.
    height: f64,
    /// Units of length and time, each after a space; may be empty.
    units: [String; 2],
}

#[derive(Clone, Debug, PartialEq)]
struct PlayedMember {
    label: String,
    status: &'static str,
    times: Vec<f64>,
    /// Coordinates x, y, x, y, … at each time.
    frames: Vec<Vec<u16>>,
}

impl Player {
    /// Uses the first of `trajectories` that have a time to show; none if none has.
    pub fn new(trajectories: &[MovingMember], units: &[String; 2]) -> Option<Player> {
        let shown = trajectories.iter().map(|trajectory| (trajectory, trajectory.frames()));
        let shown: Vec<_> = shown.filter(|(_, frames)| !frames.is_empty()).take(MAX_MEMBERS).collect();
        let bounds =
            |frames: &[(f64, Vec<DVec2>)]| polygon::bounds(frames.iter().flat_map(|(_, nodes)| nodes).copied());
        let boxes: Vec<(DVec2, DVec2)> = shown.iter().filter_map(|(_, frames)| bounds(frames)).collect();
        if boxes.is_empty() {
            return None;
        }
        let mut layout = PanelLayout::new(&boxes, LARGEST, PADDING, MIN_HEIGHT * LARGEST);
        layout.frame.y = layout.frame.y.round();
        let members = shown.into_iter().zip(boxes).map(|((trajectory, frames), bounds)| {
            let place = layout.place(bounds, DVec2::ZERO);
            let whole = |nodes: &[DVec2]| {
                nodes.iter().flat_map(|p| place(*p).to_array()).map(|v| v.round().clamp(0.0, LARGEST) as u16).collect()
            };
            let (times, frames) = frames.iter().map(|(t, nodes)| (*t, whole(nodes))).unzip();
            let size = match layout.common {
                Some(_) => String::new(),
                None => format!(", {}{} across", significant((bounds.1 - bounds.0).max_element(), 2), units[0]),
            };
            PlayedMember { label: format!("{}{size}", trajectory.label), status: trajectory.status, times, frames }
        });
        let (members, scale) = (members.collect(), layout.common.map(|extent| layout.scale(extent)));
        Some(Player { members, scale, height: layout.frame.y, units: units.clone() })
    }

    /// Whether anything moves.
    pub fn moves(&self) -> bool {
        self.members.iter().any(|member| member.times.len() > 1)
    }

    /// Its part of the page. Without the script it shows the members at their first time.
    pub fn html(&self) -> String {
        let member = |PlayedMember { label, status, frames, times }: &PlayedMember| {
            debug_assert_eq!(frames.len(), times.len());
            let (start, label) = (path(&frames[0]), escape(label));
            let dots = if frames[0].len() <= 2 * MAX_DOTS { dots(&frames[0]) } else { String::new() };
            let (height, colour) = (self.height, colour(status));
            format!(
                "<figure style=\"--now: var(--{colour})\">\
                 <svg viewBox=\"0 0 {LARGEST} {height}\" role=\"img\" aria-label=\"{label}\">\
                 <path class=\"start\" d=\"{start}\"/><path class=\"now\" d=\"{start}\"/>\
                 <path class=\"nodes\" d=\"{dots}\"/>{}</svg><figcaption>{label}</figcaption></figure>\n",
                self.scale_bar()
            )
        };
        let members: String = self.members.iter().map(member).collect();
        let mut html = format!("<div class=\"members\">\n{members}</div>\n");
        if self.moves() {
            let unit = escape(&self.units[1]);
            html += &format!(
                "<div class=\"controls\" id=\"controls\" hidden>\n\
                 <button type=\"button\" id=\"play\">Play</button>\n\
                 <input type=\"range\" id=\"time\" min=\"0\" max=\"200\" value=\"0\" aria-label=\"Time\">\n\
                 <span id=\"clock\" data-unit=\"{unit}\" aria-hidden=\"true\"></span>\n</div>\n"
            );
        }
        let grey = if self.moves() { "Grey: at the start. " } else { "" };
        let scale = match self.bar() {
            Some((length, _)) => {
                let (length, unit) = (significant(length, 1), escape(&self.units[0]));
                format!("All to one scale; the bar has length {length}{unit}.")
            }
            None => "Each to its own scale.".into(),
        };
        html += &format!("<p class=\"small\">{grey}{scale}</p>\n");
        html
    }

    /// The data of the script: JSON of numbers and digits of base64 only. Each member and each of its frames begins a
    /// line, so that no line of the page gets too long.
    pub fn data(&self) -> String {
        let numbers = |all: &[f64]| all.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let member = |PlayedMember { times, frames, .. }: &PlayedMember| {
            let frames: Vec<String> = frames.iter().map(|frame| format!("\"{}\"", digits(frame))).collect();
            format!("{{\"times\":[{}],\"frames\":[{}]}}", numbers(times), frames.join(",\n"))
        };
        let members: Vec<String> = self.members.iter().map(member).collect();
        format!("{{\"marks\":[{}],\n\"members\":[{}]}}", numbers(&self.marks()), members.join(",\n"))
    }

    /// Times at equal distances along the slider; if there are many, it moves slowly.
    fn marks(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self.members.iter().flat_map(|member| member.times.iter().copied()).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        spread(all.len(), MAX_MARKS).map(|i| all[i]).collect()
    }

    /// A round length, and the same in coordinates, if all have one scale.
    fn bar(&self) -> Option<(f64, f64)> {
        let scale = self.scale?;
        let length = tick_step(0.15 * LARGEST / scale);
        Some((length, length * scale))
    }

    fn scale_bar(&self) -> String {
        let y = self.height - 0.4 * PADDING;
        let bar = |(_, length): (f64, f64)| format!("<path class=\"bar\" d=\"M{PADDING} {y}h{}\"/>", length.round());
        self.bar().map_or(String::new(), bar)
    }
}

/// At most `most` indices below `count`, including the first and the last.
pub fn spread(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let shown = count.min(most);
    (0..shown).map(move |i| if shown > 1 { i * (count - 1) / (shown - 1) } else { 0 })
}

fn path(frame: &[u16]) -> String {
    let steps = frame.chunks_exact(2).map(|at| format!("{} {}", at[0], at[1]));
    format!("M{}Z", steps.collect::<Vec<_>>().join("L"))
}

fn dots(frame: &[u16]) -> String {
    frame.chunks_exact(2).map(|at| format!("M{} {}h0", at[0], at[1])).collect()
}

/// Two digits per coordinate.
fn digits(frame: &[u16]) -> String {
    frame.iter().flat_map(|v| [v >> 6, v & 63]).map(|digit| char::from(DIGITS[usize::from(digit)])).collect()
}

/// The class of a status.
pub(super) fn colour(status: &str) -> &str {
    let known = ["relaxed", "unfinished", "singular", "nonfinite", "stalled", "vanished"];
    known.into_iter().find(|name| *name == status).unwrap_or("other")
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// An ellipse that becomes a circle, of this size.
    fn ellipse(size: f64, times: usize, n: usize) -> MovingMember {
        let nodes = |t: f64| {
            let a = 1.0 + (-t).exp();
            (0..n).map(|i| size * DVec2::new(a, 1.0 / a) * DVec2::from_angle(TAU * i as f64 / n as f64)).collect()
        };
        let times: Vec<f64> = (0..times).map(|i| 0.1 * i as f64).collect();
        MovingMember {
            label: "member <0>".into(),
            status: "relaxed",
            nodes: times.iter().map(|t| nodes(*t)).collect(),
            times,
        }
    }

    #[test]
    fn coordinates_keep_a_thousandth_of_the_picture() {
        let ellipse = ellipse(1e6, 5, 40);
        let player = Player::new(std::slice::from_ref(&ellipse), &Default::default()).unwrap();
        let member = &player.members[0];
        for (frame, nodes) in member.frames.iter().zip(&ellipse.nodes) {
            for (at, node) in frame.chunks_exact(2).zip(nodes) {
                let back = (DVec2::new(f64::from(at[0]), player.height - f64::from(at[1]))
                    - 0.5 * DVec2::new(LARGEST, player.height))
                    / player.scale.unwrap();
                assert!(back.distance(*node) < 1e-3 * 4e6, "{back} {node}");
            }
        }
        assert_eq!(digits(&[0, 63, 64, 4095]), "AAA/BA//");
    }

    #[test]
    fn a_player_stays_small() {
        let player = Player::new(&vec![ellipse(1.0, 1000, 5000); 20], &Default::default()).unwrap();
        assert_eq!(player.members.len(), MAX_MEMBERS);
        assert_eq!(player.members[0].frames.len(), MAX_TIMES);
        assert_eq!(player.members[0].times.last(), Some(&(0.1 * 999.0)));
        let bytes = player.html().len() + player.data().len();
        assert!(bytes < 350_000, "{bytes}");
    }

    #[test]
    fn what_cannot_be_shown_is_left_out() {
        let mut broken = ellipse(1.0, 3, 12);
        broken.nodes[1][4].x = f64::NAN;
        let player = Player::new(&[MovingMember::default(), broken], &Default::default()).unwrap();
        assert_eq!(player.members.len(), 1);
        assert_eq!(player.members[0].times, [0.0, 0.2]);
        assert_eq!(Player::new(&[MovingMember::default()], &Default::default()), None);
        assert_eq!(Player::new(&[], &Default::default()), None);
        let nodes = vec![vec![DVec2::ONE; 6]];
        let point = MovingMember { times: vec![0.0], nodes, ..MovingMember::default() };
        let html = Player::new(&[point], &Default::default()).unwrap().html();
        assert!(!html.contains("NaN") && !html.contains("inf") && !html.contains("type=\"range\""), "{html}");
    }

    #[test]
    fn labels_are_escaped_and_the_data_hold_none() {
        let player = Player::new(&[ellipse(1.0, 3, 12)], &Default::default()).unwrap();
        assert!(player.html().contains("member &lt;0&gt;") && !player.html().contains("<0>"));
        assert!(!player.data().contains('<') && !player.data().contains("member <"));
    }

    #[test]
    fn the_data_are_json_with_short_numbers_and_short_lines() {
        let nodes = |x: f64| vec![DVec2::new(x, 0.0), DVec2::new(-x, 1.0), DVec2::new(0.0, 2.0)];
        let times = vec![0.0, 1e-7, 0.1, 1e21];
        let nodes: Vec<_> = [1.0, 0.5, 0.25, 0.125].map(nodes).into();
        let one = MovingMember { label: "one".into(), status: "relaxed", times, nodes };
        let two = MovingMember { label: "two".into(), times: vec![0.0], nodes: one.nodes[..1].to_vec(), ..one.clone() };
        let data = Player::new(&[one, two], &Default::default()).unwrap().data();
        let parts = [
            "{\"marks\":[0,0.0000001,0.1,1000000000000000000000],",
            "\"members\":[{\"times\":[0,0.0000001,0.1,1000000000000000000000],\"frames\":[\"8383DIgAgADI\",",
            "\"ub83RkgAgADI\",",
            "\"nN83YygAgADI\",",
            "\"jm83cZgAgADI\"]},",
            "{\"times\":[0],\"frames\":[\"8383DIgAgADI\"]}]}",
        ];
        assert_eq!(data, parts.join("\n"));
    }
}
