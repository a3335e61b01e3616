//! The flags of pictures for papers: `--format`, `--width`, `--dpi`.

use std::{cell::LazyCell, collections::BTreeSet};

use clap::ValueEnum;

use super::{flags, note};
use crate::{
    draw::medium::Medium,
    error::{Error, Result},
    files::{OutputFolder, part_file::PartFile},
    paper::{PaperFormat, PaperWidth, Printer, USUAL_DPI, missing_letters},
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

    /// Returns what pictures are made of.
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
        let on_screen = self.format.is_empty() || has(PictureFormat::Svg);
        Ok(Prints { on_screen, formats, width, printer: LazyCell::new(Printer::default), missing: BTreeSet::new() })
    }
}

/// Pictures in the formats that were asked for.
pub(super) struct Prints {
    /// Whether they are drawn for screens, as svg.
    pub(super) on_screen: bool,
    /// Extension and format of those for papers.
    formats: Vec<(&'static str, PaperFormat)>,
    width: PaperWidth,
    printer: LazyCell<Printer>,
    /// Letters that could not be drawn.
    missing: BTreeSet<char>,
}

impl Prints {
    /// The extensions of those for papers.
    pub(super) fn on_paper(&self) -> impl Iterator<Item = &'static str> {
        self.formats.iter().map(|(extension, _)| *extension)
    }

    /// The extensions of all.
    pub(super) fn extensions(&self) -> impl Iterator<Item = &'static str> {
        self.on_screen.then_some("svg").into_iter().chain(self.on_paper())
    }

    /// Pixels across those for papers; none if there are none.
    pub(super) fn pixels(&self) -> Option<f64> {
        (!self.formats.is_empty()).then(|| self.width.pixels())
    }

    /// Writes what `draw` draws in each format, into the file that `name` gives for its extension.
    pub(super) fn write(
        &mut self,
        folder: &OutputFolder,
        name: impl Fn(&str) -> String,
        title: &str,
        draw: impl Fn(Medium) -> String,
    ) -> Result<Vec<PartFile>> {
        let mut files = Vec::new();
        if self.on_screen {
            files.push(folder.write(&name("svg"), draw(Medium::Screen))?);
        }
        if let Some(pixels) = self.pixels() {
            for (extension, content) in self.of(title, &draw(Medium::Paper(pixels)))? {
                files.push(folder.write(&name(extension), content)?);
            }
        }
        Ok(files)
    }

    /// A picture in each format for papers: extension and bytes.
    pub(super) fn of(&mut self, title: &str, svg: &str) -> Result<Vec<(&'static str, Vec<u8>)>> {
        let print = self.printer.read(title, svg, self.width)?;
        self.missing.append(&mut print.missing());
        self.formats.iter().map(|(extension, format)| Ok((*extension, print.file(*format)?))).collect()
    }

    /// Says which letters could not be drawn, if there are any.
    pub(super) fn note_missing(&self) {
        missing_letters(&self.missing).iter().for_each(|letters| note(&format!("note: {letters}")));
    }
}
