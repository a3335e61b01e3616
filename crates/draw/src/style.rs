//! The style sheets of the pictures: one look, on white paper and on dark screens.
//!
//! The colours are those of Okabe and Ito, which colour-blind readers can distinguish, made darker or lighter until
//! they stand out from the background. The rules use only features that printers and converters of SVG support:
//! classes, `currentColor` and one media query.

use super::medium::Medium;

/// Number of colours and dash patterns in [`chart`] that distinguish curves: classes `s0`, `s1`, …; the patterns alone
/// are `d0`, `d1`, …
pub const SERIES: usize = 8;
/// Number of colours in [`chart`] that order curves, from low to high: classes `r0`, `r1`, …
pub const RAMP: usize = 12;

const LIGHT: &str = include_str!("style/all.css");
const DARK: &str = include_str!("style/all-dark.css");
const CHART_LIGHT: &str = include_str!("style/chart.css");
const CHART_DARK: &str = include_str!("style/chart-dark.css");

/// Rules of all pictures, followed by those of one kind: always, and in dark mode, which paper has not.
pub fn sheet(medium: Medium, light: &str, dark: &str) -> String {
    match medium.is_screen() {
        true => format!("{LIGHT}{light}@media screen and (prefers-color-scheme: dark) {{\n{DARK}{dark}}}\n"),
        false => format!("{LIGHT}{light}"),
    }
}

/// The sheet of all charts.
pub fn chart(medium: Medium) -> String {
    sheet(medium, CHART_LIGHT, CHART_DARK)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contrast of two colours as `#rrggbb`, by WCAG 2.
    fn contrast(a: &str, b: &str) -> f64 {
        let luminance = |colour: &str| {
            let channel = |at: usize| {
                let share = f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0;
                if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
            };
            0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
        };
        let (a, b) = (luminance(a) + 0.05, luminance(b) + 0.05);
        (a / b).max(b / a)
    }

    /// Colours of the classes named by a letter and a number.
    fn colours(sheet: &str) -> Vec<(&str, &str)> {
        let rules = sheet.split('.').filter_map(|rule| rule.split_once(" { color: "));
        let numbered = |class: &str| class.len() > 1 && class[1..].parse::<usize>().is_ok();
        rules.filter(|(class, _)| numbered(class)).map(|(class, rest)| (class, &rest[..7])).collect()
    }

    #[test]
    fn every_colour_stands_out_in_light_and_in_dark() {
        for (sheet, back) in [(CHART_LIGHT, "#ffffff"), (CHART_DARK, "#15191e")] {
            let colours = colours(sheet);
            assert_eq!(colours.len(), SERIES + RAMP, "{colours:?}");
            for (class, colour) in colours {
                assert!(contrast(colour, back) >= 2.9, "{class} {colour}: {}", contrast(colour, back));
            }
        }
    }

    #[test]
    fn every_curve_has_a_dash_pattern_of_its_own() {
        let mut patterns: Vec<&str> = CHART_LIGHT.split(".series { stroke-dasharray: ").skip(1).collect();
        patterns.iter_mut().for_each(|rest| *rest = rest.split(" }").next().unwrap());
        // The first is solid, which only says so where another class may have a pattern.
        assert_eq!(patterns.len(), 2 * SERIES - 1);
        patterns.sort();
        patterns.dedup();
        assert_eq!(patterns.len(), SERIES);
    }
}
