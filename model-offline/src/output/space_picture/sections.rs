//! Three sections through the target as drawings.

use super::edges::Edges;
use super::section::cut_triangles;
use super::{Cut, CutPlane, Shown, cut, planes};
use crate::geometry::Point;
use crate::output::chart::style::BANDS;
use crate::output::chart::{Anchor, Drawing, Marker, Plane, Px, heading, map_of};
use crate::output::field_picture::{bands, moved_target};
use crate::output::surface::inside;

/// Room around what is drawn, and length of the needle outside of the body, part of the body's diagonal.
const MARGIN: f64 = 0.04;
const OUTSIDE: f64 = 0.13;
/// Distance of the strokes of what is held, the same.
const STROKES: f64 = 0.022;
/// What a paddle's name takes, px.
const NAME: f64 = 12.0;
/// Space between a section's name and the section, px.
const GAP: f64 = 4.0;

/// The sections, each about this wide, px.
pub fn sections(shown: &Shown<'_>, width: f64) -> [Drawing; 3] {
    let moved = shown.state.moved(shown.geometry);
    planes(shown.geometry).map(|plane| Section::new(shown, &moved, plane).drawing(width))
}

/// A name at a place; where there is one already, beside that.
fn add_name(names: &mut Vec<(Px, String)>, at: Px, name: &str) {
    let is_here = |there: &Px| (0..2).all(|k| (there[k] - at[k]).abs() < NAME);
    match names.iter_mut().find(|(there, _)| is_here(there)) {
        Some((_, names)) => {
            names.push_str(", ");
            names.push_str(name);
        }
        None => names.push((at, name.to_owned())),
    }
}

/// A plane, and what it cuts.
struct Section<'a> {
    shown: &'a Shown<'a>,
    moved: &'a [Point<3>],
    plane: CutPlane,
    now: Vec<Cut>,
    rest: Vec<Cut>,
    /// Where the needle's contact is now, and the needle's end that is not drawn any more.
    needle: [Point<3>; 2],
    extent: f64,
}

impl<'a> Section<'a> {
    fn new(shown: &'a Shown<'a>, moved: &'a [Point<3>], plane: CutPlane) -> Self {
        let geometry = shown.geometry;
        let rest: Vec<Point<3>> = geometry.nodes.iter().map(|x| Point::from(*x)).collect();
        let extent = geometry.extent();
        let axis = Point::from(geometry.axis);
        let values = shown.parts_of_scale();
        let contact = geometry.middle(&geometry.needle) + axis * shown.state.depth;
        Self {
            now: cut(moved, &geometry.tetrahedra, &values, &plane),
            // Nothing has moved yet: once is enough.
            rest: if shown.is_at_rest() { Vec::new() } else { cut(&rest, &geometry.tetrahedra, &values, &plane) },
            needle: [contact, contact - axis * (OUTSIDE * extent)],
            shown,
            moved,
            plane,
            extent,
        }
    }

    fn drawing(&self, width: f64) -> Drawing {
        let unit = &self.shown.geometry.units[0];
        let paper = self.paper(width);
        let [right, up] = self.plane.axes();
        let name = self.plane.name(unit);
        let mut section = map_of(&paper, [&right, &up], unit, |drawing| self.draw(drawing, &paper));
        let title = heading("", &name, section.size[0]);
        let [wide, high] = section.size;
        section.label = format!("Section {name}");
        let mut drawing = Drawing::new([wide, title.size[1] + GAP + high], section.label.clone());
        drawing.place([0.0, 0.0], &title);
        section.label.clear();
        drawing.place([0.0, title.size[1] + GAP], &section);
        drawing
    }

    /// The part of the plane that is drawn.
    fn paper(&self, width: f64) -> Plane {
        let corners = self.now.iter().chain(&self.rest).flat_map(|cut| cut.corners.iter().map(|corner| corner.0));
        let needle = self.needle.iter().map(|x| self.plane.coordinates(x));
        let target = Point::from(self.shown.geometry.target);
        let target = [self.plane.coordinates(&target)];
        // Rims of paddles beside the plane may reach beyond what it cuts.
        let attached = &self.shown.state.paddles;
        let patches = self.shown.geometry.paddles.iter().filter(|patch| attached.contains(&patch.index));
        let nodes = patches.flat_map(|patch| patch.triangles.iter().flatten());
        let rims = nodes.map(|node| self.plane.coordinates(&self.moved[*node as usize]));
        Plane::around(corners.chain(needle).chain(target).chain(rims), MARGIN * self.extent, width)
    }

