//! A [`Movie`] as GIF: twenty frames a second, the last one held.

use glam::DVec2;

use super::{GREY, HOLD, MARGIN, Movie, MoviePanel};
use crate::report::members_layout::OWN_SCALES;
use curvelax_base::error::{Error, Result};
use curvelax_draw::{
    gif::{MovingGif, Palette},
    raster::{Colour, Letters, Raster},
};
use curvelax_ensemble::Status;

/// Hundredths of a second for which a frame is shown. Browsers slow down frames of less than 2.
const DELAY: u16 = 5;
const FRAMES_PER_SECOND: f64 = 100.0 / DELAY as f64;

/// Width of the moving curve and of its start.
const CURVE: f64 = 2.0;
const START: f64 = 1.0;
/// Opacity of the inside of a member that has relaxed.
pub(super) const INSIDE: f64 = 0.14;

/// The colours of the gallery on white, which a test compares.
const INK: Colour = [0x24, 0x29, 0x2f];
const GREY_LINE: Colour = [0x8c, 0x95, 0x9f];
const FRAME: Colour = [0xe3, 0xe6, 0xea];

fn colour(status: Status) -> Colour {
    match status {
        Status::Relaxed => [0x0b, 0x6b, 0xb5],
        Status::Unfinished => [0xb3, 0x59, 0x00],
        Status::Singular => [0xc4, 0x26, 0x2e],
        Status::Nonfinite => [0x8a, 0x3a, 0xb9],
        Status::Stalled => [0x5a, 0x6b, 0x00],
        Status::Vanished => [0x00, 0x73, 0x7a],
    }
}

impl Movie {
    /// The text of a GIF file, and the number of its frames.
    ///
    /// # Errors
    /// [`Error::Request`] for a picture higher than the format allows.
    pub fn gif(&self) -> Result<(Vec<u8>, usize)> {
        let size = (u16::try_from(self.size.x as u64), u16::try_from(self.size.y as u64));
        let (Ok(width), Ok(height)) = size else {
            let [x, y] = self.size.to_array();
            return Err(Error::Request(format!("a picture of {x} x {y} pixels; a GIF has at most {}", u16::MAX)));
        };
        let cannot = |e: gif::EncodingError| Error::Failed(format!("cannot make a GIF: {e}"));
        let still = self.still().ok_or_else(|| Error::Failed("a picture without pixels".into()))?;
        let mut gif = MovingGif::new(width, height, self.palette()).map_err(cannot)?;
        let last = (self.seconds * FRAMES_PER_SECOND).round().max(1.0) as usize;
        for i in 0..=last {
            let mut picture = still.clone();
            self.draw(&mut picture, self.pace.time(i as f64 / last as f64));
            let delay = if i == last { (100.0 * HOLD) as u16 } else { DELAY };
            gif.add(&picture, delay).map_err(cannot)?;
        }
        Ok((gif.finish().map_err(cannot)?, last + 1))
    }

    /// Few colours for the words, enough for smooth lines, and those of the members that are there.
    fn palette(&self) -> Palette {
        let mut palette = Palette::default();
        palette.add(FRAME, 1);
        palette.add(INK, 6);
        palette.add(GREY_LINE, 4);
        for status in Status::ALL {
            if self.panels.iter().any(|panel| panel.member.status == status) {
                palette.add(colour(status), 14);
            }
        }
        palette
    }

    /// What does not move.
    fn still(&self) -> Option<Raster> {
        let mut picture = Raster::new(self.size.x as u32, self.size.y as u32)?;
        let words = self.head();
        let head = DVec2::new(self.size.x - MARGIN - (words.len() * Letters::SMALL.advance()) as f64, 28.0);
        if head.x > 0.5 * self.size.x || words != GREY {
            picture.text(head, &words, INK, Letters::SMALL);
        }
        for panel in &self.panels {
            let (low, high) = (panel.corner + 0.5, panel.corner + self.frame - 0.5);
            let frame = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
            picture.line(&frame, true, FRAME, 1.0);
            picture.line(panel.member.start(), true, GREY_LINE, START);
            for (i, name) in panel.names.iter().enumerate() {
                self.write(&mut picture, panel, i, name, INK);
            }
        }
        let tick = DVec2::new(0.0, 4.0);
        match self.bar() {
            Some(([left, right], text)) => {
                for line in [[left, right], [left - tick, left + tick], [right - tick, right + tick]] {
                    picture.line(&line, false, INK, 1.0);
                }
                picture.text(right + DVec2::new(8.0, 4.0), text, INK, Letters::SMALL);
            }
            None => picture.text(self.foot() + tick, OWN_SCALES, INK, Letters::SMALL),
        }
        Some(picture)
    }

