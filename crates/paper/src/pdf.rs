//! Pictures as PDF: paths, and text in the letters of the font that it uses.

use std::collections::BTreeMap;

use flate2::{Compression, write::ZlibEncoder};
use pdf_writer::{
    Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr,
    types::{CidFontType, FontFlags, LineCapStyle, LineJoinStyle, SystemInfo, UnicodeCmap},
};
use subsetter::GlyphRemapper;
use ttf_parser::{Face, GlyphId};
use usvg::{
    Color, Fill, FillRule, Group, LineCap, LineJoin, Node, PaintOrder, Path, Stroke, Text, Transform, Tree,
    layout::PositionedGlyph, tiny_skia_path::PathSegment,
};

use super::{FONT, colour};

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const INFO: Ref = Ref::new(5);
const LETTERS: Ref = Ref::new(6);
const CID_FONT: Ref = Ref::new(7);
const DESCRIPTOR: Ref = Ref::new(8);
const FONT_FILE: Ref = Ref::new(9);
const TO_UNICODE: Ref = Ref::new(10);
/// The opacities have the numbers from here on.
const OPACITIES: i32 = 11;

/// The font's name on the page.
const LETTERS_NAME: Name = Name(b"F");
/// The marked part of a font has a tag of six letters before its name.
const FONT_NAME: Name = Name(b"CURVEL+DejaVuSans");
const SYSTEM: SystemInfo = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };
/// Units of a font of PDF.
const PER_EM: f32 = 1000.0;
/// Width of upright strokes in them, which readers use for a font of their own where this one fails.
const STEM: f32 = 88.0;

/// The file of a picture whose pixels have `scale` points.
pub(super) fn file(tree: &Tree, scale: f32, title: &str) -> Result<Vec<u8>, String> {
    let face = Face::parse(FONT, 0).map_err(|e| format!("its font: {e}"))?;
    let mut page = PdfPage {
        content: Content::new(),
        opacities: Vec::new(),
        letters: PdfLetters { face, numbers: GlyphRemapper::new(), texts: BTreeMap::new() },
    };
    let [width, height] = [tree.size().width(), tree.size().height()].map(|side| side * scale);
    // SVG counts downwards, PDF upwards.
    page.content.transform([scale, 0.0, 0.0, -scale, 0.0, height]);
    page.group(tree.root());

    let mut pdf = Pdf::new();
    pdf.catalog(CATALOG).pages(PAGES);
    pdf.pages(PAGES).kids([PAGE]).count(1);
    pdf.document_info(INFO).title(TextStr(title)).creator(TextStr("curvelax"));
    let mut of_page = pdf.page(PAGE);
    of_page.media_box(Rect::new(0.0, 0.0, width, height)).parent(PAGES).contents(CONTENT);
    let mut resources = of_page.resources();
    if !page.letters.texts.is_empty() {
        resources.fonts().pair(LETTERS_NAME, LETTERS);
    }
    let numbers = || (OPACITIES..).map(Ref::new);
    let mut states = resources.ext_g_states();
    for (rank, id) in (0..page.opacities.len()).zip(numbers()) {
        states.pair(Name(opacity_name(rank).as_bytes()), id);
    }
    states.finish();
    resources.finish();
    of_page.finish();
    for (opacity, id) in page.opacities.iter().zip(numbers()) {
        pdf.ext_graphics(id).stroking_alpha(*opacity).non_stroking_alpha(*opacity);
    }
    pdf.stream(CONTENT, &deflated(&page.content.finish())).filter(Filter::FlateDecode);
    if !page.letters.texts.is_empty() {
        page.letters.write(&mut pdf)?;
    }
    Ok(pdf.finish())
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing into memory cannot fail.
    let _ = std::io::Write::write_all(&mut encoder, bytes);
    encoder.finish().unwrap_or_default()
}

fn opacity_name(rank: usize) -> String {
    format!("O{rank}")
}

fn matrix(of: Transform) -> [f32; 6] {
    [of.sx, of.ky, of.kx, of.sy, of.tx, of.ty]
}

/// What is drawn on a page.
struct PdfPage<'a> {
    content: Content,
    opacities: Vec<f32>,
    letters: PdfLetters<'a>,
}