    fn draw(&self, drawing: &mut Drawing, paper: &Plane) {
        if self.shown.is_at_rest() {
            drawing.region("body", &self.edge(&self.now, paper, |_| true));
        } else {
            self.field(drawing, paper);
        }
        for line in self.edge(&self.rest, paper, |_| true) {
            drawing.polyline("rest", &line);
        }
        let parts = &self.shown.geometry.parts;
        for part in 1..=self.shown.geometry.inclusions.len() as u32 {
            let rim = self.edge(&self.now, paper, |cut| parts[cut.tetrahedron] == part);
            if self.shown.is_at_rest() {
                drawing.region("inclusion", &rim);
                continue;
            }
            for line in rim {
                drawing.polyline("under", &line);
                drawing.polyline("rim", &line);
            }
        }
        let outline = self.edge(&self.now, paper, |_| true);
        for line in &outline {
            drawing.polyline("edge", line);
        }
        let is_inside = |point: Px| outline.iter().filter(|line| inside(line, point)).count() % 2 == 1;
        for line in self.lines(&self.shown.geometry.immobile, paper) {
            drawing.held(&line, paper.length(STROKES * self.extent), is_inside);
        }
        self.needle(drawing, paper);
        self.paddles(drawing, paper);
        let target = Point::from(self.shown.geometry.target);
        let at = |x: &Point<3>| paper.at(self.plane.coordinates(x));
        if self.shown.is_at_rest() {
            drawing.target(at(&target));
        } else {
            moved_target(drawing, at(&target), at(&(target + Point::from(self.shown.state.target))));
        }
    }

    /// The field's colours: one shape each.
    fn field(&self, drawing: &mut Drawing, paper: &Plane) {
        let mut of_band: Vec<Edges> = (0..BANDS).map(|_| Edges::default()).collect();
        for cut in &self.now {
            let corners: Vec<(Px, f64)> = cut.corners.iter().map(|(at, value)| (paper.at(*at), *value)).collect();
            for (band, points) in bands(&corners) {
                of_band[band].add_polygon(&points);
            }
        }
        drawing.open_group("field");
        for (band, edges) in of_band.into_iter().enumerate() {
            drawing.region(&format!("f{band}"), &edges.chains());
        }
        drawing.close_group();
    }

    /// Edge of some of the cut tetrahedra.
    fn edge(&self, cuts: &[Cut], paper: &Plane, wanted: impl Fn(&Cut) -> bool) -> Vec<Vec<Px>> {
        let mut edges = Edges::default();
        for cut in cuts.iter().filter(|cut| wanted(cut)) {
            edges.add_polygon(&cut.corners.iter().map(|corner| paper.at(corner.0)).collect::<Vec<Px>>());
        }
        edges.chains()
    }

    /// What the plane cuts of a patch.
    fn lines(&self, triangles: &[[u32; 3]], paper: &Plane) -> Vec<Vec<Px>> {
        let mut edges = Edges::default();
        for ends in cut_triangles(self.moved, triangles, &self.plane) {
            edges.add_line(ends.map(|end| paper.at(end)));
        }
        edges.chains()
    }

    fn needle(&self, drawing: &mut Drawing, paper: &Plane) {
        for line in self.lines(&self.shown.geometry.needle, paper) {
            drawing.polyline("contact", &line);
        }
        if !self.plane.across_needle {
            let [tip, far] = self.needle.map(|x| paper.at(self.plane.coordinates(&x)));
            if let Some(end) = self.shown.way {
                let end =
                    paper.at(self.plane.coordinates(&(self.needle[0] + Point::from(self.shown.geometry.axis) * end)));
                drawing.line("needle dashed", tip, end);
                drawing.marker(Marker::Diamond, "arrow", end);
            }
            drawing.line("under", far, tip);
            drawing.needle(far, tip);
        }
    }

    fn paddles(&self, drawing: &mut Drawing, paper: &Plane) {
        let attached = &self.shown.state.paddles;
        let class = self.shown.paddle();
        let mut names: Vec<(Px, String)> = Vec::new();
        for patch in self.shown.geometry.paddles.iter().filter(|patch| attached.contains(&patch.index)) {
            let lines = self.lines(&patch.triangles, paper);
            let rim = if lines.is_empty() { self.rim_of(&patch.triangles, paper) } else { Vec::new() };
            for line in &lines {
                drawing.polyline(class, line);
            }
            for line in &rim {
                drawing.polyline(&format!("{class} beside"), line);
            }
            // What is beside the plane has its name at its upper end: in its middle may be the target.
            let top = rim.iter().flatten().map(|point| point[1]).fold(f64::INFINITY, f64::min);
            let all: Vec<Px> = lines.into_iter().chain(rim).flatten().collect();
            let [x, y] = crate::output::surface::middle(&all);
            if !all.is_empty() {
                add_name(&mut names, [x, y.min(top + NAME)], &patch.index.to_string());
            }
        }
        for ([x, y], name) in names {
            drawing.text("title halo", [x, y + 4.5], Anchor::Middle, &name);
        }
    }

    /// The rim of a patch, projected.
    fn rim_of(&self, triangles: &[[u32; 3]], paper: &Plane) -> Vec<Vec<Px>> {
        let mut counted: std::collections::BTreeMap<[u32; 2], u32> = std::collections::BTreeMap::new();
        for t in triangles {
            for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
                *counted.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
        let mut edges = Edges::default();
        for (edge, _) in counted.into_iter().filter(|(_, count)| *count == 1) {
            edges.add_line(edge.map(|node| paper.at(self.plane.coordinates(&self.moved[node as usize]))));
        }
        edges.chains()
    }
}
