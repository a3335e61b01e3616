//! The width of text in a picture.
//!
//! A picture is laid out before any font is known. Widths are therefore those of DejaVu Sans, among the widest fonts
//! used for `sans-serif`: text that fits there fits elsewhere.

/// Advance widths of U+0020 to U+007E in DejaVu Sans, in hundredths of the font size.
const ADVANCE: [u8; 95] = [
    32, 40, 46, 84, 64, 95, 78, 27, 39, 39, 50, 84, 32, 36, 32, 34, 64, 64, 64, 64, 64, 64, 64, 64, 64, 64, 34, 34, 84,
    84, 84, 53, 100, 68, 69, 70, 77, 63, 58, 77, 75, 29, 29, 66, 56, 86, 75, 79, 60, 79, 69, 63, 61, 73, 68, 99, 69,
    61, 69, 39, 34, 39, 84, 50, 50, 61, 63, 55, 63, 62, 35, 63, 63, 28, 28, 58, 28, 97, 63, 61, 63, 63, 41, 52, 39, 63,
    59, 82, 59, 59, 52, 64, 34, 64, 84,
];

/// Size of most text, in pixels.
pub const SIZE: f64 = 12.0;
/// Pixels from one line of it to the next.
pub const LINE: f64 = 17.0;
/// Size of a title, as a multiple of [`SIZE`] that includes its bold face.
pub const TITLE: f64 = 15.0 * 1.13;

/// Width of `text` in a font of `size` pixels.
pub fn width(text: &str, size: f64) -> f64 {
    let advance = |c: char| match c {
        ' '..='~' => f64::from(ADVANCE[c as usize - 32]) / 100.0,
        '⁰'..='⁹' | '¹' | '²' | '³' | '·' => 0.41,
        '⁺' | '⁻' => 0.53,
        '\u{a0}'..='\u{10ff}' => 0.7,
        '\u{2010}'..='\u{22ff}' => 0.86,
        // East Asian scripts and pictographs.
        _ => 1.1,
    };
    size * text.chars().map(advance).sum::<f64>()
}

/// Breaks `text` into lines of at most `most` pixels, at spaces, and inside a word only if it is too long.
pub fn wrapped(text: &str, size: f64, most: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let longer = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
        if width(&longer, size) <= most {
            line = longer;
            continue;
        }
        lines.extend((!line.is_empty()).then(|| std::mem::take(&mut line)));
        for c in word.chars() {
            if !line.is_empty() && width(&format!("{line}{c}"), size) > most {
                lines.push(std::mem::take(&mut line));
            }
            line.push(c);
        }
    }
    lines.extend((!line.is_empty()).then_some(line));
    lines
}

/// Returns `text`, or as much of its beginning as fits into `most` pixels with an ellipsis.
pub fn shortened(text: &str, size: f64, most: f64) -> String {
    if width(text, size) <= most {
        return text.into();
    }
    let mut short = String::new();
    for c in text.chars() {
        if width(&short, size) + width(&format!("{c}…"), size) > most {
            break;
        }
        short.push(c);
    }
    short.trim_end().to_owned() + "…"
}

/// `text` in at most `most` pixels, with its beginning and its end: the ends of names may be all that differs.
pub fn shortened_inside(text: &str, size: f64, most: f64) -> String {
    if width(text, size) <= most {
        return text.to_owned();
    }
    let all: Vec<char> = text.chars().collect();
    let of = |kept: usize| -> String {
        let (start, end) = (kept.div_ceil(2), all.len() - kept / 2);
        all[..start].iter().chain(&['…']).chain(&all[end..]).collect()
    };
    (0..all.len()).rev().map(of).find(|short| width(short, size) <= most).unwrap_or("…".into())
}

