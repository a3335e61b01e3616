//! How wide text is, and how numbers are written in pictures.
//!
//! A picture is laid out before any font is known, so widths are those of DejaVu Sans, among the widest of the fonts that
//! are taken for `sans-serif`: what fits there fits elsewhere.

/// Advance widths of U+0020 to U+007E in DejaVu Sans, in hundredths of the font size.
const ADVANCE: [u8; 95] = [
    32, 40, 46, 84, 64, 95, 78, 27, 39, 39, 50, 84, 32, 36, 32, 34, 64, 64, 64, 64, 64, 64, 64, 64, 64, 64, 34, 34, 84,
    84, 84, 53, 100, 68, 69, 70, 77, 63, 58, 77, 75, 29, 29, 66, 56, 86, 75, 79, 60, 79, 69, 63, 61, 73, 68, 99, 69,
    61, 69, 39, 34, 39, 84, 50, 50, 61, 63, 55, 63, 62, 35, 63, 63, 28, 28, 58, 28, 97, 63, 61, 63, 63, 41, 52, 39, 63,
    59, 82, 59, 59, 52, 64, 34, 64, 84,
];

/// Size of most text, in pixels.
pub const SIZE: f64 = 12.0;
/// Size of a title, as a multiple of [`SIZE`] that counts its bold face, too.
pub const TITLE: f64 = 15.0 * 1.13;

/// Width of `text` in a font of `size` pixels.
pub fn width(text: &str, size: f64) -> f64 {
    let advance = |c: char| match c {
        ' '..='~' => f64::from(ADVANCE[c as usize - 32]) / 100.0,
        '⁰'..='⁹' | '¹' | '²' | '³' | '·' => 0.41,
        '\u{a0}'..='\u{10ff}' => 0.7,
        '\u{2010}'..='\u{22ff}' => 0.86,
        // East Asian scripts and pictographs.
        _ => 1.1,
    };
    size * text.chars().map(advance).sum::<f64>()
}

/// `text` in lines of at most `most` pixels, broken at spaces, and inside words only where one is too long.
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

/// `text`, or as much of its beginning as fits into `most` pixels with an ellipsis.
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

/// `value` with this many significant digits: plainly from 10⁻³ up to 10⁶, else with a power of ten.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let scientific = format!("{value:.*e}", digits.max(1) - 1);
    // Rounding may have raised the power, so it is read back.
    let Some((mantissa, power)) = scientific.split_once('e').and_then(|(m, p)| Some((m, p.parse::<i32>().ok()?)))
    else {
        return scientific;
    };
    let text = match power {
        -3..6 => format!("{value:.*}", (digits as i32 - 1 - power).max(0) as usize),
        _ => format!("{mantissa}·{}", power_of_ten(power)),
    };
    text.replace('-', "\u{2212}")
}

/// `10⁻⁶`.
pub fn power_of_ten(power: i32) -> String {
    let raised = |c: char| match c.to_digit(10) {
        Some(digit) => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize],
        None => '⁻',
    };
    format!("10{}", power.to_string().chars().map(raised).collect::<String>())
}

/// `1 member`, `2 members`.
pub fn count(number: u64, one: &str) -> String {
    format!("{} {}", grouped(number), plural(number, one))
}

/// The noun for `number` of what is called `one`.
pub fn plural(number: u64, one: &str) -> String {
    format!("{one}{}", if number == 1 { "" } else { "s" })
}

/// `number` with its thousands apart from 10 000 on.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && digits.len() > 4 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{a0}');
        }
        text.push(digit);
    }
    text
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
    fn what_is_too_long_ends_in_an_ellipsis() {
        assert_eq!(shortened("amplitude", SIZE, 100.0), "amplitude");
        let short = shortened("amplitude", SIZE, 40.0);
        assert!(short.ends_with('…') && short.len() > 4 && width(&short, SIZE) <= 40.0, "{short}");
    }

    #[test]
    fn thousands_are_apart_in_long_numbers() {
        assert_eq!([0, 9999, 10_000, 1_234_567].map(grouped), ["0", "9999", "10\u{a0}000", "1\u{a0}234\u{a0}567"]);
        assert_eq!([1, 2].map(|number| count(number, "member")), ["1 member", "2 members"]);
    }

    #[test]
    fn numbers_have_the_digits_asked_for() {
        let shown = [0.0, 0.41234, -2.0, 9.9996, 1234.5, 1e-7, 2e6].map(|value| significant(value, 3));
        assert_eq!(shown, ["0", "0.412", "\u{2212}2.00", "10.0", "1234", "1.00·10⁻⁷", "2.00·10⁶"]);
    }
}
