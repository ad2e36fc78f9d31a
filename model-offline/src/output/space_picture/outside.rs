//! The deformed body from outside, in parallel projection.

use super::{PaddlePatch, Shown, seen_from};
use crate::geometry::Point;
use crate::output::chart::style::{band, shade};
use crate::output::chart::{Anchor, Drawing, Plane, heading};
use std::collections::BTreeMap;

/// Room around the body, and length of the needle outside of it, part of its diagonal.
const MARGIN: f64 = 0.02;
const NEEDLE: f64 = 0.3;

/// From where light falls on a body without colours: from the viewer, from above and from the left.
const LIGHT: [f64; 3] = [1.0, 0.8, -0.6];

/// The outside in the colours of the field or, at rest, in light and shade, patches in their own, about this wide, px; what is
/// in front covers what is behind.
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
    let normal = |t: &[u32; 3]| (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0])));
    let light = (view * LIGHT[0] + up * LIGHT[1] + right * LIGHT[2]).normalize();
    let values = shown.parts_of_scale();
    let ground = |t: &[u32; 3]| {
        if shown.is_at_rest() {
            // No triangle that is seen is without area.
            shade(0.5 + 0.5 * normal(t).normalize().dot(&light))
        } else {
            band(t.iter().map(|node| values[*node as usize]).sum::<f64>() / 3.0)
        }
    };
    let mut seen: Vec<(f64, &[u32; 3])> = geometry
        .outside
        .iter()
        .filter(|t| normal(t).dot(&view) > 0.0)
        .map(|t| (t.iter().map(|node| view.dot(&at(*node))).sum::<f64>(), t))
        .collect();
    seen.sort_by(|a, b| a.0.total_cmp(&b.0));
    let label = if shown.is_at_rest() { "The body from outside" } else { "The deformed body from outside" };
    let title = heading("", label, width);
    let mut drawing = Drawing::new(paper.size, "");
    drawing.open_group("outside");
    for (_, triangle) in seen {
        let class = classes.get(triangle).map_or_else(|| ground(triangle), |class| (*class).to_owned());
        drawing.polygon(&class, &triangle.map(|node| paper.at(flat(&at(node)))));
    }
    drawing.close_group();
    let [tip, far] = [tip, far].map(|x| paper.at(flat(&x)));
    drawing.line("under", far, tip);
    drawing.needle(far, tip);
    let is_seen = |patch: &&PaddlePatch| patch.triangles.iter().any(|t| normal(t).dot(&view) > 0.0);
    let attached = geometry.paddles.iter().filter(|patch| state.paddles.contains(&patch.index));
    for patch in attached.filter(is_seen) {
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
