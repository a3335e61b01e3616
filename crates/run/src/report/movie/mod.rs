//! A movie of the first members: side by side, to one scale if they can be seen at it, from their portraits.
//!
//! A portrait holds the nodes of a member at some times. Between two of these every node moves on a straight line,
//! evenly in time. That is honest: node i stays node i during a run, and neighbouring times are so close that nodes
//! move by a small part of the curve. The page of a run does the same. Behind its last time a member stays as it ended.
//!
//! The [pace] of the clock follows the motion. [`gif`] and [`svg`] draw the same [`Movie`].

pub mod gif;
pub mod moved;
pub mod pace;
pub mod svg;

use glam::DVec2;

use super::{
    members_layout::PanelLayout,
    page::spread,
    words::{RAW_CLOCK, in_the_limit, length_unit, time_unit},
};
use curvelax_base::text::rounded;
use curvelax_curve::polygon;
use curvelax_draw::axis::tick_step;
use curvelax_ensemble::{Spec, Status};
use curvelax_files::portraits::Film;
use moved::MovedMember;
use pace::MoviePace;

/// Width in pixels, unless another is requested.
pub const WIDTH: u32 = 800;
/// Smallest and largest width in pixels.
pub const WIDTHS: [u32; 2] = [160, 1920];
/// Seconds of motion, unless others are requested.
pub const SECONDS: f64 = 6.0;
/// Shortest and longest motion in seconds.
pub const MAX_SECONDS: [f64; 2] = [0.5, 60.0];
/// Seconds for which the last state stays.
pub const HOLD: f64 = 1.0;

const MAX_COLUMNS: usize = 4;
/// Narrowest panel next to another: the words below it have room.
const MIN_SIDE: f64 = 148.0;
/// Maximum characters of the name of a member.
const MAX_NAME: usize = 20;
const MIN_HEIGHT: f64 = 80.0;
/// The free space inside a panel, between panels and around the picture.
const PADDING: f64 = 12.0;
const GAP: f64 = 12.0;
const MARGIN: f64 = 16.0;
const HEAD: f64 = 46.0;
const FOOT: f64 = 34.0;
/// From one line of words to the next.
const LINE: f64 = 17.0;
/// Below the words of a panel.
const BELOW: f64 = 18.0;
/// The clock has two digits from this moment on, however slowly it starts.
const EARLY: f64 = 0.1;
/// Most digits of the clock behind the point.
const MAX_DIGITS: i32 = 8;
/// Part of a panel that the bar of the scale has at least.
const BAR: f64 = 0.22;

/// What is requested of a movie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovieOptions {
    /// Seconds from the first state to the last.
    pub seconds: f64,
    /// Width in pixels.
    pub width: u32,
    /// Members shown at most.
    pub members: usize,
}

/// A movie, laid out.
#[derive(Clone, Debug, PartialEq)]
pub struct Movie {
    panels: Vec<MoviePanel>,
    pace: MoviePace,
    /// Seconds of motion.
    seconds: f64,
    size: DVec2,
    /// Size of the frame of each panel.
    frame: DVec2,
    /// The bar that shows the scale, if all members have one: its length in pixels, and what is written next to it.
    bar: Option<(f64, String)>,
    /// The unit behind a time; empty if it has no name.
    unit: String,
    /// Whether members have limits, which the clock does not show.
    is_raw: bool,
}

/// A member with its place.
#[derive(Clone, Debug, PartialEq)]
struct MoviePanel {
    member: MovedMember,
    /// Upper left corner of its frame.
    corner: DVec2,
    /// What is written below it: the member, and its cell in a sweep.
    names: Vec<String>,
    /// How it ended, and the time at which it is told.
    end: (f64, String),
}

