//! A [`Movie`] as SVG, animated by SMIL: without a script, so that it moves as a picture in a page too.
//!
//! Coordinates are tenths of a pixel. All but the first node of a path are steps from the node before, which takes half
//! the characters. A viewer that knows no SMIL shows the start.

use std::fmt::Write;

use glam::DVec2;

use super::{HOLD, MARGIN, Movie, MoviePanel, gif::INSIDE};
use crate::report::{
    gallery,
    members_layout::{OWN_SCALES, draw_bar},
};
use curvelax_draw::{
    medium::Medium,
    svg::{Svg, coordinate, escape},
    width::{SIZE, shortened},
};
use curvelax_ensemble::Status;

/// States of a member, between which a viewer moves its nodes on straight lines.
const STATES: usize = 61;
/// Nodes of a member. More would not show.
const MAX_NODES: usize = 150;
/// From one position of the clock to the next.
const CLOCK: f64 = 26.0;

/// The classes of the gallery, with widths in tenths of a pixel.
const STYLE: &str = "
.clock { font-size: 18px }
.panel .moving { stroke-width: 20; stroke-linejoin: round }
.panel .before { stroke-width: 10 }
";

impl Movie {
    /// The text of an SVG file.
    pub fn svg(&self) -> String {
        let style = format!("{}\n{}", gallery::style(Medium::Screen).trim(), STYLE.trim());
        let mut svg = Svg::new(self.size.x, self.size.y, &style, "Members during relaxation");
        svg.rectangle("back", DVec2::ZERO, self.size, 0.0);
        if self.size.x > 300.0 {
            svg.text("note end", DVec2::new(self.size.x - MARGIN, 28.0), &self.head());
        }
        self.clock_in(&mut svg);
        for panel in &self.panels {
            svg.group(&format!("panel {}", panel.member.status.name()), |svg| self.panel(svg, panel));
        }
        match self.bar() {
            Some((ends, text)) => draw_bar(&mut svg, ends, text),
            None => svg.text("note", self.foot() + DVec2::new(0.0, 4.0), OWN_SCALES),
        }
        svg.finish()
    }

    /// The positions of the clock, one below the other, behind a window that shows one.
    fn clock_in(&self, svg: &mut Svg) {
        let (times, positions): (Vec<f64>, Vec<String>) = self
            .moments()
            .enumerate()
            .map(|(i, s)| (self.pace.time(s), format!("0 {}", coordinate(-(i as f64) * CLOCK))))
            .unzip();
        let width = coordinate((self.size.x - 2.0 * MARGIN).max(1.0));
        svg.line(format_args!("<svg x=\"{MARGIN}\" y=\"10\" width=\"{width}\" height=\"{CLOCK}\"><g>"));
        let positions = positions.join(";");
        svg.line(format_args!(
            "<animateTransform attributeName=\"transform\" type=\"translate\" calcMode=\"discrete\" \
             values=\"{positions}\" {}/>",
            self.timing("")
        ));
        for (i, t) in times.into_iter().enumerate() {
            svg.text("clock", DVec2::new(0.0, 19.0 + CLOCK * i as f64), &self.clock(t));
        }
        svg.line(format_args!("</g></svg>"));
    }

    fn panel(&self, svg: &mut Svg, panel: &MoviePanel) {
        svg.rectangle("frame", panel.corner, self.frame, 0.0);
        if !panel.member.start().is_empty() {
            svg.line(format_args!("<g transform=\"scale(0.1)\">"));
            let start = tenths(panel.member.start());
            svg.path("before", &start);
            let mut states: Vec<String> = self.moments().map(|s| tenths(&panel.member.at(self.pace.time(s)))).collect();
            // Held to the end.
            states.extend(states.last().cloned());
            let (filled, states) = (self.filled(panel), states.join(";\n"));
            svg.line(format_args!(
                "<path class=\"moving\" fill-opacity=\"0\" d=\"{start}\">\n<animate attributeName=\"d\" \
                 values=\"{states}\" {}/>{filled}</path>",
                self.timing(";1")
            ));
            svg.line(format_args!("</g>"));
        }
        for (i, name) in panel.names.iter().enumerate() {
            svg.text("middle", self.words(panel, i), &shortened(name, SIZE, self.frame.x));
        }
        let ([x, y], end) = (self.words(panel, panel.names.len()).to_array().map(coordinate), &panel.end.1);
        let end = escape(&shortened(end, SIZE, self.frame.x));
        svg.line(format_args!(
            "<text class=\"middle word\" x=\"{x}\" y=\"{y}\" opacity=\"0\">{end}{}</text>",
            self.switched("opacity", 1.0, panel)
        ));
    }