impl PdfPage<'_> {
    fn group(&mut self, group: &Group) {
        let moved = !group.transform().is_identity();
        if moved {
            self.content.save_state().transform(matrix(group.transform()));
        }
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group),
                Node::Path(path) => self.path(path),
                Node::Text(text) => self.text(text),
                // Refused when it was read.
                Node::Image(_) => {}
            }
        }
        if moved {
            self.content.restore_state();
        }
    }

    fn path(&mut self, path: &Path) {
        if !path.is_visible() {
            return;
        }
        let fill_first = path.paint_order() == PaintOrder::FillAndStroke;
        for filling in [fill_first, !fill_first] {
            match (path.fill(), path.stroke()) {
                (Some(fill), _) if filling => {
                    self.fill(fill);
                    self.outline(path);
                    match fill.rule() {
                        FillRule::NonZero => self.content.fill_nonzero(),
                        FillRule::EvenOdd => self.content.fill_even_odd(),
                    };
                }
                (_, Some(stroke)) if !filling => {
                    self.stroke(stroke);
                    self.outline(path);
                    self.content.stroke();
                }
                _ => {}
            }
        }
    }

    fn outline(&mut self, path: &Path) {
        let mut at = (0.0, 0.0);
        for segment in path.data().segments() {
            match segment {
                PathSegment::MoveTo(p) => self.content.move_to(p.x, p.y),
                PathSegment::LineTo(p) => self.content.line_to(p.x, p.y),
                PathSegment::QuadTo(q, p) => {
                    let towards = |from: f32, to: f32| from + 2.0 / 3.0 * (to - from);
                    let [x1, y1] = [towards(at.0, q.x), towards(at.1, q.y)];
                    self.content.cubic_to(x1, y1, towards(p.x, q.x), towards(p.y, q.y), p.x, p.y)
                }
                PathSegment::CubicTo(a, b, p) => self.content.cubic_to(a.x, a.y, b.x, b.y, p.x, p.y),
                PathSegment::Close => self.content.close_path(),
            };
            if let PathSegment::MoveTo(p)
            | PathSegment::LineTo(p)
            | PathSegment::QuadTo(_, p)
            | PathSegment::CubicTo(_, _, p) = segment
            {
                at = (p.x, p.y);
            }
        }
    }

    fn fill(&mut self, fill: &Fill) {
        self.opacity(fill.opacity().get());
        match gray_or_rgb(colour(fill.paint())) {
            (Some(gray), _) => self.content.set_fill_gray(gray),
            (None, [red, green, blue]) => self.content.set_fill_rgb(red, green, blue),
        };
    }

    fn stroke(&mut self, stroke: &Stroke) {
        self.opacity(stroke.opacity().get());
        match gray_or_rgb(colour(stroke.paint())) {
            (Some(gray), _) => self.content.set_stroke_gray(gray),
            (None, [red, green, blue]) => self.content.set_stroke_rgb(red, green, blue),
        };
        let cap = match stroke.linecap() {
            LineCap::Butt => LineCapStyle::ButtCap,
            LineCap::Round => LineCapStyle::RoundCap,
            LineCap::Square => LineCapStyle::ProjectingSquareCap,
        };
        let join = match stroke.linejoin() {
            LineJoin::Miter | LineJoin::MiterClip => LineJoinStyle::MiterJoin,
            LineJoin::Round => LineJoinStyle::RoundJoin,
            LineJoin::Bevel => LineJoinStyle::BevelJoin,
        };
        let dashes = stroke.dasharray().unwrap_or_default().iter().copied();
        self.content.set_line_width(stroke.width().get()).set_line_cap(cap).set_line_join(join);
        self.content.set_miter_limit(stroke.miterlimit().get()).set_dash_pattern(dashes, stroke.dashoffset());
    }

    fn opacity(&mut self, opacity: f32) {
        let rank = self.opacities.iter().position(|own| *own == opacity).unwrap_or_else(|| {
            self.opacities.push(opacity);
            self.opacities.len() - 1
        });
        self.content.set_parameters(Name(opacity_name(rank).as_bytes()));
    }

    fn text(&mut self, text: &Text) {
        for span in text.layouted().iter().filter(|span| span.visible) {
            let (Some(fill), size) = (&span.fill, span.font_size.get()) else { continue };
            self.fill(fill);
            self.content.begin_text().set_font(LETTERS_NAME, size);
            let mut glyphs = &span.positioned_glyphs[..];
            while !glyphs.is_empty() {
                let shown = self.line(glyphs, size);
                glyphs = &glyphs[shown..];
            }
            self.content.end_text();
        }
    }

    /// Shows the glyphs that stand upright on one line, so that text can be found and edited; says how many.
    fn line(&mut self, glyphs: &[PositionedGlyph], size: f32) -> usize {
        let units = f32::from(self.letters.face.units_per_em()) / size;
        // What is left without the size: place and direction.
        let place = |glyph: &PositionedGlyph| glyph.outline_transform().pre_scale(units, units);
        let start = place(&glyphs[0]);
        // Nothing is seen of letters without area.
        let Some(back) = start.invert() else { return glyphs.len() };
        self.content.set_text_matrix(matrix(start));
        let mut operation = self.content.show_positioned();
        let mut items = operation.items();
        let (mut pen, mut run, mut count) = (0.0, Vec::new(), 0);
        for glyph in glyphs {
            let here = back.pre_concat(place(glyph));
            if here.ty.abs() > 1e-2 || (here.sx - 1.0).abs() > 1e-3 || here.ky.abs() > 1e-3 {
                break;
            }
            let letter = self.letters.of_glyph(glyph.id.0, &glyph.text);
            // Kerning, in thousandths of the size and to the left.
            let shift = ((pen - here.tx) / size * PER_EM).round();
            if shift != 0.0 {
                items.show(Str(&run)).adjust(shift);
                run.clear();
            }
            run.extend(letter.to_be_bytes());
            pen = here.tx + self.letters.width(glyph.id.0) / PER_EM * size;
            count += 1;
        }
        items.show(Str(&run));
        count
    }
}