impl Movie {
    /// The members to watch, the first ones or some of all cells, as `cut` requests it; none if no film has a state
    /// to draw. `t_limit` knows the limit of a member, if it has one.
    pub fn new(films: &[Film], spec: &Spec, cut: &MovieOptions, t_limit: impl Fn(u64) -> Option<f64>) -> Option<Movie> {
        let shown = if spec.sweep.is_empty() { films.len().min(cut.members) } else { films.len() };
        let films: Vec<&Film> = spread(shown, cut.members).map(|i| &films[i]).collect();
        // None if they are not curves.
        let drawable = |states: &Vec<Vec<DVec2>>| states.first().is_some_and(|nodes| nodes.len() > 2);
        let states: Vec<Vec<Vec<DVec2>>> =
            films.iter().map(|film| Some(film.frames()).filter(drawable).unwrap_or_default()).collect();
        let boxes: Vec<Option<(DVec2, DVec2)>> =
            states.iter().map(|states| polygon::bounds(states.iter().flatten().copied())).collect();
        let known: Vec<(DVec2, DVec2)> = boxes.iter().flatten().copied().collect();
        if known.is_empty() {
            return None;
        }

        let width = f64::from(cut.width);
        let fitting = ((width - 2.0 * MARGIN + GAP) / (MIN_SIDE + GAP)) as usize;
        let columns = fitting.clamp(1, MAX_COLUMNS).min(films.len());
        let side = ((width - 2.0 * MARGIN + GAP) / columns as f64 - GAP).floor();
        let mut layout = PanelLayout::new(&known, side, PADDING, MIN_HEIGHT);
        layout.frame.y = layout.frame.y.ceil();
        let frame = layout.frame;
        let (length_unit, unit) = (length_unit(spec), time_unit(spec));
        let names = |film: &Film, extent: DVec2| {
            let own = match layout.common {
                Some(_) => film.name(MAX_NAME),
                None => {
                    format!("{}, {}{length_unit} across", film.name(MAX_NAME), rounded(extent.max_element(), 2))
                }
            };
            let cell = (!spec.sweep.is_empty()).then(|| spec.sweep.name(film.member / spec.members_per_cell().max(1)));
            [own].into_iter().chain(cell).collect::<Vec<_>>()
        };
        let lines = if spec.sweep.is_empty() { 2.0 } else { 3.0 };
        let pitch = frame + DVec2::new(GAP, lines * LINE + BELOW);
        let rows = films.len().div_ceil(columns);

        let is_raw = films.iter().any(|film| t_limit(film.member).is_some());
        let panels = films.iter().zip(states).zip(boxes).enumerate().map(|(i, ((film, states), bounds))| {
            let place = DVec2::new((i % columns) as f64, (i / columns) as f64);
            let corner = DVec2::new(MARGIN, HEAD) + place * pitch;
            let (low, high) = bounds.unwrap_or_default();
            let pixel = layout.place((low, high), corner);
            let moved = states.into_iter().map(|nodes| nodes.into_iter().map(&pixel).collect());
            let frames = film.times.iter().copied().zip(moved).collect();
            let end = match (film.t_relax.filter(|_| film.status != Status::Vanished), t_limit(film.member)) {
                (Some(t), Some(limit)) => (t, film.status.name().to_string() + &in_the_limit(limit, &unit)),
                (Some(t), None) => (t, format!("{} at t = {}", film.status.name(), rounded(t, 3))),
                (None, _) => (film.times.last().copied().unwrap_or_default(), film.status.name().into()),
            };
            let names = names(film, high - low);
            MoviePanel { member: MovedMember::new(film.status, frames), corner, names, end }
        });
        let panels: Vec<MoviePanel> = panels.collect();
        let pace = MoviePace::new(&panels.iter().map(|panel| panel.member.clone()).collect::<Vec<_>>());
        let bar = layout.common.map(|extent| layout.scale(extent)).map(|scale| {
            let length = tick_step(BAR * side / scale);
            let shown = rounded(length, 1);
            let named = if spec.units.is_some() { format!("{shown}{length_unit}") } else { format!("length {shown}") };
            (length * scale, named)
        });
        Some(Movie {
            panels,
            pace,
            seconds: cut.seconds,
            size: DVec2::new(width, HEAD + rows as f64 * pitch.y + FOOT),
            frame,
            bar,
            unit,
            is_raw,
        })
    }

    /// Number of members.
    pub fn members(&self) -> usize {
        self.panels.len()
    }

