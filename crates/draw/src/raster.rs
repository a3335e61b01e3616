//! A picture of pixels: anti-aliased areas and lines, and letters, for files without vectors.
//!
//! Equal calls give equal pixels on every machine: lines need additions, products and roots only, and the letters are
//! embedded pictures of their own, those of Noto Sans Mono.

use glam::DVec2;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, Transform};

/// Red, green and blue.
pub type Colour = [u8; 3];

/// The background.
pub const WHITE: Colour = [255; 3];

/// A size of letters.
#[derive(Clone, Copy, Debug)]
pub struct Letters {
    height: RasterHeight,
    /// Pixels from the top of a letter's picture to the line on which letters stand.
    ascent: usize,
}

impl Letters {
    /// Font size 12 px.
    pub const SMALL: Letters = Letters { height: RasterHeight::Size16, ascent: 13 };
    /// Font size 15 px.
    pub const LARGE: Letters = Letters { height: RasterHeight::Size20, ascent: 16 };

    /// Width of each letter, in pixels.
    pub fn advance(self) -> usize {
        get_raster_width(FontWeight::Regular, self.height)
    }

    /// Returns `text`, or as much of its beginning as fits into `most` pixels with two dots.
    pub fn shortened(self, text: &str, most: f64) -> String {
        let room = (most.max(0.0) as usize) / self.advance();
        match text.chars().count() <= room {
            true => text.into(),
            false => text.chars().take(room.saturating_sub(2)).collect::<String>().trim_end().to_owned() + "..",
        }
    }
}

/// A picture on white.
#[derive(Clone)]
pub struct Raster {
    pixels: Pixmap,
}

impl Raster {
    /// An empty picture; none if it has no pixels, or too many.
    pub fn new(width: u32, height: u32) -> Option<Raster> {
        let mut pixels = Pixmap::new(width, height)?;
        pixels.fill(Color::WHITE);
        Some(Raster { pixels })
    }

    /// The colours, row by row.
    pub fn colours(&self) -> impl Iterator<Item = Colour> + '_ {
        // Everything is opaque, so no colour has to be divided by its opacity.
        self.pixels.pixels().iter().map(|pixel| [pixel.red(), pixel.green(), pixel.blue()])
    }

    /// Fills the inside of a closed polygon, by the rule that counts windings.
    pub fn area(&mut self, corners: &[DVec2], colour: Colour, opacity: f64) {
        if let Some(path) = path(corners, true) {
            let paint = paint(colour, opacity);
            self.pixels.fill_path(&path, &paint, FillRule::Winding, Transform::identity(), None);
        }
    }

    /// Draws the line through `points`, back to the first if it is `closed`.
    pub fn line(&mut self, points: &[DVec2], closed: bool, colour: Colour, width: f64) {
        if let Some(path) = path(points, closed) {
            let stroke = Stroke {
                width: width as f32,
                line_join: LineJoin::Round,
                line_cap: LineCap::Butt,
                ..Stroke::default()
            };
            self.pixels.stroke_path(&path, &paint(colour, 1.0), &stroke, Transform::identity(), None);
        }
    }

    /// Writes `text` with its left end at `at`, on the line y. Letters that the font does not have become `?`.
    pub fn text(&mut self, at: DVec2, text: &str, colour: Colour, letters: Letters) {
        let top = at.y.round() as i64 - letters.ascent as i64;
        for (i, c) in text.chars().enumerate() {
            let left = at.x.round() as i64 + (i * letters.advance()) as i64;
            self.letter((left, top), c, colour, letters.height);
        }
    }

    /// Writes [text](Raster::text) with its middle at `at`.
    pub fn text_in_the_middle(&mut self, at: DVec2, text: &str, colour: Colour, letters: Letters) {
        let half = 0.5 * (text.chars().count() * letters.advance()) as f64;
        self.text(DVec2::new(at.x - half, at.y), text, colour, letters);
    }

    fn letter(&mut self, (left, top): (i64, i64), c: char, colour: Colour, height: RasterHeight) {
        // The Greek letter, which keyboards often give, looks like the sign.
        let c = if c == 'μ' { 'µ' } else { c };
        let of = |c| get_raster(c, FontWeight::Regular, height);
        let Some(letter) = of(c).or_else(|| of('?')) else { return };
        let (width, height) = (i64::from(self.pixels.width()), i64::from(self.pixels.height()));
        let data = self.pixels.data_mut();
        for (row, y) in letter.rows().zip(top..) {
            for (cover, x) in row.iter().zip(left..) {
                if (0..width).contains(&x) && (0..height).contains(&y) {
                    let at = 4 * (y * width + x) as usize;
                    for (below, above) in data[at..at + 3].iter_mut().zip(colour) {
                        *below = between(*below, above, *cover);
                    }
                }
            }
        }
    }
}

