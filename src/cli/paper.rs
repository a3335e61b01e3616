//! The flags of pictures for papers: `--format`, `--width`, `--dpi`.

use std::collections::BTreeSet;

use clap::ValueEnum;

use super::flags;
use crate::{
    error::{Error, Result},
    paper::{PaperFormat, PaperWidth, Printer, USUAL_DPI},
};

/// The formats of pictures.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PictureFormat {
    Svg,
    Png,
    Pdf,
}

/// The flags of commands that draw a picture next to its data.
#[derive(clap::Args)]
pub(super) struct PaperFlags {
    /// Formats of the pictures: svg for screens, png and pdf for papers [default: svg]
    #[arg(long, value_name = "FORMAT,...", value_delimiter = ',', value_enum, help_heading = flags::OUTPUT)]
    format: Vec<PictureFormat>,
    /// Width of png and pdf: column (85 mm), page (170 mm) or 80 to 300 mm [default: column]
    #[arg(long, value_name = "WIDTH", help_heading = flags::OUTPUT)]
    width: Option<String>,
    /// Dots per inch of png, 72 to 1200 [default: 600]
    #[arg(long, value_name = "DPI", allow_negative_numbers = true, help_heading = flags::OUTPUT)]
    dpi: Option<i64>,
}

impl PaperFlags {
    /// Whether one is given.
    pub(super) fn is_given(&self) -> bool {
        !self.format.is_empty() || self.width.is_some() || self.dpi.is_some()
    }

    /// Whether the picture for screens is drawn.
    pub(super) fn on_screen(&self) -> bool {
        self.format.is_empty() || self.format.contains(&PictureFormat::Svg)
    }

    /// Returns what pictures for papers are made of.
    ///
    /// # Errors
    /// [`Error::Request`] for a wrong width or density, and for one that no format uses.
    pub(super) fn prints(&self) -> Result<Prints> {
        let has = |format: PictureFormat| self.format.contains(&format);
        let unused = |key: &str, value: &dyn std::fmt::Display, formats: &str| {
            Err(Error::value(key, value, "no picture uses it", &format!("add --format {formats}, or leave it out")))
        };
        let png = PaperFormat::png(self.dpi.unwrap_or(USUAL_DPI))?;
        let width = self.width.as_deref().map(str::parse).transpose()?.unwrap_or_default();
        match (&self.width, self.dpi) {
            (Some(width), _) if !has(PictureFormat::Png) && !has(PictureFormat::Pdf) => {
                return unused("width", width, "png, or pdf");
            }
            (_, Some(dpi)) if !has(PictureFormat::Png) => return unused("dpi", &dpi, "png"),
            _ => {}
        }
        let formats = [(PictureFormat::Png, ("png", png)), (PictureFormat::Pdf, ("pdf", PaperFormat::Pdf))];
        let formats = formats.into_iter().filter(|(format, _)| has(*format)).map(|(_, paper)| paper).collect();
        Ok(Prints { width, formats })
    }
}

/// Pictures for papers, as they were asked for.
pub(super) struct Prints {
    pub(super) width: PaperWidth,
    /// Extension and format.
    pub(super) formats: Vec<(&'static str, PaperFormat)>,
}

impl Prints {
    /// A picture in each format: extension and bytes; letters that could not be drawn are added to `missing`.
    pub(super) fn of(
        &self,
        printer: &Printer,
        (title, svg): (&str, &str),
        missing: &mut BTreeSet<char>,
    ) -> Result<Vec<(&'static str, Vec<u8>)>> {
        let print = printer.read(title, svg, self.width)?;
        missing.append(&mut print.missing());
        self.formats.iter().map(|(extension, format)| Ok((*extension, print.file(*format)?))).collect()
    }
}
