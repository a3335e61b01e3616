//! Widths of pictures in papers.

use std::{fmt, str::FromStr};

use curvelax_base::error::{Error, Result, did_you_mean};

use super::{MM_PER_INCH, POINTS_PER_INCH};

/// Names of widths, and these in mm: what Elsevier, Springer, APS and IEEE have for columns is 84 to 90 mm, for pages
/// 170 to 190 mm.
const NAMED: [(&str, f64); 2] = [("column", 85.0), ("page", 170.0)];
/// Widths that are accepted, in mm: charts need room for their labels.
pub const MM: [f64; 2] = [80.0, 300.0];
/// Size of most text of a picture in pixels, and on paper in points.
const PIXELS: f64 = 12.0;
const POINTS: f64 = 7.0;

/// The width of a picture on paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperWidth(f64);

impl Default for PaperWidth {
    /// A column.
    fn default() -> PaperWidth {
        PaperWidth(NAMED[0].1)
    }
}

impl PaperWidth {
    /// In mm.
    pub fn mm(self) -> f64 {
        self.0
    }

    /// Pixels across a picture whose text has 7 points.
    pub fn pixels(self) -> f64 {
        self.0 / MM_PER_INCH * POINTS_PER_INCH * PIXELS / POINTS
    }
}

impl FromStr for PaperWidth {
    type Err = Error;

    /// `column`, `page` or a number of mm.
    fn from_str(text: &str) -> Result<PaperWidth> {
        let names = NAMED.map(|(name, _)| name);
        if let Some((_, mm)) = NAMED.iter().find(|(name, _)| *name == text) {
            return Ok(PaperWidth(*mm));
        }
        let [least, most] = MM;
        let allowed = format!("use column (85 mm), page (170 mm) or {least} to {most} mm");
        match text.trim_end_matches("mm").trim_end().parse::<f64>() {
            Ok(mm) if (least..=most).contains(&mm) => Ok(PaperWidth(mm)),
            Ok(_) => Err(Error::value("width", text, "out of range", &allowed)),
            Err(_) => {
                let problem = format!("not a width{}", did_you_mean(text, names));
                Err(Error::value("width", text, &problem, &allowed))
            }
        }
    }
}

impl fmt::Display for PaperWidth {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} mm", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_have_names_or_numbers_in_mm() {
        for (text, mm) in
            [("column", 85.0), ("page", 170.0), ("90", 90.0), ("127.5", 127.5), ("90mm", 90.0), ("90 mm", 90.0)]
        {
            assert_eq!(text.parse::<PaperWidth>().unwrap().mm(), mm, "{text}");
        }
        for (text, said) in [
            (
                "colunm",
                "--width colunm: not a width (did you mean `column`?); use column (85 mm), page (170 mm) or 80 to",
            ),
            ("8.5cm", "not a width"),
            ("79", "--width 79: out of range; use column (85 mm), page (170 mm) or 80 to 300 mm"),
            ("301", "out of range"),
            ("NaN", "out of range"),
            ("", "not a width"),
        ] {
            let error = text.parse::<PaperWidth>().unwrap_err();
            assert!(error.to_string().contains(said) && error.exit_code() == 2, "{text}: {error}");
        }
    }

    #[test]
    fn text_has_seven_points_at_every_width() {
        for mm in MM {
            let width = PaperWidth(mm);
            let points_per_pixel = mm / 25.4 * 72.0 / width.pixels();
            assert!((12.0 * points_per_pixel - 7.0).abs() < 1e-12);
        }
    }
}
