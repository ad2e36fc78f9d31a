//! The deformed body from outside, in parallel projection.

use super::{Shown, seen_from};
use crate::geometry::Point;
use crate::output::chart::style::band;
use crate::output::chart::{Anchor, Drawing, Plane, heading};
use std::collections::BTreeMap;

/// Room around the body, and length of the needle outside of it, part of its diagonal.
const MARGIN: f64 = 0.02;
const NEEDLE: f64 = 0.3;

/// The outside in the colours of the field, patches in their own, about this wide, px; what is in front covers what is behind.
pub fn outside(shown: &Shown<'_>, width: f64) -> Drawing {
    let (geometry, state) = (shown.geometry, shown.state);
    let [view, up] = seen_from(geometry, &state.paddles);
    let right = up.cross(&view);
    let flat = |x: &Point<3>| [right.dot(x), up.dot(x)];
    let moved = state.moved(geometry);
    let axis = Point::from(geometry.axis);
    let tip = geometry.middle(&geometry.needle) + axis * state.depth;
    let far = tip - axis * (NEEDLE * geometry.extent());
    let paper = Plane::around(moved.iter().chain([&far]).map(flat), MARGIN * geometry.extent(), width);
    let classes = classes(shown);
    let at = |node: u32| moved[node as usize];
    let mut seen: Vec<(f64, &[u32; 3])> = geometry
        .outside
        .iter()
        .filter(|t| (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0]))).dot(&view) > 0.0)
        .map(|t| (t.iter().map(|node| view.dot(&at(*node))).sum::<f64>(), t))
        .collect();
    seen.sort_by(|a, b| a.0.total_cmp(&b.0));
    let label = "The deformed body from outside";
    let title = heading("", label, width);
    let mut drawing = Drawing::new(paper.size, "");
    drawing.open_group("outside");
    for (_, triangle) in seen {
        let mean = triangle.iter().map(|node| shown.values[*node as usize]).sum::<f64>() / 3.0;
        let class = classes.get(triangle).map_or_else(|| band(shown.part(mean)), |class| (*class).to_owned());
        drawing.polygon(&class, &triangle.map(|node| paper.at(flat(&at(node)))));
    }
    drawing.close_group();
    let [tip, far] = [tip, far].map(|x| paper.at(flat(&x)));
    drawing.line("under", far, tip);
    drawing.needle(far, tip);
    for patch in geometry.paddles.iter().filter(|patch| state.paddles.contains(&patch.index)) {
        let nodes: Vec<u32> = patch.triangles.iter().flatten().copied().collect();
        let middle = nodes.iter().map(|node| at(*node)).sum::<Point<3>>() / nodes.len().max(1) as f64;
        let [x, y] = paper.at(flat(&middle));
        drawing.text("title halo", [x, y + 4.5], Anchor::Middle, &patch.index.to_string());
    }
    let mut whole = Drawing::new([paper.size[0], title.size[1] + paper.size[1]], label);
    whole.place([0.0, 0.0], &title);
    whole.place([0.0, title.size[1]], &drawing);
    whole
}

/// Classes of the triangles that have a colour of their own.
fn classes<'a>(shown: &Shown<'a>) -> BTreeMap<&'a [u32; 3], &'static str> {
    let geometry = shown.geometry;
    let paddle = if shown.held_still { "patch held" } else { "patch led" };
    let attached = geometry.paddles.iter().filter(|patch| shown.state.paddles.contains(&patch.index));
    let immobile = geometry.immobile.iter().map(|t| (t, "patch immobile"));
    let needle = geometry.needle.iter().map(|t| (t, "patch contact"));
    immobile.chain(needle).chain(attached.flat_map(|patch| &patch.triangles).map(|t| (t, paddle))).collect()
}
