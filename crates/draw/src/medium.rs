//! Where a picture is seen: on a screen, or on paper at the width of a journal's column.

/// Width of every chart on a screen, in pixels: the narrower, the larger its text where a phone shrinks it.
const WIDTH: f64 = 560.0;
/// Pictures narrower than this have their panels one below the other, in pixels.
const NARROW: f64 = 500.0;

/// Where a picture is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Medium {
    /// A screen, light or dark. Title and sentences stand above the panels.
    #[default]
    Screen,
    /// A page with other pictures: it names once what all have in common, a legend or what was run.
    Page,
    /// White paper, so many pixels wide. Title and sentences are left to the caption below the picture.
    Paper(f64),
}

impl Medium {
    /// Width of a chart, in pixels.
    pub fn width(self) -> f64 {
        match self {
            Medium::Screen | Medium::Page => WIDTH,
            Medium::Paper(width) => width,
        }
    }

    /// Whether this is a screen.
    pub fn is_screen(self) -> bool {
        matches!(self, Medium::Screen | Medium::Page)
    }

    /// Most pixels of a name at the left of a panel: those on a screen, and a third of the width on paper.
    pub fn name(self, on_screen: f64) -> f64 {
        match self {
            Medium::Screen | Medium::Page => on_screen,
            Medium::Paper(width) => on_screen.min(width / 3.0),
        }
    }

    /// Panels side by side, of a chart that has two or more.
    pub fn columns(self) -> usize {
        if self.width() < NARROW { 1 } else { 2 }
    }
}