    /// Fills a member once it has relaxed.
    fn filled(&self, panel: &MoviePanel) -> String {
        match panel.member.status {
            Status::Relaxed => self.switched("fill-opacity", INSIDE, panel),
            _ => String::new(),
        }
    }

    /// Sets `attribute` to `value` when the end of a member is told.
    fn switched(&self, attribute: &str, value: f64, panel: &MoviePanel) -> String {
        let at = share(self.pace.moment(panel.end.0) * self.seconds / (self.seconds + HOLD));
        format!(
            "<animate attributeName=\"{attribute}\" calcMode=\"discrete\" values=\"0;{value}\" keyTimes=\"0;{at}\" {}/>",
            self.duration()
        )
    }

    /// The moments of the states.
    fn moments(&self) -> impl Iterator<Item = f64> + use<> {
        (0..STATES).map(|i| i as f64 / (STATES - 1) as f64)
    }

    fn duration(&self) -> String {
        format!("dur=\"{}s\" repeatCount=\"indefinite\"", coordinate(self.seconds + HOLD))
    }

    /// The attributes of an animation through all moments, and `then` through further ones.
    fn timing(&self, then: &str) -> String {
        let times: Vec<String> = self.moments().map(|s| share(s * self.seconds / (self.seconds + HOLD))).collect();
        format!("keyTimes=\"{}{then}\" {}", times.join(";"), self.duration())
    }
}

/// A share of the whole time, to less than a frame of the longest movie.
fn share(value: f64) -> String {
    let text = format!("{value:.5}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}

/// Path data of the closed polygon through `nodes`, thinned, in tenths of a pixel.
fn tenths(nodes: &[DVec2]) -> String {
    let mut data = String::new();
    let mut before = [0_i64; 2];
    for (i, node) in nodes.iter().step_by(nodes.len().div_ceil(MAX_NODES).max(1)).enumerate() {
        let now = (10.0 * *node).to_array().map(|v| v.round() as i64);
        let [x, y] = [now[0] - before[0], now[1] - before[1]];
        let letter = ["M", "l", ""][i.min(2)];
        // A minus sign separates numbers as well as a space does.
        let first = if i > 1 && x >= 0 { " " } else { "" };
        let second = if y >= 0 { " " } else { "" };
        // Writing into a string cannot fail.
        let _ = write!(data, "{letter}{first}{x}{second}{y}");
        before = now;
    }
    data.push('z');
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::movie::tests::movie;

    #[test]
    fn paths_are_steps_in_tenths_of_a_pixel() {
        let nodes = [(1.0, 2.0), (1.26, 1.0), (3.0, 4.04), (0.0, 4.04)].map(DVec2::from);
        assert_eq!(tenths(&nodes), "M10 20l3-10 17 30-30 0z");
        assert_eq!(tenths(&vec![DVec2::ONE; 600]).matches(" 0 0").count(), MAX_NODES - 2);
    }

    #[test]
    fn every_member_moves_through_equally_many_states_of_equally_many_nodes() {
        let movie = movie(5, 800);
        let text = movie.svg();
        let of_paths: Vec<&str> = text.split("attributeName=\"d\" values=\"").skip(1).collect();
        assert_eq!(of_paths.len(), 5);
        for rest in of_paths {
            let (values, rest) = rest.split_once('"').unwrap();
            let states: Vec<&str> = values.split(";\n").collect();
            assert_eq!((states.len(), states[STATES]), (STATES + 1, states[STATES - 1]));
            let (_, rest) = rest.split_once("keyTimes=\"").unwrap();
            let keys: Vec<f64> = rest.split('"').next().unwrap().split(';').map(|key| key.parse().unwrap()).collect();
            assert_eq!((keys.len(), keys[0], keys[STATES]), (STATES + 1, 0.0, 1.0));
            assert!(keys.is_sorted_by(|a, b| a < b) && keys[STATES - 1] == 0.5, "{keys:?}");
        }
        assert!(text.contains("dur=\"2s\" repeatCount=\"indefinite\""));
        if let Some(folder) = std::env::var_os("CURVELAX_GALLERY") {
            std::fs::write(std::path::Path::new(&folder).join("movie.svg"), &text).unwrap();
        }
    }

    #[test]
    fn the_end_is_named_when_it_is_reached() {
        let movie = movie(1, 800);
        let at = share(0.5 * movie.pace.moment(0.4));
        let text = movie.svg();
        for attribute in ["opacity", "fill-opacity"] {
            let value = if attribute == "opacity" { 1.0 } else { INSIDE };
            let told = format!(
                "<animate attributeName=\"{attribute}\" calcMode=\"discrete\" values=\"0;{value}\" keyTimes=\"0;{at}\""
            );
            assert!(text.contains(&told), "{told}");
        }
    }
}