    /// What moves, at the time `t`.
    fn draw(&self, picture: &mut Raster, t: f64) {
        picture.text(DVec2::new(MARGIN, 29.0), &self.clock(t), INK, Letters::LARGE);
        for panel in &self.panels {
            let (nodes, colour) = (panel.member.at(t), colour(panel.member.status));
            let (told_at, end) = &panel.end;
            if t >= *told_at {
                if panel.member.status == Status::Relaxed {
                    picture.area(&nodes, colour, INSIDE);
                }
                self.write(picture, panel, panel.names.len(), end, colour);
            }
            picture.line(&nodes, true, colour, CURVE);
        }
    }

    /// Writes line `i` of the words below a panel.
    fn write(&self, picture: &mut Raster, panel: &MoviePanel, i: usize, words: &str, colour: Colour) {
        let words = Letters::SMALL.shortened(words, self.frame.x);
        picture.text_in_the_middle(self.words(panel, i), &words, colour, Letters::SMALL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{gallery, movie::tests::movie};
    use curvelax_draw::medium::Medium;

    #[test]
    fn the_colours_are_those_of_the_gallery() {
        let word = |[r, g, b]: Colour| format!("#{r:02x}{g:02x}{b:02x}");
        let style = gallery::style(Medium::Screen);
        let (light, _) = style.split_once("@media").unwrap();
        for status in Status::ALL {
            let rule = format!(".{} path {{ stroke: {}", status.name(), word(colour(status)));
            assert!(light.contains(&rule), "{rule}");
        }
        for rule in [
            format!(".frame {{ fill: none; stroke: {}", word(FRAME)),
            format!("font-size: 12px; fill: {}", word(INK)),
            format!(".before {{ fill: none; stroke: {}", word(GREY_LINE)),
        ] {
            assert!(light.contains(&rule), "{rule}");
        }
    }

    #[test]
    fn a_movie_lasts_as_long_as_requested_and_stays_small() {
        let (bytes, frames) = movie(12, 800).gif().unwrap();
        assert_eq!(frames, 21);
        let mut decoder = ::gif::Decoder::new(&bytes[..]).unwrap();
        let mut delays = Vec::new();
        while let Some(frame) = decoder.next_frame_info().unwrap() {
            delays.push(frame.delay);
        }
        assert_eq!((delays.len(), delays.iter().sum::<u16>(), delays[20]), (21, 200, 100));
        assert!(bytes.len() < 450_000, "{}", bytes.len());
        assert_eq!(bytes, movie(12, 800).gif().unwrap().0);
        // To look at: CURVELAX_GALLERY=FOLDER cargo test movie
        if let Some(folder) = std::env::var_os("CURVELAX_GALLERY") {
            std::fs::write(std::path::Path::new(&folder).join("movie.gif"), &bytes).unwrap();
        }
    }

    #[test]
    fn a_member_is_filled_and_named_when_it_has_relaxed() {
        let movie = movie(1, 400);
        let shown = |t: f64| {
            let mut picture = movie.still().unwrap();
            movie.draw(&mut picture, t);
            picture
        };
        let middle = movie.panels[0].corner + 0.5 * movie.frame;
        let below = movie.words(&movie.panels[0], 1);
        let blue = |t: f64| {
            let pixels: Vec<Colour> = shown(t).colours().collect();
            let at = |x: f64, y: f64| pixels[400 * y as usize + x as usize];
            let word = (-40..40).any(|i| at(below.x + f64::from(i), below.y - 3.0)[0] < 128);
            (at(middle.x, middle.y) != [255; 3], word)
        };
        assert_eq!(movie.panels[0].end, (0.4, "relaxed at t = 0.4".into()));
        assert_eq!([0.0, 0.39, 0.4, 2.0].map(blue), [(false, false), (false, false), (true, true), (true, true)]);
    }
}
