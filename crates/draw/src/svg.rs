//! A small writer of SVG: equal input gives equal bytes, and text is escaped.

use std::fmt::Write;

use glam::DVec2;

/// An SVG picture under construction.
pub struct Svg {
    text: String,
    width: f64,
}

impl Svg {
    /// An empty picture of this size in pixels, with this style sheet and this title for screen readers.
    pub fn new(width: f64, height: f64, style: &str, title: &str) -> Svg {
        let (shown, height) = (coordinate(width), coordinate(height));
        let title = escape(title);
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {shown} {height}\" width=\"{shown}\" \
             height=\"{height}\" role=\"img\">\n<title>{title}</title>\n<style>\n"
        );
        text.push_str(style.trim());
        text.push_str("\n</style>\n");
        Svg { text, width }
    }

    /// Its width in pixels.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Adds a rectangle with rounded corners.
    pub fn rectangle(&mut self, class: &str, corner: DVec2, size: DVec2, radius: f64) {
        let [x, y, width, height, rx] = [corner.x, corner.y, size.x, size.y, radius].map(coordinate);
        self.line(format_args!(
            "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"{rx}\"/>"
        ));
    }

    /// Adds a path from its data.
    pub fn path(&mut self, class: &str, data: &str) {
        if !data.is_empty() {
            self.line(format_args!("<path class=\"{class}\" d=\"{data}\"/>"));
        }
    }

    /// Adds a path in the style of its group, with a text that is shown while the pointer rests on it.
    pub fn hinted_path(&mut self, data: &str, hint: &str) {
        let hint = escape(hint);
        self.line(format_args!("<path d=\"{data}\"><title>{hint}</title></path>"));
    }

    /// Adds a line of text; `class` says how it is anchored.
    pub fn text(&mut self, class: &str, at: DVec2, content: &str) {
        let ([x, y], content) = ([at.x, at.y].map(coordinate), escape(content));
        self.line(format_args!("<text class=\"{class}\" x=\"{x}\" y=\"{y}\">{content}</text>"));
    }

    /// Adds a [line of text](Svg::text), unless it is empty.
    pub fn text_unless_empty(&mut self, class: &str, at: DVec2, content: &str) {
        if !content.is_empty() {
            self.text(class, at, content);
        }
    }

    /// Adds a line of text that reads upwards, for the name of a vertical axis.
    pub fn text_upwards(&mut self, class: &str, at: DVec2, content: &str) {
        let ([x, y], content) = ([at.x, at.y].map(coordinate), escape(content));
        self.line(format_args!(
            "<text class=\"{class}\" x=\"{x}\" y=\"{y}\" transform=\"rotate(-90 {x} {y})\">{content}</text>"
        ));
    }

    /// Adds a group of all that `draw` adds.
    pub fn group(&mut self, class: &str, draw: impl FnOnce(&mut Svg)) {
        self.line(format_args!("<g class=\"{class}\">"));
        draw(self);
        self.text.push_str("</g>\n");
    }

    /// The whole file.
    pub fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }

    /// Adds markup as it is: the caller escapes it.
    pub fn line(&mut self, content: std::fmt::Arguments) {
        // Writing into a string cannot fail.
        let _ = writeln!(self.text, "{content}");
    }
}

/// Path data of the closed polygon through `points`.
pub fn closed_path(points: &[DVec2]) -> String {
    let mut data = String::new();
    for (i, p) in points.iter().enumerate() {
        let _ = write!(data, "{}{} {}", if i == 0 { 'M' } else { 'L' }, coordinate(p.x), coordinate(p.y));
    }
    if !data.is_empty() {
        data.push('Z');
    }
    data
}

/// Path data that mark each of `points`: with round caps, a step of length 0 is a dot.
pub fn dots(points: &[DVec2]) -> String {
    points.iter().map(|p| format!("M{} {}h0", coordinate(p.x), coordinate(p.y))).collect()
}

/// Formats `value` to a hundredth of a pixel, without trailing zeros.
pub fn coordinate(value: f64) -> String {
    let text = format!("{value:.2}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".into() } else { short.into() }
}

/// Escapes `text` for the content and the quoted attributes of XML and HTML; characters that XML forbids become U+FFFD.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\t' | '\n' => escaped.push(c),
            '\0'..=' ' | '\u{7f}'..='\u{9f}' | '\u{fffe}' | '\u{ffff}' if c != ' ' => escaped.push('\u{fffd}'),
            _ => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short() {
        assert_eq!([0.0, -0.001, 10.0, 1.25, -3.999].map(coordinate), ["0", "0", "10", "1.25", "-4"]);
    }

    #[test]
    fn paths_are_closed_and_dots_have_no_length() {
        let points = [DVec2::new(0.0, 1.0), DVec2::new(2.5, -1.0)];
        assert_eq!(closed_path(&points), "M0 1L2.5 -1Z");
        assert_eq!(dots(&points), "M0 1h0M2.5 -1h0");
        assert_eq!(closed_path(&[]), "");
    }

    #[test]
    fn text_is_escaped() {
        let mut svg = Svg::new(1.0, 1.0, "", "a");
        svg.text("c", DVec2::ZERO, "a < b & c");
        assert!(svg.finish().contains("<text class=\"c\" x=\"0\" y=\"0\">a &lt; b &amp; c</text>"));
        assert_eq!(escape("\"\0\u{1b}\u{85}\t ü"), "&quot;\u{fffd}\u{fffd}\u{fffd}\t ü");
    }
}
