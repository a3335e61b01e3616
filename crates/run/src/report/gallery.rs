//! `plots/curves.svg`: the first members at the start, during the run and at the end, to one scale if they can be seen
//! at it.

use glam::DVec2;

use super::members_layout::{OWN_SCALES, PanelLayout, draw_bar};
use curvelax_base::text::rounded;
use curvelax_curve::polygon;
use curvelax_draw::{
    medium::Medium,
    svg::{Svg, closed_path, dots},
    width::{shortened, shortened_inside, width},
};
use curvelax_ensemble::study::PORTRAITS;
use curvelax_files::portraits::Film;

/// Maximum number of members drawn.
pub const MAX_PANELS: usize = PORTRAITS;

/// Maximum characters of the name of a member.
const MAX_NAME: usize = 120;
const COLUMNS: usize = 4;
/// Width and maximum height of a panel on a screen in pixels, and the least on paper.
const SIDE: f64 = 200.0;
const MIN_SIDE: f64 = 170.0;
/// The least on a page, where the picture is as wide as a chart.
const MIN_SIDE_ON_PAGE: f64 = 150.0;
/// Size of text.
pub(super) const SIZE: f64 = 12.0;
const MIN_HEIGHT: f64 = 100.0;
/// Free space inside a panel.
const PADDING: f64 = 14.0;
const CAPTION: f64 = 44.0;
/// Distance of two lines of it.
const LINE: f64 = 15.0;
const GAP: f64 = 14.0;
const MARGIN: f64 = 24.0;
const HEAD: f64 = 48.0;
const FOOT: f64 = 40.0;
/// A picture this wide has room for the heading.
const MIN_COLUMNS: usize = 2;
/// Intermediate states: those with about this fraction of the way to the end left. The excess, which goes with the
/// square, has then fallen to a half and to a tenth.
const LEFT: [f64; 2] = [0.71, 0.32];
/// A state outside this range looks like the start or the end.
const APART: std::ops::RangeInclusive<f64> = 0.12..=0.88;
/// Nodes closer than this, in pixels, look like a line and are not marked.
const MIN_SPACING: f64 = 2.5;

