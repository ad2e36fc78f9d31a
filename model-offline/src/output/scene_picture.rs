//! A scene at rest, drawn with everything named: what a scene file says, to be looked at before it is solved.

use super::chart::{Drawing, Key, Legend, Marker, Names, Plane, Px, heading, map, sheet};
use crate::geometry::{Point2, Polygon, clip_half_plane};
use crate::number::{in_unit, short};
use crate::scene::Scene;

/// Width of what is between the axes, px.
const WIDTH: f64 = 640.0;
/// Title and legend have at least so much room, px.
const LEAST_WIDTH: f64 = 420.0;
/// Room around everything, for names, and the shorter side at least, part of the longer side.
const MARGIN: f64 = 0.09;
const LEAST_SIDE: f64 = 0.25;
/// Length of the needle outside the tissue, and distance of the strokes of what is held, part of the body's longer side.
const OUTSIDE: f64 = 0.16;
const STROKES: f64 = 0.03;
/// What a paddle is drawn shorter at each end, px, and at most, part of its length: a gap shows where one ends.
const GAP: f64 = 4.0;
const MOST_GAP: f64 = 0.1;
/// Half the widths of what names keep clear of, px.
const TARGET: f64 = 12.0;
const NEEDLE_POINT: f64 = 7.0;
/// An outline with more edges than this is not made by hand, and shorter ones than this, px, have no room for their number.
const MOST_EDGES: usize = 32;
const SHORTEST_EDGE: f64 = 44.0;
/// Distance of the edge of a body from a paddle's middle, at which its outer side is looked for, px.
const BESIDE: f64 = 3.0;

/// The scene as a picture of its own, with axes in its unit of length and a legend.
pub fn svg(scene: &Scene) -> String {
    let picture = Picture::new(scene);
    let mut without_room = 0;
    let unit = scene.length_unit.as_str();
    let body = map(&picture.plane, unit, |drawing| without_room = picture.draw(drawing));
    let width = body.size[0].max(LEAST_WIDTH);
    let title = format!("Scene {}", scene.name);
    let heading = heading(&title, &caption(without_room, picture.numbers_edges()), width);
    let legend = picture.legend().drawing(width);
    sheet(&title, &[heading, body, legend], 1).file()
}

fn caption(without_room: usize, edges: bool) -> String {
    let edges = if edges { " e0, e1, … are edges of the outline, as in “edge = 0”." } else { "" };
    let names = match without_room {
        0 => String::new(),
        1 => " One name found no room.".to_owned(),
        names => format!(" {names} names found no room."),
    };
    format!("At rest, to scale.{edges}{names}")
}

struct Picture<'a> {
    scene: &'a Scene,
    plane: Plane,
    /// Longer side of the body, length.
    extent: f64,
    outline: Vec<Px>,
}

impl<'a> Picture<'a> {
    fn new(scene: &'a Scene) -> Self {
        let (mut low, mut high) = scene.outline.bounds();
        let extent = (high - low).max();
        for way in [-OUTSIDE * extent, scene.needle.depth] {
            let end = scene.needle.entry() + scene.needle.axis * way;
            (low, high) = (low.inf(&end), high.sup(&end));
        }
        let longer = (high - low).max();
        let side = (high - low).sup(&Point2::repeat(LEAST_SIDE * longer)) + Point2::repeat(2.0 * MARGIN * longer);
        let middle = low + (high - low) * 0.5;
        let plane = Plane::new((middle - side * 0.5).into(), (middle + side * 0.5).into(), WIDTH);
        let outline = scene.outline.vertices().iter().map(|v| plane.at((*v).into())).collect();
        Self { scene, plane, extent, outline }
    }

    fn path(&self, points: &[Point2]) -> Vec<Px> {
        points.iter().map(|p| self.plane.at((*p).into())).collect()
    }

    /// Whether a point of the paper is in the body.
    fn inside(&self, point: Px) -> bool {
        let [x, y] = point;
        let next = self.outline.iter().cycle().skip(1);
        let crossed = self
            .outline
            .iter()
            .zip(next)
            .filter(|([ax, ay], [bx, by])| (*ay > y) != (*by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax));
        crossed.count() % 2 == 1
    }

    /// Draws everything; how many names found no room.
    fn draw(&self, drawing: &mut Drawing) -> usize {
        let mut names = Names::default();
        drawing.polygon("body", &self.outline);
        names.avoid(&closed(&self.outline));
        let regions: Vec<Vec<Point2>> =
            self.scene.inclusions.iter().map(|inclusion| self.region(inclusion.outline.vertices())).collect();
        let shapes: Vec<Vec<Px>> = regions.iter().map(|region| self.path(region)).collect();
        shapes.iter().for_each(|shape| drawing.polygon("inclusion", shape));
        // Those that another covers are seen, too.
        shapes.iter().for_each(|shape| drawing.polygon("rim", shape));
        shapes.iter().for_each(|shape| names.avoid(&closed(shape)));
        for part in &self.scene.immobile {
            let line = self.path(part);
            drawing.held(&line, self.plane.length(STROKES * self.extent), |point| self.inside(point));
            names.avoid(&line);
        }
        self.needle(drawing, &mut names);
        self.paddles(drawing, &mut names);
        let target = self.plane.at(self.scene.target.into());
        drawing.target(target);
        names.avoid_around(target, TARGET);
        names.add(target, "target", None);
        self.name_inclusions(&mut names, regions);
        self.number_edges(&mut names);
        names.draw(drawing, [0.0; 2], self.plane.size)
    }

