//! Pictures as pixels.

use tiny_skia::{Color, Paint, PixmapMut};
use usvg::{FillRule, Group, Node, PaintOrder, Path, Transform};

/// Draws a group.
pub(super) fn draw(group: &Group, transform: Transform, pixels: &mut PixmapMut) {
    let transform = transform.pre_concat(group.transform());
    for node in group.children() {
        match node {
            Node::Group(group) => draw(group, transform, pixels),
            Node::Path(path) if path.is_visible() => draw_path(path, transform, pixels),
            Node::Text(text) => draw(text.flattened(), transform, pixels),
            // Refused when it was read.
            Node::Path(_) | Node::Image(_) => {}
        }
    }
}

fn draw_path(path: &Path, transform: Transform, pixels: &mut PixmapMut) {
    let fill_first = path.paint_order() == PaintOrder::FillAndStroke;
    for filling in [fill_first, !fill_first] {
        match (path.fill(), path.stroke()) {
            (Some(fill), _) if filling => {
                let rule = match fill.rule() {
                    FillRule::NonZero => tiny_skia::FillRule::Winding,
                    FillRule::EvenOdd => tiny_skia::FillRule::EvenOdd,
                };
                let paint = paint(fill.paint(), fill.opacity());
                pixels.fill_path(path.data(), &paint, rule, transform, None);
            }
            (_, Some(stroke)) if !filling => {
                let paint = paint(stroke.paint(), stroke.opacity());
                pixels.stroke_path(path.data(), &paint, &stroke.to_tiny_skia(), transform, None);
            }
            _ => {}
        }
    }
}

fn paint(of: &usvg::Paint, opacity: usvg::Opacity) -> Paint<'static> {
    let usvg::Color { red, green, blue } = super::colour(of);
    let mut paint = Paint::default();
    paint.set_color(Color::from_rgba8(red, green, blue, opacity.to_u8()));
    paint
}
