//! Pictures for papers: the SVG of this program as PNG and PDF, at the width of a journal's column.
//!
//! usvg reads a picture, tiny-skia makes pixels of its paths, and pdf-writer a PDF. All text is in a font that is
//! compiled in, so that the same picture is the same on every machine.

mod pdf;
mod pixels;
mod width;

use std::{collections::BTreeSet, sync::Arc};

use curvelax_base::{
    error::{Error, Result},
    text::count,
};
use tiny_skia::Pixmap;
use usvg::{Color, Group, Node, Options, Paint, Transform, Tree, fontdb::Database};

pub use width::{MM, PaperWidth};

/// The font, a part of DejaVu Sans: charts are laid out by the widths of its letters.
const FONT: &[u8] = include_bytes!("../font/DejaVuSans-subset.ttf");
const FAMILY: &str = "DejaVu Sans";

/// Dots per inch that are accepted, and those of journals for drawings with text.
pub const DPI: [u32; 2] = [72, 1200];
/// The default.
pub const USUAL_DPI: i64 = 600;
/// Maximum pixels of a picture, at 4 bytes each.
const MAX_PIXELS: f64 = 1e8;
const MM_PER_INCH: f64 = 25.4;
const POINTS_PER_INCH: f64 = 72.0;

/// A format of pictures for papers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PaperFormat {
    /// Pixels, with their density.
    Png {
        /// Dots per inch.
        dpi: u32,
    },
    /// Lines and letters of any size.
    Pdf,
}

impl PaperFormat {
    /// Pixels, `dpi` per inch.
    ///
    /// # Errors
    /// [`Error::Request`] outside of [`DPI`].
    pub fn png(dpi: i64) -> Result<PaperFormat> {
        let [least, most] = DPI;
        match u32::try_from(dpi).ok().filter(|dpi| (least..=most).contains(dpi)) {
            Some(dpi) => Ok(PaperFormat::Png { dpi }),
            None => Err(Error::value("dpi", dpi, "out of range", &format!("use {least} to {most} dots per inch"))),
        }
    }
}

/// What reads pictures: it has the font.
pub struct Printer(Options<'static>);

impl Default for Printer {
    fn default() -> Printer {
        let mut fonts = Database::new();
        fonts.load_font_data(FONT.to_vec());
        fonts.set_sans_serif_family(FAMILY);
        Printer(Options { font_family: FAMILY.into(), fontdb: Arc::new(fonts), ..Options::default() })
    }
}

impl Printer {
    /// Reads the text of an SVG file that is to be `width` wide, with a title for readers of a PDF.
    ///
    /// # Errors
    /// [`Error::Failed`] for text that is not SVG, and for what pictures of this program do not have.
    pub fn read(&self, title: &str, svg: &str, width: PaperWidth) -> Result<Print> {
        let failed = |problem: String| Error::Failed(format!("{title}: {problem}"));
        let tree = Tree::from_str(svg, &self.0).map_err(|e| failed(format!("not an SVG file ({e})")))?;
        match unknown_in(tree.root()) {
            Some(unknown) => Err(failed(format!("has {unknown}, which no picture of this program has"))),
            None => Ok(Print { title: title.into(), tree, width }),
        }
    }
}

/// A picture of known width.
pub struct Print {
    title: String,
    tree: Tree,
    width: PaperWidth,
}

impl Print {
    /// The file in this format. Equal pictures give equal bytes.
    ///
    /// # Errors
    /// [`Error::Request`] for more pixels than fit into memory.
    pub fn file(&self, format: PaperFormat) -> Result<Vec<u8>> {
        match format {
            PaperFormat::Png { dpi } => self.png(dpi),
            PaperFormat::Pdf => self.pdf(),
        }
    }

    /// Letters that the font lacks: an empty box stands for each.
    pub fn missing(&self) -> BTreeSet<char> {
        let mut letters = BTreeSet::new();
        missing_in(self.tree.root(), &mut letters);
        letters
    }

    fn png(&self, dpi: u32) -> Result<Vec<u8>> {
        let dots = self.width.mm() / MM_PER_INCH * f64::from(dpi);
        let scale = dots / f64::from(self.tree.size().width());
        let size = [self.tree.size().width(), self.tree.size().height()].map(|side| (f64::from(side) * scale).round());
        let [width, height] = size.map(|side| side as u32);
        let pixels = size[0] * size[1];
        let pixmap = if pixels > MAX_PIXELS { None } else { Pixmap::new(width, height) };
        let Some(mut pixmap) = pixmap else {
            let problem = format!("{} would have {width} × {height} pixels, 10⁸ are the most", self.title);
            return Err(Error::value("dpi", dpi, &problem, "use fewer dots per inch, a smaller width, or pdf"));
        };
        pixmap.fill(tiny_skia::Color::WHITE);
        pixels::draw(self.tree.root(), Transform::from_scale(scale as f32, scale as f32), &mut pixmap.as_mut());
        // Nothing shines through white paper.
        let rgb: Vec<u8> = pixmap.data().chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        encoded([width, height], dpi, &rgb).map_err(|e| Error::Failed(format!("{}: no PNG ({e})", self.title)))
    }

    fn pdf(&self) -> Result<Vec<u8>> {
        let scale = (self.width.mm() / MM_PER_INCH * POINTS_PER_INCH) as f32 / self.tree.size().width();
        pdf::file(&self.tree, scale, &self.title)
            .map_err(|problem| Error::Failed(format!("{}: no PDF ({problem})", self.title)))
    }
}

/// A PNG file of rows of red, green and blue.
fn encoded([width, height]: [u32; 2], dpi: u32, rgb: &[u8]) -> Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let per_metre = (f64::from(dpi) * 1000.0 / MM_PER_INCH).round() as u32;
    let unit = png::Unit::Meter;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit }));
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(file)
}