    /// The clock at the time `t`, with equally many digits throughout.
    fn clock(&self, t: f64) -> String {
        let power = power_of(self.pace.end());
        let shown = match power {
            -3..6 => {
                let digits = (3 - power).max(1 - power_of(self.pace.time(EARLY)));
                format!("{t:.*}", digits.clamp(0, MAX_DIGITS) as usize)
            }
            _ if t == 0.0 => "0".into(),
            _ => format!("{t:.3e}"),
        };
        format!("t = {shown}{}", self.unit)
    }

    /// What the head says at its right: of the clock, if there is room, and of the grey line.
    fn head(&self) -> String {
        match self.is_raw && self.size.x >= WIDE {
            true => format!("{RAW_CLOCK}; {GREY}"),
            false => GREY.into(),
        }
    }

    /// Left end of the bar of the scale, or of what is said instead.
    fn foot(&self) -> DVec2 {
        DVec2::new(MARGIN, self.size.y - 16.0)
    }

    /// Ends of the bar of the scale, and what is written next to it.
    fn bar(&self) -> Option<([DVec2; 2], &str)> {
        let (length, text) = self.bar.as_ref()?;
        Some(([self.foot(), self.foot() + DVec2::new(length.round(), 0.0)], text))
    }

    /// Where line `i` of the words below a panel stands: its middle.
    fn words(&self, panel: &MoviePanel, i: usize) -> DVec2 {
        panel.corner + DVec2::new(0.5 * self.frame.x, self.frame.y + LINE * (1.0 + i as f64))
    }
}

/// Width from which the head has room for a sentence.
const WIDE: f64 = 560.0;

/// What the head says of the grey line.
const GREY: &str = "grey: start";

