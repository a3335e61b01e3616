//! The content of a picture, read back from its text.

use crate::width::{TITLE, width};

/// A line of text as drawn.
pub struct Text<'a> {
    /// Its classes.
    pub class: &'a str,
    /// Its content.
    pub content: String,
    low: [f64; 2],
    high: [f64; 2],
}

/// An attribute of a tag.
pub fn attribute<'a>(tag: &'a str, name: &str) -> &'a str {
    let start = tag.find(&format!(" {name}=\"")).unwrap_or_else(|| panic!("{name} in {tag}")) + name.len() + 3;
    tag[start..].split('"').next().unwrap()
}

fn text(line: &str) -> Text<'_> {
    let (tag, content) = line.split_once('>').unwrap();
    let content = content.strip_suffix("</text>").unwrap();
    let entities = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&amp;", "&")];
    let content = entities.iter().fold(content.to_owned(), |text, (entity, plain)| text.replace(entity, plain));
    let [x, y] = ["x", "y"].map(|name| attribute(tag, name).parse::<f64>().unwrap());
    let start = tag.find("class=\"").unwrap() + 7;
    let class = line[start..].split('"').next().unwrap();
    let has = |name: &str| class.split(' ').any(|part| part == name);
    let size = if has("head") {
        TITLE
    } else if has("axis") {
        13.0
    } else {
        12.0
    };
    let across = width(&content, size);
    let before = across
        * if has("middle") {
            0.5
        } else if has("end") {
            1.0
        } else {
            0.0
        };
    let (low, high) = match tag.contains("rotate(-90") {
        false => ([x - before, y - 0.75 * size], [x - before + across, y + 0.2 * size]),
        true => ([x - 0.75 * size, y - before], [x + 0.2 * size, y - before + across]),
    };
    Text { class, content, low, high }
}

/// All text of a picture.
pub fn texts(svg: &str) -> Vec<Text<'_>> {
    svg.lines().filter(|line| line.starts_with("<text ")).map(text).collect()
}

/// Why a reader would complain about the text of a picture; nothing if all is well.
pub fn complaint(svg: &str) -> Option<String> {
    let [width, height] = ["width", "height"].map(|name| attribute(svg, name).parse::<f64>().unwrap());
    let texts = texts(svg);
    for (i, a) in texts.iter().enumerate() {
        if a.low.iter().any(|v| *v < 0.0) || a.high[0] > width || a.high[1] > height {
            return Some(format!("{:?} is cut off", a.content));
        }
        let overlap = |b: &&Text| (0..2).all(|axis| a.low[axis] < b.high[axis] && b.low[axis] < a.high[axis]);
        if let Some(b) = texts[..i].iter().find(overlap) {
            return Some(format!("{:?} is over {:?}", a.content, b.content));
        }
    }
    None
}

/// The commands in path data, with their numbers.
pub fn commands(data: &str) -> Vec<(char, Vec<f64>)> {
    let starts: Vec<usize> = data.char_indices().filter(|(_, c)| c.is_alphabetic()).map(|(at, _)| at).collect();
    let ends = starts.iter().skip(1).copied().chain([data.len()]);
    let command = |(start, end): (&usize, usize)| {
        let numbers = data[start + 1..end].split(' ').filter(|number| !number.is_empty());
        (data[*start..].chars().next().unwrap(), numbers.map(|number| number.parse().unwrap()).collect())
    };
    starts.iter().zip(ends).map(command).collect()
}

/// The map from pixels to values, by the first and the last tick of an axis whose labels all contain `kind`.
pub fn scale(svg: &str, kind: &str, log: bool) -> impl Fn(f64) -> f64 {
    let level = move |value: f64| if log { value.ln() } else { value };
    let digit = |c: char| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|raised| raised == c).map_or(c.to_string(), |d| d.to_string());
    let value = |label: &str| -> f64 {
        let plain = label.replace('\u{2212}', "-");
        let power = plain.strip_prefix("10").filter(|power| power.contains('⁻'));
        let power = power.map(|power| format!("1e{}", power.replace('⁻', "-").chars().map(digit).collect::<String>()));
        power.unwrap_or(plain).parse().unwrap()
    };
    let lines = svg.lines().filter(|line| line.starts_with(&format!("<text class=\"{kind} tick")));
    let ticks = lines.map(|line| {
        let at: f64 = attribute(line, kind).parse().unwrap();
        // The baseline of a label is below its tick.
        (level(value(&text(line).content)), if kind == "y" { at - 4.0 } else { at })
    });
    let ticks: Vec<(f64, f64)> = ticks.collect();
    let ((a, at), (b, bt)) = (ticks[0], ticks[ticks.len() - 1]);
    move |pixel| {
        let found = a + (b - a) * (pixel - at) / (bt - at);
        if log { found.exp() } else { found }
    }
}

/// The corners of the paths of this class, in pixels.
pub fn paths(svg: &str, class: &str) -> Vec<Vec<[f64; 2]>> {
    let start = format!("<path class=\"{class}\"");
    let corners = |line: &str| {
        let mut corners: Vec<[f64; 2]> = Vec::new();
        for (command, numbers) in commands(attribute(line, "d")) {
            let last = corners.last().copied().unwrap_or_default();
            match (command, &numbers[..]) {
                ('M' | 'L', [x, y]) => corners.push([*x, *y]),
                ('H', [x]) => corners.push([*x, last[1]]),
                ('V', [y]) => corners.push([last[0], *y]),
                _ => {}
            }
        }
        corners
    };
    svg.lines().filter(|line| line.starts_with(&start)).map(corners).collect()
}
