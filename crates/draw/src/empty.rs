//! What stands where there is nothing to draw.

use glam::DVec2;

use super::{
    svg::Svg,
    width::{LINE, SIZE, wrapped},
};

/// Writes a sentence into an empty frame, if there is nothing to draw in it.
pub fn say(svg: &mut Svg, corner: DVec2, size: DVec2, sentence: &str) {
    svg.rectangle("frame", corner, size, 0.0);
    let lines = wrapped(sentence, SIZE, size.x - 24.0);
    let first = corner + 0.5 * size - DVec2::new(0.0, 0.5 * LINE * (lines.len() as f64 - 1.0) - 4.0);
    for (i, line) in lines.iter().enumerate() {
        svg.text("note middle", first + DVec2::new(0.0, i as f64 * LINE), line);
    }
}

/// Class of the sentence in the place of a picture.
pub const NOTHING: &str = "nothing";

/// Why there is nothing to draw, of a picture that only says so, as text of XML.
pub fn reason(svg: &str) -> Option<String> {
    let (_, group) = svg.split_once(&format!("<g class=\"{NOTHING}\">"))?;
    let lines = group.split("</text>").filter_map(|line| line.rsplit_once('>')).map(|(_, words)| words);
    Some(lines.filter(|words| !words.trim().is_empty()).collect::<Vec<_>>().join(" "))
}