/// Each of `texts` in at most `most` pixels, unless two that differ would then be equal: what all have in common at
/// their beginning goes first, and if that is not enough, they keep their width.
pub fn distinct(texts: &[String], size: f64, most: f64) -> Vec<String> {
    let are_distinct = |short: &[String]| {
        let equal = |i: usize, j: usize| short[i] == short[j] && texts[i] != texts[j];
        (0..texts.len()).all(|i| (0..i).all(|j| !equal(i, j)))
    };
    let cut: Vec<String> = texts.iter().map(|text| shortened(text, size, most)).collect();
    if are_distinct(&cut) {
        return cut;
    }
    let common = common_beginning(texts);
    let ends = texts.iter().map(|text| format!("…{}", text.chars().skip(common).collect::<String>()));
    let ends: Vec<String> = ends.map(|text| shortened(&text, size, most)).collect();
    if are_distinct(&ends) { ends } else { texts.to_vec() }
}

/// Characters at the beginning of all texts.
fn common_beginning(texts: &[String]) -> usize {
    let Some(first) = texts.first() else { return 0 };
    let shared = |other: &String| first.chars().zip(other.chars()).take_while(|(a, b)| a == b).count();
    texts.iter().map(shared).min().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_broken_where_they_are_full() {
        let lines = wrapped("one two three incomprehensibilities", SIZE, 60.0);
        assert!(lines.iter().all(|line| width(line, SIZE) <= 60.0), "{lines:?}");
        assert_eq!(lines[..2], ["one two", "three"]);
        assert_eq!(lines[2..].concat(), "incomprehensibilities");
        assert_eq!(wrapped("  ", SIZE, 60.0), [""; 0]);
    }

    #[test]
    fn a_text_cut_inside_keeps_both_ends() {
        let texts = ["a-long-common-beginning-of-islands-1", "a-long-common-beginning-of-islands-2"];
        let cut = texts.map(|text| shortened_inside(text, SIZE, 120.0));
        assert!(cut.iter().all(|text| width(text, SIZE) <= 120.0 && text.starts_with("a-long-") && text.contains('…')));
        assert!(cut[0].ends_with("-1") && cut[1].ends_with("-2"), "{cut:?}");
        let ends = texts.map(|text| shortened(text, SIZE, 120.0));
        assert_eq!(ends[0], ends[1], "the control: cut at the end they are equal");
        assert_eq!(["b", "žé"].map(|text| shortened_inside(text, SIZE, 60.0)), ["b", "žé"]);
        assert_eq!(shortened_inside("wide", SIZE, 1.0), "…");
    }

    #[test]
    fn texts_that_differ_stay_different() {
        let texts = |all: &[&str]| all.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        let flows = texts(&["amplitude = 0.02, flow = willmore", "amplitude = 0.02, flow = elastic:0.5"]);
        let (cut, told) = (shortened(&flows[0], SIZE, 150.0), distinct(&flows, SIZE, 150.0));
        assert_eq!(cut, shortened(&flows[1], SIZE, 150.0), "the control: their beginnings are equal");
        assert_eq!(told, ["…willmore", "…elastic:0.5"]);
        assert_eq!(distinct(&texts(&["0.02", "0.1"]), SIZE, 150.0), ["0.02", "0.1"]);
        let alike = texts(&["a long name that differs at its end: 1", "b long name that differs at its end: 2"]);
        assert_eq!(distinct(&alike, SIZE, 60.0).len(), 2);
        let both = texts(&["x, a long name that differs at its end: 1", "x, a long name that differs at its end: 1"]);
        assert_eq!(distinct(&both, SIZE, 60.0)[0], distinct(&both, SIZE, 60.0)[1], "equal ones may be equal");
        let hard = texts(&["a1 and much that is the same 1", "a1 and much that is the same 2", "b1"]);
        assert_eq!(distinct(&hard, SIZE, 40.0), hard);
    }

    #[test]
    fn what_is_too_long_ends_in_an_ellipsis() {
        assert_eq!(shortened("amplitude", SIZE, 100.0), "amplitude");
        let short = shortened("amplitude", SIZE, 40.0);
        assert!(short.ends_with('…') && short.len() > 4 && width(&short, SIZE) <= 40.0, "{short}");
    }
}
