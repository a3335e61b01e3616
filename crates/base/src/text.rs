//! Numbers, counts and durations as people write them, and paths as shells read them.

use std::path::Path;

/// Significant digits that tell any two numbers apart.
const MAX_DIGITS: usize = 17;

/// Conversions between types that are written as text, for serde: by their `Display` and `FromStr`.
#[macro_export]
macro_rules! as_text {
    ($($name:ident)*) => {
        $(
            impl From<$name> for String {
                fn from(value: $name) -> String {
                    value.to_string()
                }
            }

            impl TryFrom<String> for $name {
                type Error = String;

                fn try_from(text: String) -> std::result::Result<$name, String> {
                    text.parse()
                }
            }
        )*
    };
}

/// `value` with `digits` significant digits: plain from 10⁻³ to 10⁶, otherwise with a power of ten.
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

/// Formats `value` as a person would type it, to read back exactly: 0.001, -1, 1e300.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value.is_finite() && size != 0.0 && !(1e-4..1e15).contains(&size) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// `value` rounded to `digits` significant digits, as a person would type it.
pub fn rounded(value: f64, digits: usize) -> String {
    let scientific = format!("{value:.*e}", digits.max(1) - 1);
    scientific.parse().map_or_else(|_| value.to_string(), number)
}

/// `value` rounded to two significant digits, or to as many more as show on which side of `limit` it is; `no interval`
/// if it is infinite.
pub fn rounded_beside(value: f64, limit: f64) -> String {
    if !value.is_finite() {
        return "no interval".into();
    }
    let shows = |text: &String| text.parse::<f64>().is_ok_and(|shown| (shown > limit) == (value > limit));
    (2..).map(|digits| rounded(value, digits)).take(MAX_DIGITS).find(shows).unwrap_or_else(|| number(value))
}