    /// An inclusion, as much of it as there is paper.
    fn region(&self, vertices: &[Point2]) -> Vec<Point2> {
        let [low, high] = self.plane.corners().map(Point2::from);
        let mut region: Vec<(Point2, ())> = vertices.iter().map(|v| (*v, ())).collect();
        let mut cut = Vec::with_capacity(region.len() + 4);
        for (origin, [x, y]) in [(low, [-1.0, 0.0]), (low, [0.0, -1.0]), (high, [1.0, 0.0]), (high, [0.0, 1.0])] {
            clip_half_plane(&region, origin, Point2::new(x, y), (), &mut cut);
            std::mem::swap(&mut region, &mut cut);
        }
        region.iter().map(|corner| corner.0).collect()
    }

    /// Contact, needle outside, its way to its depth, and its line on from there.
    fn needle(&self, drawing: &mut Drawing, names: &mut Names) {
        let needle = &self.scene.needle;
        let contact = self.path(&needle.contact);
        drawing.polyline("contact", &contact);
        let entry = needle.entry();
        let at = |way: f64| self.plane.at((entry + needle.axis * way).into());
        let tolerance = 1e-9 * self.scene.outline.size();
        let out = self.scene.outline.way_inside(entry, needle.axis, tolerance).unwrap_or(0.0);
        if out > needle.depth {
            drawing.line("reference dotted", at(needle.depth), at(out));
            names.avoid(&[at(needle.depth), at(out)]);
        }
        let [outside, entry, end] = [-OUTSIDE * self.extent, 0.0, needle.depth].map(at);
        drawing.line("needle dashed", entry, end);
        drawing.marker(Marker::Diamond, "arrow", end);
        drawing.needle(outside, entry);
        names.avoid(&contact);
        names.avoid(&[outside, end]);
        names.avoid_around(entry, NEEDLE_POINT);
        names.avoid_around(end, NEEDLE_POINT);
    }

    fn paddles(&self, drawing: &mut Drawing, names: &mut Names) {
        for paddle in &self.scene.paddles {
            let [from, to] = paddle.segment.map(|p| self.plane.at(p.into()));
            let way = [to[0] - from[0], to[1] - from[1]];
            let length = way[0].hypot(way[1]);
            let gap = (GAP / length).min(MOST_GAP);
            let at = |part: f64| [from[0] + part * way[0], from[1] + part * way[1]];
            drawing.line("paddle", at(gap), at(1.0 - gap));
            names.avoid(&[at(gap), at(1.0 - gap)]);
            let (middle, normal) = (at(0.5), [way[1] / length, -way[0] / length]);
            let probe = [0, 1].map(|k| middle[k] + BESIDE * normal[k]);
            let outward = if self.inside(probe) { normal.map(|v| -v) } else { normal };
            names.add(middle, paddle.index.to_string(), Some(outward));
        }
    }

    fn name_inclusions(&self, names: &mut Names, regions: Vec<Vec<Point2>>) {
        for ((inclusion, region), number) in self.scene.inclusions.iter().zip(regions).zip(1..) {
            let what = match &inclusion.material {
                None => format!("inclusion {number}: × {}", short(inclusion.stiffness)),
                Some(_) => format!("inclusion {number}"),
            };
            // Cut off, it may be no simple polygon.
            let middle = Polygon::new(region).unwrap_or_else(|_| inclusion.outline.clone()).centroid();
            names.add(self.plane.at(middle.into()), what, None);
        }
    }

    fn numbers_edges(&self) -> bool {
        self.outline.len() <= MOST_EDGES
    }

    /// Numbers of edges as the scene file counts them, on the inner side.
    fn number_edges(&self, names: &mut Names) {
        let mut vertices = self.outline.clone();
        if self.scene.clockwise {
            vertices.reverse();
        }
        let edges = vertices.iter().zip(vertices.iter().cycle().skip(1)).enumerate();
        for (number, ([ax, ay], [bx, by])) in edges.filter(|_| self.numbers_edges()) {
            let (way, length) = ([bx - ax, by - ay], (bx - ax).hypot(by - ay));
            if length < SHORTEST_EDGE {
                continue;
            }
            let middle = [0.5 * (ax + bx), 0.5 * (ay + by)];
            let normal = [way[1] / length, -way[0] / length];
            let probe = [0, 1].map(|k| middle[k] + BESIDE * normal[k]);
            let inward = if self.inside(probe) { normal } else { normal.map(|v| -v) };
            names.add(middle, format!("e{number}"), Some(inward));
        }
    }

    fn legend(&self) -> Legend {
        let line = |class: &str| Key::Series(Some(class.to_owned()), None);
        let mark = |marker: Marker, class: &str| Key::Series(None, Some((marker, class.to_owned())));
        let way = format!("needle's way, {}", in_unit(self.scene.needle.depth, &self.scene.length_unit));
        let mut legend = Legend::default();
        legend.add(Key::Area("body".to_owned()), "body");
        if !self.scene.inclusions.is_empty() {
            legend.add(Key::Area("inclusion".to_owned()), "inclusion");
        }
        legend.add(line("immobile"), "immobile");
        legend.add(line("paddle"), "paddle");
        legend.add(mark(Marker::Circle, "target"), "target");
        legend.add(line("contact"), "needle contact");
        legend.add(line("needle"), "needle");
        legend.add(Key::Series(Some("needle dashed".to_owned()), Some((Marker::Diamond, "arrow".to_owned()))), &way);
        legend.add(line("reference dotted"), "needle's line from there");
        legend
    }
}

/// The same with its first point once more at the end.
fn closed(points: &[Px]) -> Vec<Px> {
    points.iter().chain(points.first()).copied().collect()
}
