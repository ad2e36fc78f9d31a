//! A part of the plane with axes around it.

use super::axis::Axis;
use super::draw::{LINE, RIGHT, TICK, axes};
use super::drawing::{Anchor, Drawing, TEXT, text_width};
use super::plane::Plane;
use super::plot_area::PlotArea;

/// Coordinates `x` and `y` with their unit below and on the left of what is drawn on a plane; `draw` draws it, between the
/// lines across and the axes.
pub fn map(plane: &Plane, unit: &str, draw: impl FnOnce(&mut Drawing)) -> Drawing {
    map_of(plane, ["x", "y"], unit, draw)
}

/// The same of coordinates with other names.
pub fn map_of(plane: &Plane, names: [&str; 2], unit: &str, draw: impl FnOnce(&mut Drawing)) -> Drawing {
    let [low, high] = plane.corners();
    let [x, y] = [0, 1].map(|k| {
        // Without any value: the ends are given.
        Axis::linear(names[k], unit).range(low[k], high[k]).settle(std::iter::empty())
    });
    let widest = |ticks: &[(f64, String)]| ticks.iter().map(|tick| text_width(&tick.1, TEXT)).fold(0.0, f64::max);
    let (left, right) = (widest(&y.ticks) + TICK + 2.0, RIGHT.max(0.5 * widest(&x.ticks)));
    let top = LINE + 10.0;
    let frame = PlotArea { x, y, corner: [left, top], size: plane.size, band: 0.0 };
    let below = 6.0 + 2.0 * LINE;
    let [x_label, y_label] = [&frame.x, &frame.y].map(|axis| text_width(&axis.label, TEXT));
    let width = (left + plane.size[0] + right).max(x_label).max(y_label);
    let mut drawing = Drawing::new([width, frame.bottom() + below], "");
    axes(&mut drawing, &frame);
    let mut inner = Drawing::new(plane.size, "");
    draw(&mut inner);
    drawing.place(frame.corner, &inner);
    drawing.text("muted", [0.0, 12.0], Anchor::Start, &frame.y.label);
    let middle = (left + 0.5 * plane.size[0]).clamp(0.5 * x_label, width - 0.5 * x_label);
    drawing.text("muted", [middle, frame.bottom() + 6.0 + LINE + 12.0], Anchor::Middle, &frame.x.label);
    drawing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_where_they_belong_and_none_is_cut_off() {
        for (low, high, unit) in [
            ([-60.0, 0.0], [60.0, 50.0], "mm"),
            ([1e6, -2e6], [1e6 + 3.0, -2e6 + 4.0], "in"),
            ([0.0, 0.0], [1e-2, 2e-4], "m"),
            ([-1e-7, 0.0], [1e-7, 5e-6], ""),
        ] {
            let plane = Plane::new(low, high, 400.0);
            let drawing = map(&plane, unit, |inner| inner.circle("dot", plane.at(low), 1.0));
            let file = drawing.file();
            let document = roxmltree::Document::parse(&file).unwrap();
            let texts: Vec<_> = document.descendants().filter(|node| node.has_tag_name("text")).collect();
            assert!(texts.len() >= 4, "{file}");
            for text in texts {
                let [x, y] = ["x", "y"].map(|name| text.attribute(name).unwrap().parse::<f64>().unwrap());
                let width = text_width(text.text().unwrap(), TEXT);
                let from = match text.attribute("text-anchor").unwrap() {
                    "start" => x,
                    "middle" => x - 0.5 * width,
                    _ => x - width,
                };
                assert!(from >= -0.1 && from + width <= drawing.size[0] + 0.1, "{:?} {unit}", text.text());
                assert!(y >= 10.0 && y <= drawing.size[1], "{:?} {unit}", text.text());
            }
            let inside = document.descendants().find(|node| node.attribute("class") == Some("dot")).unwrap();
            assert_eq!(inside.attribute("cx"), Some("0"));
        }
    }
}