/// A probability with its sign: `p = 0.35`, `p = 2.1e-19`. It is never 0.
pub fn p_value(p: f64) -> String {
    match p {
        ..1e-300 => "p < 1e-300".into(),
        ..1e-3 => format!("p = {p:.1e}"),
        _ => format!("p = {}", significant(p, 2)),
    }
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

/// The plural of `one`, or `one` itself, as `number` requires.
pub fn plural(number: u64, one: &str) -> String {
    format!("{one}{}", if number == 1 { "" } else { "s" })
}

/// `number` with thousands separated, from 10 000 on.
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

/// The first `most` names, and the number of others.
pub fn listed(names: &[String], most: usize, between: &str) -> String {
    let mut text = names.iter().take(most).cloned().collect::<Vec<_>>().join(between);
    if names.len() > most {
        text += &format!("{between}and {} more", names.len() - most);
    }
    text
}

/// `path` as a word of a command line, for bash, zsh and the like, and on Windows for both of its shells: in quotes if
/// it needs them. It is always on one line.
pub fn quoted(path: &Path) -> String {
    // A path that begins with a dash would be read as a flag.
    let dashed = path.as_os_str().as_encoded_bytes().starts_with(b"-");
    let path = if dashed { Path::new(".").join(path) } else { path.to_path_buf() };
    let separator = |c: char| cfg!(windows) && c == '\\';
    let plain = |c: char| c.is_alphanumeric() || "/._-+:@%=,".contains(c) || separator(c);
    match path.to_str() {
        Some(text) if !text.is_empty() && text.chars().all(plain) => text.into(),
        // No path of Windows has a double quote in it.
        _ if cfg!(windows) => format!("\"{}\"", path.display()),
        Some(text) if !text.contains(char::is_control) => format!("'{}'", text.replace('\'', "'\\''")),
        _ => format!("$'{}'", escaped(path.as_os_str().as_encoded_bytes())),
    }
}

/// `bytes` as they stand between `$'` and `'`: control characters and what is not UTF-8 as octal numbers.
fn escaped(bytes: &[u8]) -> String {
    let mut text = String::new();
    let number = |text: &mut String, bytes: &[u8]| text.extend(bytes.iter().map(|byte| format!("\\{byte:03o}")));
    for chunk in bytes.utf8_chunks() {
        for c in chunk.valid().chars() {
            match c {
                '\'' | '\\' => text.extend(['\\', c]),
                c if c.is_control() => number(&mut text, c.encode_utf8(&mut [0; 4]).as_bytes()),
                c => text.push(c),
            }
        }
        number(&mut text, chunk.invalid());
    }
    text
}

/// Bytes in the unit that a person would use, each 1024 times the one before: `64 MB`.
pub fn bytes(bytes: u64) -> String {
    let units = ["KB", "MB", "GB", "TB"];
    if bytes < 1024 {
        return count(bytes, "byte");
    }
    let (mut size, mut unit) = (bytes as f64 / 1024.0, 0);
    while size >= 1024.0 && unit + 1 < units.len() {
        (size, unit) = (size / 1024.0, unit + 1);
    }
    let size = if size < 10.0 { (size * 10.0).round() / 10.0 } else { size.round() };
    format!("{size} {}", units[unit])
}

/// Seconds in the unit that a person would use.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..10 => format!("{seconds:.2} s"),
        10..60 => format!("{seconds:.1} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_in_units_that_people_read() {
        let sizes = [0, 1, 1023, 1 << 10, 1536, 1 << 26, 3 << 30, 1 << 34, (1 << 26) + 1];
        let told = ["0 bytes", "1 byte", "1023 bytes", "1 KB", "1.5 KB", "64 MB", "3 GB", "16 GB", "64 MB"];
        assert_eq!(sizes.map(bytes), told);
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

    #[test]
    fn a_number_next_to_a_limit_has_digits_enough_to_show_its_side() {
        for (value, shown) in [
            (0.001, "0.001"),
            (0.00196, "0.002"),
            (0.0020001, "0.0020001"),
            (0.002049, "0.00205"),
            (0.0023, "0.0023"),
            (0.002, "0.002"),
            (f64::INFINITY, "no interval"),
        ] {
            assert_eq!(rounded_beside(value, 0.002), shown);
        }
        assert_eq!(rounded_beside(0.0147, 0.0149), "0.0147");
        assert_eq!(rounded_beside(0.1_f64.next_up(), 0.1), "0.10000000000000002");
    }

    #[test]
    #[cfg(not(windows))]
    fn a_path_in_a_command_is_quoted_if_it_must_be() {
        for (path, word) in [
            ("out/run-1.b", "out/run-1.b"),
            ("/data/größe", "/data/größe"),
            ("my run", "'my run'"),
            ("it's", "'it'\\''s'"),
            ("a;b", "'a;b'"),
            ("a$b `c`", "'a$b `c`'"),
            ("-x y", "'./-x y'"),
            ("--force", "./--force"),
            ("two\nlines\tit's \\", "$'two\\012lines\\011it\\'s \\\\'"),
            ("", "''"),
        ] {
            assert_eq!(quoted(Path::new(path)), word);
        }
    }

    #[test]
    #[cfg(unix)]
    fn a_shell_reads_a_quoted_path_as_it_is() {
        use std::{ffi::OsStr, os::unix::ffi::OsStrExt, process::Command};
        let names =
            ["plain", "-n", "a b", "it's", "\"$HOME\" `id` \\ !x", "~", "new\nline", "\u{1b}[31m\u{85}9", "größe"];
        for name in names.map(str::as_bytes).into_iter().chain([&b"b\xff\x317"[..]]) {
            let word = quoted(Path::new(OsStr::from_bytes(name)));
            assert!(!word.contains(char::is_control), "{word:?}");
            let read = Command::new("bash").args(["-c", &format!("printf %s {word}")]).output().unwrap();
            let read = read.stdout.strip_prefix(b"./").unwrap_or(&read.stdout);
            assert_eq!(read, name, "{word}");
        }
    }

    #[test]
    fn a_probability_is_never_shown_as_zero() {
        let shown = [1.0, 0.354, 0.00123, 2.13e-19, 1.1e-300, 1e-301, f64::MIN_POSITIVE, 0.0].map(p_value);
        let expected = ["1.0", "0.35", "0.0012", "2.1e-19", "1.1e-300"].map(|p| format!("p = {p}"));
        assert_eq!(shown[..5], expected);
        assert!(shown[5..].iter().all(|text| text == "p < 1e-300"), "{shown:?}");
    }

    #[test]
    fn durations_read_as_people_say_them() {
        let said = [0.123, 12.34, 75.0, 3600.0, 90_000.0].map(duration);
        assert_eq!(said, ["0.12 s", "12.3 s", "1 min 15 s", "1 h 00 min", "25 h 00 min"]);
    }
}