/// The power of ten of the first digit of `value`.
fn power_of(value: f64) -> i32 {
    // Exact, which a logarithm is not on every machine.
    format!("{value:e}").split_once('e').and_then(|(_, power)| power.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use curvelax_ensemble::Status;
    use curvelax_files::samples::film;

    const CUT: MovieOptions = MovieOptions { seconds: 1.0, width: 800, members: 12 };

    /// Members of which some end early.
    pub fn movie(count: u64, width: u32) -> Movie {
        let status = |member| if member % 3 == 1 { Status::Unfinished } else { Status::Relaxed };
        let t_relax = |member| (status(member) == Status::Relaxed).then_some(0.4 + 0.1 * member as f64);
        let films: Vec<Film> = (0..count).map(|member| film(member, 60, status(member), t_relax(member))).collect();
        Movie::new(&films, &Spec::default(), &MovieOptions { width, ..CUT }, |_| None).unwrap()
    }

    #[test]
    fn all_panels_lie_in_the_picture_and_all_nodes_in_their_panel() {
        for (count, width, columns) in
            [(1, 800, 1), (5, 800, 4), (12, 800, 4), (12, 160, 1), (12, 400, 2), (3, 1920, 3)]
        {
            let movie = movie(count, width);
            let lefts: Vec<f64> = movie.panels.iter().map(|panel| panel.corner.x).collect();
            assert_eq!(lefts.iter().filter(|left| **left == MARGIN).count(), (count as usize).div_ceil(columns));
            for panel in &movie.panels {
                let corner = panel.corner + movie.frame;
                assert!(corner.x <= f64::from(width) - MARGIN && movie.words(panel, 1).y < movie.size.y - FOOT);
                let nodes = panel.member.times().flat_map(|t| panel.member.at(t));
                for node in nodes {
                    let free = (node - panel.corner).min(corner - node);
                    assert!(free.min_element() > PADDING - 1e-6, "{count} of {width}: {node} in {}", panel.corner);
                }
            }
            let ([left, right], _) = movie.bar().unwrap();
            assert!(right.x - left.x > 0.2 * movie.frame.x && right.x - left.x < 0.8 * movie.frame.x);
        }
    }

    #[test]
    fn the_clock_has_equally_many_digits_throughout() {
        let mut movie = movie(1, 800);
        let mut clock = |end: f64, t: f64| {
            let nodes = vec![DVec2::ZERO, DVec2::X, DVec2::Y];
            movie.pace = MoviePace::new(&[MovedMember::new(Status::Relaxed, vec![(0.0, nodes.clone()), (end, nodes)])]);
            movie.unit = if end > 1.0 { " h".into() } else { String::new() };
            movie.clock(t)
        };
        assert_eq!([0.0, 0.01, 2.0].map(|t| clock(2.0, t)), ["t = 0.000 h", "t = 0.010 h", "t = 2.000 h"]);
        assert_eq!([0.0, 0.1].map(|t| clock(0.1, t)), ["t = 0.0000", "t = 0.1000"]);
        assert_eq!([0.0, 1e-9, 1e-7].map(|t| clock(1e-7, t)), ["t = 0", "t = 1.000e-9", "t = 1.000e-7"]);
        assert_eq!(clock(2e5, 12345.6), "t = 12346 h");
        // A member that moves most at first.
        movie.unit.clear();
        let film = |t: f64, x: f64| (t, vec![DVec2::ZERO, DVec2::X * x, DVec2::Y]);
        let frames = vec![film(0.0, 9.0), film(1e-3, 2.0), film(0.5, 1.0)];
        movie.pace = MoviePace::new(&[MovedMember::new(Status::Relaxed, frames)]);
        assert_eq!([0.0, 2e-4, 0.5].map(|t| movie.clock(t)), ["t = 0.00000", "t = 0.00020", "t = 0.50000"]);
    }

    #[test]
    fn a_movie_has_limits_in_the_words_of_the_report_and_the_clock_of_the_run() {
        let films: Vec<Film> = (0..3).map(|member| film(member, 60, Status::Relaxed, Some(0.5))).collect();
        let cut = |width| MovieOptions { width, ..CUT };
        let movie =
            |width, limit: fn(u64) -> Option<f64>| Movie::new(&films, &Spec::default(), &cut(width), limit).unwrap();
        let wide = movie(800, |member| (member != 1).then_some(0.51234));
        let ends: Vec<&str> = wide.panels.iter().map(|panel| &*panel.end.1).collect();
        assert_eq!(ends, ["relaxed, t_limit = 0.5123", "relaxed at t = 0.5", "relaxed, t_limit = 0.5123"]);
        // The moment is that of what moves.
        assert_eq!(wide.panels[0].end.0, 0.5);
        assert_eq!(wide.head(), "t is that of the run, not the limit; grey: start");
        assert!(wide.svg().contains(&wide.head()));
        assert_eq!(movie(400, |_| Some(0.5)).head(), "grey: start");
        assert_eq!(movie(800, |_| None).head(), "grey: start");
    }

    #[test]
    fn a_member_without_a_state_has_an_empty_panel_and_none_at_all_make_no_movie() {
        use curvelax_ensemble::Portrait;
        use curvelax_study::samples::outcome;
        let nan = vec![DVec2::NAN; 9];
        let gone = Portrait { before: nan.clone(), frames: vec![], after: nan };
        let gone = Film::new(&outcome(1, Status::Nonfinite, None), &gone);
        let good = film(0, 60, Status::Relaxed, Some(0.5));
        let movie = Movie::new(&[good, gone.clone()], &Spec::default(), &CUT, |_| None).unwrap();
        assert_eq!(movie.panels.len(), 2);
        assert_eq!((movie.panels[1].member.at(0.1), &*movie.panels[1].end.1), (vec![], "nonfinite"));
        assert_eq!(Movie::new(&[gone], &Spec::default(), &CUT, |_| None), None);
        assert_eq!(Movie::new(&[], &Spec::default(), &CUT, |_| None), None);
    }

    #[test]
    fn a_sweep_shows_members_of_all_cells_by_name() {
        let mut spec = Spec { curves: 6, ..Spec::default() };
        spec.sweep.set("amplitude=0.05,0.1".parse().unwrap());
        let films: Vec<Film> = (0..12).map(|member| film(member, 60, Status::Relaxed, Some(0.5))).collect();
        let few = MovieOptions { members: 3, ..CUT };
        let names = |spec: &Spec| {
            let movie = Movie::new(&films, spec, &few, |_| None).unwrap();
            movie.panels.iter().map(|panel| panel.names.join(": ")).collect::<Vec<_>>()
        };
        assert_eq!(
            names(&spec),
            ["member 0: amplitude = 0.05", "member 5: amplitude = 0.05", "member 11: amplitude = 0.1"]
        );
        assert_eq!(names(&Spec::default()), ["member 0", "member 1", "member 2"]);
    }
}