/// Gray, if it is one: printers have an ink for it.
fn gray_or_rgb(colour: Color) -> (Option<f32>, [f32; 3]) {
    let shares = [colour.red, colour.green, colour.blue].map(|share| f32::from(share) / 255.0);
    (shares.iter().all(|share| *share == shares[0]).then_some(shares[0]), shares)
}

/// The letters in use, numbered anew.
struct PdfLetters<'a> {
    face: Face<'a>,
    numbers: GlyphRemapper,
    /// Text of each by its number.
    texts: BTreeMap<u16, String>,
}

impl PdfLetters<'_> {
    /// The number of a glyph that stands for this text.
    fn of_glyph(&mut self, glyph: u16, text: &str) -> u16 {
        let number = self.numbers.remap(glyph);
        self.texts.entry(number).or_insert_with(|| text.into());
        number
    }

    /// In units of PDF.
    fn scaled(&self, value: impl Into<f32>) -> f32 {
        value.into() / f32::from(self.face.units_per_em()) * PER_EM
    }

    fn width(&self, glyph: u16) -> f32 {
        self.scaled(self.face.glyph_hor_advance(GlyphId(glyph)).unwrap_or(0))
    }

    fn write(&self, pdf: &mut Pdf) -> Result<(), String> {
        let part = subsetter::subset(FONT, 0, &self.numbers).map_err(|e| format!("its font: {e}"))?;
        pdf.type0_font(LETTERS)
            .base_font(FONT_NAME)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(CID_FONT)
            .to_unicode(TO_UNICODE);
        let mut font = pdf.cid_font(CID_FONT);
        font.subtype(CidFontType::Type2).base_font(FONT_NAME).system_info(SYSTEM).font_descriptor(DESCRIPTOR);
        font.default_width(0.0).cid_to_gid_map_predefined(Name(b"Identity"));
        font.widths().consecutive(0, self.numbers.remapped_gids().map(|glyph| self.width(glyph)));
        font.finish();
        let bounds = self.face.global_bounding_box();
        let [left, low, right, high] =
            [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(|side| self.scaled(side));
        pdf.font_descriptor(DESCRIPTOR)
            .name(FONT_NAME)
            .flags(FontFlags::SYMBOLIC)
            .bbox(Rect::new(left, low, right, high))
            .italic_angle(0.0)
            .ascent(self.scaled(self.face.ascender()))
            .descent(self.scaled(self.face.descender()))
            .cap_height(self.scaled(self.face.capital_height().unwrap_or(self.face.ascender())))
            .stem_v(STEM)
            .font_file2(FONT_FILE);
        pdf.stream(FONT_FILE, &deflated(&part)).filter(Filter::FlateDecode).pair(Name(b"Length1"), part.len() as i32);
        let mut texts = UnicodeCmap::new(Name(b"Custom"), SYSTEM);
        for (number, text) in &self.texts {
            texts.pair_with_multiple(*number, text.chars());
        }
        pdf.cmap(TO_UNICODE, &deflated(&texts.finish())).filter(Filter::FlateDecode);
        Ok(())
    }
}
