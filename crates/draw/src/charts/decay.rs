//! The mean excess over time, with its band and the slope from theory.

use glam::DVec2;

use super::{Band, TIME, draw_band, only_panel, shows_bands};
use crate::{
    axis::{Axis, Scale},
    chart::{ChartText, Colours, Entry, LegendMark, Panel},
    medium::Medium,
    trace,
};

const HEIGHT: f64 = 300.0;
/// Smaller fractions of the largest excess are rounding, and not drawn.
const ROUNDING: f64 = 1e-18;
/// Segments of a theoretical line, which is straight on some axes only.
const PIECES: i32 = 100;
/// A band may extend the axis below its curve by this factor.
const BELOW: f64 = 1e-2;

/// Mean excess of the cells of a study against time, on a logarithmic axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decay<'a> {
    /// What is said of it; the note says over which members the mean is.
    pub text: ChartText,
    /// Meaning of the bands, such as `5 to 95 % of the members`.
    pub band: &'a str,
    /// The curves, in the order of the legend.
    pub curves: Vec<DecayCurve>,
    /// Theoretical lines to compare with.
    pub theory: Vec<Theory>,
}

/// The mean excess of one cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DecayCurve {
    /// Ascending times, in length⁴.
    pub t: Vec<f64>,
    /// Mean excess at each time.
    pub mean: Vec<f64>,
    /// Lower and upper bounds at each time, or nothing; values that are not positive are drawn at the bottom.
    pub band: Option<Band>,
}

/// A theoretical line.
#[derive(Clone, Debug, PartialEq)]
pub struct Theory {
    /// Its entry in the legend, such as `exp(−24 t/R⁴)`.
    pub label: String,
    /// The line.
    pub law: DecayLaw,
}

/// The law by which excess decreases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DecayLaw {
    /// start·exp(−rate·t).
    Exponential {
        /// Excess at t = 0.
        start: f64,
        /// 24/R⁴ for surface diffusion, in 1/length⁴.
        rate: f64,
    },
    /// start·(1 + t/time)^(−power).
    Algebraic {
        /// Excess at t = 0.
        start: f64,
        /// R₀⁴/2 for the Willmore flow, in length⁴.
        time: f64,
        /// The slope at late times on logarithmic axes, without its sign.
        power: f64,
    },
}

impl DecayLaw {
    /// The excess at this time.
    pub fn at(self, t: f64) -> f64 {
        match self {
            DecayLaw::Exponential { start, rate } => start * (-rate * t).exp(),
            DecayLaw::Algebraic { start, time, power } => start * (1.0 + t / time).powf(-power),
        }
    }

    /// Path data of its line across a panel.
    fn line(self, panel: &Panel) -> String {
        let (first, last) = panel.x.range();
        let times = (0..=PIECES).map(|i| first + (last - first) * f64::from(i) / f64::from(PIECES));
        panel.clipped(&panel.points(times.map(|t| (t, self.at(t)))))
    }
}

impl DecayCurve {
    /// Positions of those of `values` that can be shown; values below the axis are drawn at the bottom.
    fn line(&self, values: &[f64], panel: &Panel, least: f64, floor: bool) -> Vec<DVec2> {
        let low = panel.y.range().0;
        let raised = |value: f64| if floor && value < low { low } else { value };
        trace::thinned(&panel.points(self.t.iter().zip(values).map(|(t, value)| (*t, raised(*value)))), least)
    }
}

impl Decay<'_> {
    /// The text of an SVG file.
    pub fn draw(&self, medium: Medium) -> String {
        let Decay { text, curves, theory, .. } = self;
        let colours = Colours::of(curves.len(), &text.key);
        let mut heading = text.heading([colours.sentence(curves.len())]);
        let times = || curves.iter().flat_map(|curve| curve.t.iter().copied());
        let drawn = |curve: &DecayCurve| {
            curve
                .t
                .iter()
                .zip(&curve.mean)
                .filter(|(t, mean)| Scale::Linear.holds(**t) && Scale::Log.holds(**mean))
                .count()
        };
        match curves.iter().map(drawn).max() {
            None | Some(0) => return heading.nothing(medium, "There is no positive mean excess to draw."),
            Some(1) => {
                let reason = "The mean excess is known at one time only: there is no line to draw.";
                return heading.nothing(medium, reason);
            }
            _ => {}
        }
        let bands = self.has_bands();
        heading.legend = self.legend(&colours, bands);
        let across = Axis::over("t", TIME, Scale::Linear, times()).with_zero();
        let upwards = self.excess(bands);
        only_panel(&heading, medium, &colours, [&across, &upwards], HEIGHT, |svg, panel| {
            panel.draw_frame(svg);
            let least = trace::tolerance(colours.shown.len() * if bands { 3 } else { 1 }, panel.size.x);
            colours.each(svg, |svg, _, i| {
                let curve = &curves[i];
                let band = curve.band.as_ref().filter(|_| bands);
                draw_band(svg, band, |bound| curve.line(bound, panel, least, true));
                svg.path("series", &panel.clipped(&curve.line(&curve.mean, panel, least, false)));
            });
            svg.group("ink", |svg| theory.iter().for_each(|theory| svg.path("dashed", &theory.law.line(panel))));
        })
    }

    /// The vertical axis: all means above rounding, and the bands where they are near.
    fn excess(&self, bands: bool) -> Axis {
        let means = || self.curves.iter().flat_map(|curve| curve.mean.iter().copied()).filter(|e| Scale::Log.holds(*e));
        let largest = means().fold(0.0, f64::max);
        let least = means().filter(|mean| *mean > ROUNDING * largest).fold(largest, f64::min);
        let bounds = self.curves.iter().filter_map(|curve| curve.band.as_ref()).filter(|_| bands);
        let bounds = bounds.flat_map(|(low, high)| low.iter().chain(high).copied());
        let near = move |bound: &f64| *bound > BELOW * least && *bound < largest / BELOW;
        let shown = means().filter(|mean| *mean >= least).chain(bounds.filter(near));
        Axis::over("mean excess", "", Scale::Log, shown)
    }

    /// Whether bands are drawn.
    pub fn has_bands(&self) -> bool {
        shows_bands(self.curves.iter().map(|curve| &curve.band))
    }

    fn legend(&self, colours: &Colours, bands: bool) -> Vec<Entry> {
        let band = bands.then(|| Entry::new("faint", LegendMark::Band, self.band));
        let theory = self.theory.iter().map(|theory| Entry::new("ink", LegendMark::Dashed, &theory.label));
        colours.legend().into_iter().chain(band).chain(theory).collect()
    }
}
