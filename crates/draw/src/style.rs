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

const LIGHT: &str = "
.back { fill: #ffffff }
.frame { fill: none; stroke: #57606a; stroke-width: 1 }
.grid { fill: none; stroke: #e3e6ea; stroke-width: 1 }
.ticks { fill: none; stroke: #57606a; stroke-width: 1 }
text { font-family: sans-serif; font-size: 12px; fill: #24292f }
.head { font-size: 15px; font-weight: bold }
.note { fill: #57606a }
.middle { text-anchor: middle }
.end { text-anchor: end }
.axis { font-size: 14px; font-style: italic }
";

const DARK: &str = "\
.back { fill: #15191e }
.frame, .ticks { stroke: #9aa4af }
.grid { stroke: #2d343c }
text { fill: #e6edf3 }
.note { fill: #9aa4af }
";

const CHART_LIGHT: &str = "\
.axis { font-size: 13px; font-style: normal }
.series { fill: none; stroke: currentColor; stroke-width: 1.7; stroke-linejoin: round }
.thin { fill: none; stroke: currentColor; stroke-width: 1.2 }
.thick { fill: none; stroke: currentColor; stroke-width: 5; stroke-opacity: 0.45 }
.band { fill: currentColor; fill-opacity: 0.17 }
.bars { fill: currentColor; fill-opacity: 0.8 }
.dots { fill: none; stroke: currentColor; stroke-width: 8; stroke-linecap: round }
.points { fill: none; stroke: currentColor; stroke-width: 5; stroke-linecap: round; stroke-opacity: 0.6 }
.solid { fill: currentColor }
.hollow { fill: #ffffff; stroke: currentColor; stroke-width: 1.7 }
.cross { fill: none; stroke: currentColor; stroke-width: 2.4 }
.ink { color: #24292f }
.faint { color: #57606a }
.dashed { fill: none; stroke: currentColor; stroke-width: 1.4; stroke-dasharray: 6 4 }
.s0 { color: #0072b2 }
.s1 { color: #c25100 } .s1 .series { stroke-dasharray: 8 3 }
.s2 { color: #00855f } .s2 .series { stroke-dasharray: 2.5 2.5 }
.s3 { color: #b0569a } .s3 .series { stroke-dasharray: 9 3 2 3 }
.s4 { color: #24292f } .s4 .series { stroke-dasharray: 14 3 }
.s5 { color: #946b00 } .s5 .series { stroke-dasharray: 5 2 1.5 2 1.5 2 }
.s6 { color: #2593cc } .s6 .series { stroke-dasharray: 4.5 4.5 }
.s7 { color: #768390 } .s7 .series { stroke-dasharray: 1.5 4 }
.d0 .series { stroke-dasharray: none } .d1 .series { stroke-dasharray: 8 3 } .d2 .series { stroke-dasharray: 2.5 2.5 }
.d3 .series { stroke-dasharray: 9 3 2 3 } .d4 .series { stroke-dasharray: 14 3 }
.d5 .series { stroke-dasharray: 5 2 1.5 2 1.5 2 } .d6 .series { stroke-dasharray: 4.5 4.5 }
.d7 .series { stroke-dasharray: 1.5 4 }
.r0 { color: #0d0887 } .r1 { color: #2f0596 } .r2 { color: #4903a0 } .r3 { color: #6300a7 }
.r4 { color: #7a02a8 } .r5 { color: #8f0da4 } .r6 { color: #a51f99 } .r7 { color: #b6308b }
.r8 { color: #c6417d } .r9 { color: #d5536f } .r10 { color: #e16462 } .r11 { color: #e97257 }
";

const CHART_DARK: &str = "\
.hollow { fill: #15191e }
.ink { color: #e6edf3 }
.faint { color: #9aa4af }
.s0 { color: #56b4e9 }
.s1 { color: #f58c3c }
.s2 { color: #2fc79a }
.s3 { color: #e39bcb }
.s4 { color: #e6edf3 }
.s5 { color: #d9b23c }
.s6 { color: #2f96d0 }
.s7 { color: #8b949e }
.r0 { color: #b12a90 } .r1 { color: #c03a83 } .r2 { color: #cc4977 } .r3 { color: #d9586a }
.r4 { color: #e4695e } .r5 { color: #ed7a52 } .r6 { color: #f58b47 } .r7 { color: #fa9e3b }
.r8 { color: #fdb22f } .r9 { color: #fdc627 } .r10 { color: #f9dd25 } .r11 { color: #f1f525 }
";

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
