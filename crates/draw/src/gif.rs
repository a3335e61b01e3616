//! Moving pictures as GIF: one palette, and of each frame only what differs from the one before.
//!
//! The format knows 256 colours and delays of hundredths of a second. Few colours keep files small, as each pixel then
//! has few bits and equal pixels follow each other.

use std::collections::HashMap;

use gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};

use super::raster::{Colour, Raster, WHITE, between};

/// Pixels that keep what the frame before shows have this index.
const UNCHANGED: u8 = 0;

/// The colours of a moving picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Palette(Vec<Colour>);

/// White alone.
impl Default for Palette {
    fn default() -> Palette {
        // The first is never drawn.
        Palette(vec![WHITE, WHITE])
    }
}

impl Palette {
    /// Adds `steps` colours at equal distances from white to `colour`, which is the last of them.
    pub fn add(&mut self, colour: Colour, steps: u8) {
        for step in 1..=steps {
            let share = (255 * u32::from(step) / u32::from(steps)) as u8;
            let mixed = colour.map(|channel| between(255, channel, share));
            if !self.0[1..].contains(&mixed) {
                self.0.push(mixed);
            }
        }
        debug_assert!(self.0.len() <= 256, "{} colours", self.0.len());
    }

    /// The index of the colour nearest to `colour`.
    fn nearest(&self, colour: Colour) -> u8 {
        let distance =
            |own: &Colour| -> u32 { own.iter().zip(colour).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum() };
        let drawn = self.0.iter().enumerate().skip(1);
        drawn.min_by_key(|(_, own)| distance(own)).map_or(1, |(i, _)| i as u8)
    }
}

/// A GIF that grows by frames and repeats without end.
pub struct MovingGif {
    encoder: Encoder<Vec<u8>>,
    palette: Palette,
    /// Indices of colours found so far.
    known: HashMap<Colour, u8>,
    /// Width of the frames.
    width: usize,
    /// The frame before, by indices; at first none.
    before: Vec<u8>,
}

impl MovingGif {
    /// A picture of `width` × `height` pixels without frames.
    ///
    /// # Errors
    /// Those of the encoder: more than 256 colours.
    pub fn new(width: u16, height: u16, palette: Palette) -> Result<MovingGif, EncodingError> {
        let mut encoder = Encoder::new(Vec::new(), width, height, palette.0.as_flattened())?;
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(MovingGif { encoder, palette, known: HashMap::new(), width: width.into(), before: Vec::new() })
    }

    /// Adds a frame of the picture's size that is shown for `delay` hundredths of a second.
    ///
    /// # Errors
    /// Those of the encoder.
    pub fn add(&mut self, raster: &Raster, delay: u16) -> Result<(), EncodingError> {
        let index = |colour| *self.known.entry(colour).or_insert_with(|| self.palette.nearest(colour));
        let now: Vec<u8> = raster.colours().map(index).collect();
        let is_new = |i: usize| self.before.get(i) != Some(&now[i]);
        let changed = (0..now.len()).filter(|i| is_new(*i)).map(|i| (i % self.width, i / self.width));
        let bounds = changed.fold(None, |bounds: Option<[usize; 4]>, (x, y)| match bounds {
            None => Some([x, y, x, y]),
            Some([left, top, right, bottom]) => Some([left.min(x), top.min(y), right.max(x), bottom.max(y)]),
        });
        // A frame that shows nothing new still takes its time.
        let [left, top, right, bottom] = bounds.unwrap_or_default();
        let part = (top..=bottom).flat_map(|y| (left..=right).map(move |x| (x, y)));
        let pixels = part.map(|(x, y)| y * self.width + x).map(|i| if is_new(i) { now[i] } else { UNCHANGED });
        let frame = Frame {
            delay,
            dispose: DisposalMethod::Keep,
            transparent: Some(UNCHANGED),
            left: left as u16,
            top: top as u16,
            width: (right + 1 - left) as u16,
            height: (bottom + 1 - top) as u16,
            buffer: pixels.collect::<Vec<u8>>().into(),
            ..Frame::default()
        };
        self.encoder.write_frame(&frame)?;
        self.before = now;
        Ok(())
    }

    /// The file.
    ///
    /// # Errors
    /// Those of the encoder.
    pub fn finish(self) -> Result<Vec<u8>, EncodingError> {
        self.encoder.into_inner()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    const BLUE: Colour = [11, 107, 181];

    #[test]
    fn the_nearest_colour_is_found_and_the_transparent_one_never() {
        let mut palette = Palette::default();
        palette.add(BLUE, 4);
        palette.add(BLUE, 2);
        assert_eq!(palette.0.len(), 6, "equal colours once: {palette:?}");
        assert_eq!([WHITE, BLUE, [250; 3]].map(|colour| palette.nearest(colour)), [1, 5, 1]);
    }

    #[test]
    fn a_frame_holds_only_what_is_new() {
        let mut palette = Palette::default();
        palette.add(BLUE, 1);
        let mut gif = MovingGif::new(30, 20, palette).unwrap();
        let mut raster = Raster::new(30, 20).unwrap();
        let square = [(4.0, 6.0), (9.0, 6.0), (9.0, 13.0), (4.0, 13.0)].map(DVec2::from);
        gif.add(&raster, 5).unwrap();
        raster.area(&square, BLUE, 1.0);
        gif.add(&raster, 7).unwrap();
        gif.add(&raster, 100).unwrap();
        let bytes = gif.finish().unwrap();
        let mut decoder = gif::Decoder::new(&bytes[..]).unwrap();
        assert_eq!((decoder.width(), decoder.height(), decoder.repeat()), (30, 20, Repeat::Infinite));
        let mut frames = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            let place = [frame.left, frame.top, frame.width, frame.height];
            frames.push((frame.delay, place, frame.buffer.iter().copied().max().unwrap()));
        }
        assert_eq!(frames, [(5, [0, 0, 30, 20], 1), (7, [4, 6, 5, 7], 2), (100, [0, 0, 1, 1], UNCHANGED)]);
    }
}
