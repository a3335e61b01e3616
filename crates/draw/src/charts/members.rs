//! The times of a few members, each by its name: a dot with a bar for its error.

use glam::DVec2;

use super::{TIME, named_rows};
use crate::{
    axis::{Axis, Scale},
    chart::{ChartText, Entry, FOOT, LegendMark, Panel, triangle_right},
    medium::Medium,
    svg::{Svg, coordinate, dots},
    trace,
    width::{SIZE, distinct},
};

/// Height of a row, and of the ends of a bar.
const ROW: f64 = 24.0;
const CAP: f64 = 4.0;
/// Maximum width of a name.
const NAME: f64 = 260.0;

/// The times of a few members.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MemberTimes {
    /// What is said of it.
    pub text: ChartText,
    /// The members, from top to bottom.
    pub members: Vec<MemberDot>,
}

/// A member.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MemberDot {
    /// Its name.
    pub name: String,
    /// Its time, or when it ended without reaching it.
    pub t: f64,
    /// Half-width of the interval of that.
    pub error: Option<f64>,
    /// It reached the time.
    pub happened: bool,
}

impl MemberDot {
    /// The ends of its bar, or the time alone.
    fn ends(&self) -> [f64; 2] {
        let error = self.error.unwrap_or(0.0);
        [self.t - error, self.t + error]
    }

    fn draw(&self, svg: &mut Svg, panel: &Panel, y: f64) {
        let (low, high) = panel.x.range();
        let [left, right] = self.ends().map(|t| panel.across(t.clamp(low, high)));
        let (at, middle) = (DVec2::new(panel.across(self.t), y), coordinate(y));
        if right > left && self.error.is_some() {
            let ends = [left, right].map(|x| format!("M{} {}v{}", coordinate(x), coordinate(y - CAP), 2.0 * CAP));
            svg.path("thin", &format!("M{} {middle}H{}{}", coordinate(left), coordinate(right), ends.concat()));
        }
        match self.happened {
            true => svg.path("dots", &dots(&[at])),
            false => svg.path("hollow", &triangle_right(at)),
        }
    }
}

impl MemberTimes {
    /// The text of an SVG file.
    pub fn draw(&self, medium: Medium) -> String {
        let MemberTimes { text, members } = self;
        let mut heading = text.heading([]);
        let reached = || members.iter().filter(|member| member.happened).map(|member| member.t);
        let scale = Scale::of(members.iter().map(|member| member.t));
        if !members.iter().any(|member| scale.holds(member.t)) {
            return heading.nothing(medium, "No member has a time.");
        }
        let height = ROW * members.len() as f64;
        heading.legend = self.legend();
        let (mut svg, top) = heading.begin(medium, 24.0 + height + FOOT);
        let all: Vec<String> = members.iter().map(|member| member.name.clone()).collect();
        let shown = distinct(&all, SIZE, medium.name(NAME));
        let times = members.iter().flat_map(MemberDot::ends).chain(members.iter().map(|member| member.t));
        let across = Axis::over(&text.quantity, TIME, scale, times);
        // From 0 where all times are far from equal: the eye then compares lengths.
        let range = reached().fold((f64::INFINITY, 0.0_f64), |(low, high), t| (low.min(t), high.max(t)));
        let across = if range.0 < 0.7 * range.1 { across.with_zero() } else { across };
        let rows = Axis::new("", "", Scale::Linear, (0.0, members.len() as f64));
        let panel = named_rows(&mut svg, [&across, &rows], (&shown, ""), (top + 24.0, height), 0.0);
        let DVec2 { x: left, y: top } = panel.corner;
        svg.group("s0", |svg| {
            for (i, (member, name)) in members.iter().zip(&shown).enumerate() {
                let y = top + ROW * (i as f64 + 0.5);
                svg.text_unless_empty("y tick end", DVec2::new(left - 8.0, y + 4.0), name);
                let line = [DVec2::new(left, y), DVec2::new(panel.end().x, y)];
                svg.path("grid", &trace::path(&line));
                if scale.holds(member.t) {
                    member.draw(svg, &panel, y);
                }
            }
        });
        panel.draw_frame(&mut svg);
        svg.finish()
    }

    fn legend(&self) -> Vec<Entry> {
        let any = |has: &dyn Fn(&MemberDot) -> bool, mark: LegendMark, label: &str| {
            self.members.iter().any(has).then(|| Entry::new("s0", mark, label))
        };
        let quantity = &self.text.quantity;
        let time = any(&|member| member.happened, LegendMark::Marker(0), quantity);
        let bar = any(&|member| member.error.is_some(), LegendMark::Thin, "95 % interval");
        let ended = any(&|member| !member.happened, LegendMark::Right, &format!("ended without {quantity}"));
        time.into_iter().chain(bar).chain(ended).collect()
    }
}