/// What neither format draws, in a group.
fn unknown_in(group: &Group) -> Option<&'static str> {
    let plain = |paint: &Paint| matches!(paint, Paint::Color(_));
    if group.opacity() != usvg::Opacity::ONE || group.blend_mode() != usvg::BlendMode::Normal {
        return Some("a group with an opacity");
    }
    if group.clip_path().is_some() || group.mask().is_some() || !group.filters().is_empty() {
        return Some("a group that is clipped, masked or filtered");
    }
    group.children().iter().find_map(|node| match node {
        Node::Group(group) => unknown_in(group),
        Node::Path(path) => {
            let paints = [path.fill().map(|fill| fill.paint()), path.stroke().map(|stroke| stroke.paint())];
            (!paints.into_iter().flatten().all(plain)).then_some("a paint that is no colour")
        }
        Node::Text(text) => text.layouted().iter().find_map(|span| match span {
            span if span.stroke.is_some() => Some("text with outlines"),
            span if span.underline.is_some() || span.overline.is_some() || span.line_through.is_some() => {
                Some("text with lines")
            }
            span if !span.fill.iter().all(|fill| plain(fill.paint())) => Some("a paint that is no colour"),
            _ => None,
        }),
        Node::Image(_) => Some("an image"),
    })
}

/// Of a picture that was read.
fn colour(paint: &Paint) -> Color {
    match paint {
        Paint::Color(colour) => *colour,
        // `unknown_in` refuses it.
        _ => Color::black(),
    }
}

/// Adds the letters of a group that the font lacks.
fn missing_in(group: &Group, letters: &mut BTreeSet<char>) {
    for node in group.children() {
        match node {
            Node::Group(group) => missing_in(group, letters),
            Node::Text(text) => {
                let glyphs = text.layouted().iter().flat_map(|span| &span.positioned_glyphs);
                letters.extend(glyphs.filter(|glyph| glyph.id.0 == 0).flat_map(|glyph| glyph.text.chars()));
            }
            _ => {}
        }
    }
}

/// What is said of letters that the font lacks; nothing if there are none.
pub fn missing_letters(missing: &BTreeSet<char>) -> Option<String> {
    let shown: String = missing.iter().take(20).collect();
    let number = count(missing.len() as u64, "letter");
    (!missing.is_empty()).then(|| format!("{number} not in the font of png and pdf, drawn as empty boxes: {shown}"))
}

#[cfg(test)]
mod tests;