/// The style of a gallery and of a movie, in light.
const LIGHT: &str = "
.back { fill: #ffffff }
.frame { fill: none; stroke: #e3e6ea }
text { font-family: sans-serif; font-size: 12px; fill: #24292f }
.head { font-size: 15px; font-weight: bold }
.note { fill: #656d76 }
.middle { text-anchor: middle }
.end { text-anchor: end }
.before { fill: none; stroke: #8c959f; stroke-width: 1 }
.way { stroke-width: 1 }
.after { stroke-width: 1.6; stroke-linejoin: round; fill-opacity: 0.08 }
.nodes { fill: none; stroke-width: 3.2; stroke-linecap: round }
.scale { fill: none; stroke: #24292f; stroke-width: 1.2 }
.relaxed path { stroke: #0b6bb5; fill: #0b6bb5 } .relaxed .word { fill: #0b6bb5 }
.unfinished path { stroke: #b35900; fill: #b35900 } .unfinished .word { fill: #b35900 }
.singular path { stroke: #c4262e; fill: #c4262e } .singular .word { fill: #c4262e }
.nonfinite path { stroke: #8a3ab9; fill: #8a3ab9 } .nonfinite .word { fill: #8a3ab9 }
.stalled path { stroke: #5a6b00; fill: #5a6b00 } .stalled .word { fill: #5a6b00 }
.vanished path { stroke: #00737a; fill: #00737a } .vanished .word { fill: #00737a }
.panel .before { fill: none; stroke: #8c959f }
.panel .way { fill: none; stroke-opacity: 0.5 }
.panel .nodes { fill: none }
";

/// What is different in dark.
const DARK: &str = "\
@media screen and (prefers-color-scheme: dark) {
.back { fill: #15191e }
.frame { stroke: #2d343c }
text { fill: #e6edf3 }
.note { fill: #9aa4af }
.scale { stroke: #e6edf3 }
.relaxed path { stroke: #58b0f5; fill: #58b0f5 } .relaxed .word { fill: #58b0f5 }
.unfinished path { stroke: #f0a04b; fill: #f0a04b } .unfinished .word { fill: #f0a04b }
.singular path { stroke: #ff7b76; fill: #ff7b76 } .singular .word { fill: #ff7b76 }
.nonfinite path { stroke: #cf9bf0; fill: #cf9bf0 } .nonfinite .word { fill: #cf9bf0 }
.stalled path { stroke: #b9cc4a; fill: #b9cc4a } .stalled .word { fill: #b9cc4a }
.vanished path { stroke: #45c8d0; fill: #45c8d0 } .vanished .word { fill: #45c8d0 }
.panel .before { fill: none; stroke: #7d8792 }
.panel .nodes { fill: none }
}
";

/// The style of a gallery and of a movie.
pub(super) fn style(medium: Medium) -> String {
    if medium.is_screen() { format!("{LIGHT}{DARK}") } else { LIGHT.into() }
}

/// Panels side by side, of `count` in all, and the width of each.
pub(super) fn columns(medium: Medium, count: usize) -> (usize, f64) {
    match medium {
        Medium::Screen => (count.clamp(MIN_COLUMNS, COLUMNS), SIDE),
        Medium::Page | Medium::Paper(_) => {
            let room = medium.width() - 2.0 * MARGIN + GAP;
            let least = if medium.is_screen() { MIN_SIDE_ON_PAGE } else { MIN_SIDE };
            let most = ((room / (least + GAP)) as usize).clamp(MIN_COLUMNS, COLUMNS);
            // Full rows, if that is possible: four are two by two.
            let columns = count.div_ceil(count.div_ceil(most).max(1)).clamp(MIN_COLUMNS, most);
            (columns, room / columns as f64 - GAP)
        }
    }
}

/// What is added to it where shapes at rest are drawn.
const STYLE_OF_RESTS: &str =
    ".panel .rest { fill: none; stroke-width: 1; stroke-dasharray: 4 3; stroke-opacity: 0.6 }\n";

/// What is written below the panels.
#[derive(Clone, Debug, Default)]
pub struct Wording {
    /// The unit of lengths, after a space; may be empty.
    pub unit: String,
    /// What distinguishes the cell of each member; empty if nothing does.
    pub cells: Vec<String>,
    /// How and when each member ended.
    pub ends: Vec<String>,
    /// The shape to which each relaxes, if it is not a circle.
    pub rests: Vec<Vec<DVec2>>,
}

/// The gallery of the first [`MAX_PANELS`] of `films`, as the text of an SVG file.
pub fn draw(medium: Medium, films: &[Film], wording: &Wording) -> String {
    let panels: Vec<MemberPanel> = films.iter().take(MAX_PANELS).map(MemberPanel::new).collect();
    let (columns, side) = columns(medium, panels.len());
    let rows = panels.len().div_ceil(columns).max(1);
    let bounds: Vec<_> = panels.iter().filter_map(MemberPanel::bounds).collect();
    let layout = PanelLayout::new(&bounds, side, PADDING, MIN_HEIGHT);
    let frame = layout.frame;
    let has_cells = wording.cells.iter().any(|cell| !cell.is_empty());
    let caption = CAPTION + if has_cells { LINE } else { 0.0 };
    let pitch = frame + DVec2::new(GAP, caption);
    let width = 2.0 * MARGIN + columns as f64 * pitch.x - GAP;
    let height = HEAD + rows as f64 * pitch.y + FOOT;

    let rests = wording.rests.iter().any(|rest| !rest.is_empty());
    let own = if rests { STYLE_OF_RESTS } else { "" };
    let style = [&style(medium), own].concat();
    let mut svg = Svg::new(width, height, &style, "Members before, during and after relaxation");
    svg.rectangle("back", DVec2::ZERO, DVec2::new(width, height), 0.0);
    let legend = match rests {
        true => "dashed: Wulff shape, grey: start, colour: end",
        false => "grey: start, light: in between, colour: end",
    };
    match medium {
        Medium::Screen | Medium::Page => {
            svg.text("head", DVec2::new(MARGIN, 30.0), "Before, during and after");
            svg.text("note end", DVec2::new(width - MARGIN, 30.0), legend);
        }
        Medium::Paper(_) => svg.text("note", DVec2::new(MARGIN, 30.0), legend),
    }
    for (i, panel) in panels.iter().enumerate() {
        let place = DVec2::new((i % columns) as f64, (i / columns) as f64);
        let corner = DVec2::new(MARGIN, HEAD) + place * pitch;
        let end = wording.ends.get(i).map_or(panel.film.status.name(), String::as_str);
        let cell = wording.cells.get(i).map_or("", String::as_str);
        let rest = wording.rests.get(i).map_or(&[][..], Vec::as_slice);
        let fitted =
            |text: &str| if medium.is_screen() { text.into() } else { shortened(text, SIZE, side + 0.5 * GAP) };
        let words = [&*wording.unit, &fitted(cell), &fitted(end)];
        svg.group(&format!("panel {}", panel.film.status.name()), |svg| {
            draw_panel(svg, panel, corner, &layout, rest, words);
        });
    }
    let foot = DVec2::new(MARGIN, height - 20.0);
    match layout.common {
        Some(largest) => draw_scale(&mut svg, foot, &layout, largest, &wording.unit),
        None => svg.text("note", foot + DVec2::new(0.0, 4.0), OWN_SCALES),
    }
    svg.finish()
}

/// One member of the gallery.
struct MemberPanel<'a> {
    film: &'a Film,
    /// Its nodes at the start, during the run and at the end; none if nothing can be drawn.
    states: Vec<Vec<DVec2>>,
}

impl MemberPanel<'_> {
    fn new(film: &Film) -> MemberPanel<'_> {
        let frames = film.frames();
        let states = shown(&frames).into_iter().map(|i| frames[i].clone()).collect();
        MemberPanel { film, states }
    }

    /// Lower left and upper right corner of all states.
    fn bounds(&self) -> Option<(DVec2, DVec2)> {
        polygon::bounds(self.states.iter().flatten().copied())
    }
}

/// The indices of the first of `frames`, of intermediate ones that look different, and of the last.
fn shown(frames: &[Vec<DVec2>]) -> Vec<usize> {
    let (Some(start), Some(end)) = (frames.first(), frames.last()) else { return Vec::new() };
    let to_end = |nodes: &[DVec2]| nodes.iter().zip(end).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    let left: Vec<f64> = frames.iter().map(|nodes| to_end(nodes) / to_end(start)).collect();
    let between = || (1..frames.len().saturating_sub(1)).filter(|i| APART.contains(&left[*i]));
    let nearest = |share: f64| between().min_by(|i, j| (left[*i] - share).abs().total_cmp(&(left[*j] - share).abs()));
    let way = LEFT.into_iter().filter_map(nearest);
    let mut shown: Vec<usize> = [0].into_iter().chain(way).chain([frames.len() - 1]).collect();
    shown.sort_unstable();
    shown.dedup();
    shown
}

fn draw_panel(
    svg: &mut Svg,
    panel: &MemberPanel,
    corner: DVec2,
    layout: &PanelLayout,
    rest: &[DVec2],
    [unit, cell, end]: [&str; 3],
) {
    let frame = layout.frame;
    let middle = corner + 0.5 * frame;
    svg.rectangle("frame", corner, frame, 6.0);
    let mut across = String::new();
    if let Some(bounds) = panel.bounds() {
        if layout.common.is_none() {
            across = format!(", {}{unit} across", rounded((bounds.1 - bounds.0).max_element(), 3));
        }
        let place = layout.place(bounds, corner);
        let place = |nodes: &[DVec2]| nodes.iter().map(|node| place(*node)).collect::<Vec<_>>();
        let last = panel.states.len() - 1;
        if !rest.is_empty() {
            svg.path("rest", &closed_path(&place(rest)));
        }
        for (i, nodes) in panel.states.iter().enumerate() {
            let nodes = place(nodes);
            let class = if i == last { "after" } else { ["before", "way"][usize::from(i > 0)] };
            svg.path(class, &closed_path(&nodes));
            if i == last
                && nodes.len() == panel.film.points
                && polygon::length(&nodes) >= MIN_SPACING * nodes.len() as f64
            {
                svg.path("nodes", &dots(&nodes));
            }
        }
    }
    let below = DVec2::new(middle.x, corner.y + frame.y + 16.0);
    let room = frame.x - width(&across, SIZE);
    let name = shortened_inside(&panel.film.name(MAX_NAME), SIZE, room) + &across;
    svg.text("middle", below, &shortened(&name, SIZE, frame.x));
    svg.text_unless_empty("middle", below + DVec2::new(0.0, LINE), cell);
    let lines = if cell.is_empty() { 1.0 } else { 2.0 };
    svg.text("middle word", below + DVec2::new(0.0, lines * LINE), end);
}

/// A bar of a round length: 1, 2 or 5 times a power of ten, at most half a panel long.
fn draw_scale(svg: &mut Svg, left: DVec2, layout: &PanelLayout, largest: f64, unit: &str) {
    let scale = layout.scale(largest);
    let most = 0.5 * layout.frame.x / scale;
    let power = 10_f64.powi(most.log10().floor() as i32);
    let length = [5.0, 2.0, 1.0].map(|digit| digit * power).into_iter().find(|l| *l <= most).unwrap_or(power);
    let shown = rounded(length, 3);
    let named = if unit.is_empty() { format!("length {shown}") } else { format!("{shown}{unit}") };
    draw_bar(svg, [left, left + DVec2::new(length * scale, 0.0)], &named);
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_ensemble::Status;
    use curvelax_files::samples::film;

    /// Perturbed ellipses of different sizes that end as circles or part of the way there.
    fn films(count: u64, n: usize) -> Vec<Film> {
        let one = |member: u64| {
            let status = match member {
                4 => Status::Unfinished,
                6 => Status::Singular,
                9 => Status::Stalled,
                11 => Status::Nonfinite,
                _ => Status::Relaxed,
            };
            film(member, n, status, (status == Status::Relaxed).then_some(0.4 + 0.0123456 * member as f64))
        };
        (0..count).map(one).collect()
    }

    #[test]
    fn a_gallery_has_a_panel_for_each_of_the_first_twelve() {
        for (count, shown) in [(0, 0), (1, 1), (5, 5), (12, 12), (30, 12)] {
            let text = draw(Medium::Screen, &films(count, 60), &Wording::default());
            assert_eq!(text.matches("class=\"frame\"").count(), shown);
            assert_eq!(text.matches("class=\"after\"").count(), shown);
            assert_eq!(text.matches("class=\"way\"").count(), 2 * shown);
            assert_eq!(text, draw(Medium::Screen, &films(count, 60), &Wording::default()));
            // To look at: CURVELAX_GALLERY=FOLDER cargo test gallery
            if let Some(folder) = std::env::var_os("CURVELAX_GALLERY") {
                let path = std::path::Path::new(&folder).join(format!("gallery{count}.svg"));
                std::fs::write(path, &text).unwrap();
            }
        }
    }

    #[test]
    fn on_paper_panels_fill_the_width_in_light_and_without_a_title() {
        for (width, count, expected) in [(413.0, 12, 2), (826.0, 12, 4), (826.0, 1, 2), (1458.0, 12, 4), (388.0, 3, 2)]
        {
            let (columns, side) = columns(Medium::Paper(width), count);
            assert_eq!(columns, expected, "{width} {count}");
            assert!((2.0 * MARGIN + columns as f64 * (side + GAP) - GAP - width).abs() < 1e-9);
            let text = draw(Medium::Paper(width), &films(count as u64, 60), &Wording::default());
            assert_eq!(text.matches("class=\"frame\"").count(), count);
            assert!(text.contains(&format!("width=\"{width}\"")) && text.contains("grey: start"), "{text}");
            assert!(!text.contains("@media") && !text.contains("class=\"head\""), "{text}");
        }
        let screen = draw(Medium::Screen, &films(1, 60), &Wording::default());
        assert!(screen.contains("@media") && screen.contains("class=\"head\""), "the control");
    }

    #[test]
    fn states_on_the_way_differ_from_both_ends() {
        let circle = |r: f64| (0..9).map(|i| r * DVec2::from_angle(0.7 * f64::from(i))).collect::<Vec<_>>();
        let of = |sizes: &[f64]| shown(&sizes.iter().map(|r| circle(*r)).collect::<Vec<_>>());
        assert_eq!(of(&[2.0, 1.99, 1.7, 1.6, 1.3, 1.1, 1.01, 1.0]), [0, 2, 4, 7]);
        assert_eq!(of(&[2.0, 1.95, 1.5, 1.05, 1.0]), [0, 2, 4]);
        assert_eq!(of(&[2.0, 1.99, 1.01, 1.0]), [0, 3]);
        assert_eq!(of(&[1.0, 1.0, 1.0]), [0, 2]);
        assert_eq!((of(&[1.0]), of(&[])), (vec![0], vec![]));
    }

    #[test]
    fn one_scale_fits_the_largest_member() {
        let films = films(3, 60);
        let mut panels: Vec<MemberPanel> = films.iter().map(MemberPanel::new).collect();
        panels[1].states[0].iter_mut().for_each(|p| *p *= 3.0);
        let slack = |panels: &[MemberPanel], i: usize| {
            let bounds: Vec<_> = panels.iter().filter_map(MemberPanel::bounds).collect();
            let (layout, (low, high)) = (PanelLayout::new(&bounds, SIDE, PADDING, MIN_HEIGHT), bounds[i]);
            layout.frame - (high - low) * layout.scale((high - low).max_element()) - 2.0 * PADDING
        };
        let (large, small) = (slack(&panels, 1), slack(&panels, 0));
        assert!(large.x.abs() < 1e-9 && large.y.abs() < 1e-9 && small.x > 0.3 * SIDE, "{large} {small}");
        // Where the others would be specks, each fills its panel.
        panels[1].states[0].iter_mut().for_each(|p| *p *= 10.0);
        assert!((0..3).all(|i| slack(&panels, i).x.abs() < 1e-9));
    }

    #[test]
    fn many_nodes_are_drawn_as_a_line() {
        let text = draw(Medium::Screen, &films(1, 5000), &Wording::default());
        assert!(!text.contains("class=\"nodes\""));
        assert!(text.len() < 50_000, "{}", text.len());
    }

    #[test]
    fn numbers_in_captions_are_short() {
        assert_eq!([0.123456, 2.0, 1234.5, 1e-7].map(|value| rounded(value, 3)), ["0.123", "2", "1230", "1e-7"]);
    }
}