/// The colour `share`/255 of the way from `from` to `to`.
pub fn between(from: u8, to: u8, share: u8) -> u8 {
    let (from, to, share) = (u32::from(from), u32::from(to), u32::from(share));
    ((from * (255 - share) + to * share + 127) / 255) as u8
}

fn paint(colour: Colour, opacity: f64) -> Paint<'static> {
    let [red, green, blue] = colour;
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, (255.0 * opacity).round() as u8);
    paint
}

/// None if there are fewer than two points, or one of them is not finite.
fn path(points: &[DVec2], closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    let (first, rest) = points.split_first()?;
    path.move_to(first.x as f32, first.y as f32);
    rest.iter().for_each(|p| path.line_to(p.x as f32, p.y as f32));
    if closed {
        path.close();
    }
    path.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLUE: Colour = [11, 107, 181];

    fn picture(draw: impl FnOnce(&mut Raster)) -> Vec<Colour> {
        let mut raster = Raster::new(40, 20).unwrap();
        draw(&mut raster);
        raster.colours().collect()
    }

    #[test]
    fn lines_are_where_their_points_are() {
        let points = [DVec2::new(5.0, 10.0), DVec2::new(35.0, 10.0)];
        let pixels = picture(|raster| raster.line(&points, false, BLUE, 2.0));
        let blue = |x: usize, y: usize| pixels[40 * y + x] == BLUE;
        assert!((5..35).all(|x| blue(x, 9) && blue(x, 10) && !blue(x, 8) && !blue(x, 11)));
        assert!(!blue(4, 10) && !blue(35, 10));
    }

    #[test]
    fn what_cannot_be_drawn_leaves_the_picture_white() {
        let white = vec![WHITE; 800];
        for points in [vec![], vec![DVec2::ONE], vec![DVec2::NAN; 4], vec![DVec2::ONE, DVec2::INFINITY]] {
            assert_eq!(picture(|raster| raster.line(&points, true, BLUE, 2.0)), white, "{points:?}");
            assert_eq!(picture(|raster| raster.area(&points, BLUE, 1.0)), white, "{points:?}");
        }
        assert!(Raster::new(0, 5).is_none());
    }

    #[test]
    fn letters_stand_on_their_line_and_are_cut_at_the_edge() {
        let dark = |text: &str, at: DVec2| {
            let pixels = picture(|raster| raster.text(at, text, [0; 3], Letters::SMALL));
            let dark = |i: &usize| pixels[*i][0] < 128;
            (0..800).filter(dark).map(|i| (i % 40, i / 40)).collect::<Vec<_>>()
        };
        let one = dark("l", DVec2::new(10.0, 15.0));
        assert!(one.iter().all(|(x, y)| (10..17).contains(x) && (3..15).contains(y)), "{one:?}");
        assert!(one.iter().any(|(_, y)| *y == 14), "{one:?}");
        assert!(!dark("g", DVec2::new(36.0, 19.0)).is_empty());
        assert_eq!(dark("l", DVec2::new(-90.0, 15.0)), []);
        assert_eq!(dark("μ", DVec2::new(10.0, 15.0)), dark("µ", DVec2::new(10.0, 15.0)));
        assert_eq!(dark("長", DVec2::new(10.0, 15.0)), dark("?", DVec2::new(10.0, 15.0)));
    }

    #[test]
    fn what_is_too_long_ends_in_two_dots() {
        let small = |text, most| Letters::SMALL.shortened(text, most);
        assert_eq!(small("amplitude", 63.0), "amplitude");
        assert_eq!(small("amplitude", 62.0), "amplit..");
        assert_eq!(small("a b c", 28.0), "a..");
        assert_eq!(small("amplitude", -1.0), "..");
    }
}
