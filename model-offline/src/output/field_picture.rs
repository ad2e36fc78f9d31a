//! A result drawn: the deformed body, coloured by a field, with needle, paddle and target.

use super::chart::number::{in_unit, plain};
use super::chart::style::BANDS;
use super::chart::{Anchor, Drawing, Marker, Plane, Px, colour_bar, heading, map, open_colour_bar, sheet};
use super::geometry::Geometry;
use super::surface::{Motion, inside, middle, triangles};

/// Width of what is between the axes, px.
const WIDTH: f64 = 640.0;
/// Room around the body, and length of the needle outside of it, part of its longer side.
const MARGIN: f64 = 0.06;
const OUTSIDE: f64 = 0.16;
/// Distance of the strokes of what is held, the same.
const STROKES: f64 = 0.03;
/// Part of the longer side by which the immobile part moves that is no rounding.
const MOVES: f64 = 1e-3;
/// Part of the nodes whose values are beyond the scale of a field that is without bound at the rim of a contact.
const BEYOND: f64 = 0.02;

/// A body in a state, as a result has it.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultBody {
    /// What it is: scene, tissue, paddle.
    pub name: String,
    /// Units of length and stress; "1" where a scene names none.
    pub units: [String; 2],
    /// The scene at rest.
    pub geometry: Geometry,
    /// Needle depth, length.
    pub depth: f64,
    /// The paddle that is attached.
    pub paddle: Option<u32>,
    /// Nodes there.
    pub nodes: Vec<[f64; 2]>,
    /// Norm of the Green–Lagrange strain at every node; empty in results of older versions.
    pub strain: Vec<f64>,
    /// Von Mises stress at every node, stress; empty where the displacement does not tell it.
    pub von_mises: Vec<f64>,
}

/// What the colours of a body can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// Length of the displacement.
    Size,
    /// Displacement orthogonal to the needle, its size.
    Orthogonal,
    /// Frobenius norm of the Green–Lagrange strain.
    Strain,
    /// Von Mises stress.
    VonMises,
}

impl Field {
    /// As on the command line.
    pub const ALL: [(&'static str, Self); 4] = [
        ("size", Self::Size),
        ("orthogonal", Self::Orthogonal),
        ("strain", Self::Strain),
        ("von-mises", Self::VonMises),
    ];

    /// Values at the nodes; none where the result does not have them.
    pub fn values(self, body: &ResultBody) -> Option<Vec<f64>> {
        let displacements = body.nodes.iter().zip(&body.geometry.nodes).map(|(now, x)| [now[0] - x[0], now[1] - x[1]]);
        let [nx, ny] = body.geometry.orthogonal;
        let there = |values: &Vec<f64>| (!values.is_empty()).then(|| values.clone());
        match self {
            Self::Size => Some(displacements.map(|[x, y]| x.hypot(y)).collect()),
            Self::Orthogonal => Some(displacements.map(|[x, y]| (x * nx + y * ny).abs()).collect()),
            Self::Strain => there(&body.strain),
            Self::VonMises => there(&body.von_mises),
        }
    }

    /// What a colour bar calls it, with its unit, of the labels of length and stress.
    pub fn label(self, [length, stress]: &[String; 2]) -> String {
        match self {
            Self::Size => in_unit("size of the displacement", length),
            Self::Orthogonal => in_unit("displacement orthogonal to the needle, its size", length),
            Self::Strain => "Green–Lagrange strain ‖E‖".to_owned(),
            Self::VonMises => in_unit("von Mises stress", stress),
        }
    }

    /// Part of the nodes whose values may be beyond the scale: some fields are without bound at the rim of a contact.
    pub fn beyond(self) -> f64 {
        match self {
            Self::Size | Self::Orthogonal => 0.0,
            Self::Strain | Self::VonMises => BEYOND,
        }
    }

    /// Where the colours end: at the largest value, or where only a few are beyond it.
    pub fn scale(self, values: &[f64]) -> f64 {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let beyond = (self.beyond() * sorted.len() as f64) as usize;
        let last = sorted.len().saturating_sub(1 + beyond);
        sorted.get(last).copied().unwrap_or(0.0)
    }
}

/// A result as a picture of its own, coloured by a field with these values at the nodes.
pub fn svg(body: &ResultBody, field: Field, values: &[f64]) -> String {
    let scale = field.scale(values);
    let picture = Picture::new(body);
    let drawn = map(&picture.plane, &body.units[0], |drawing| picture.draw(drawing, values, scale));
    let largest = values.iter().copied().fold(0.0, f64::max);
    let caption = format!(
        "To scale. Black: immobile; blue: paddle; grey: needle; dashed: outline at rest, and \
         inclusions; ring: target at rest, dot: now. Largest value at a node:\u{a0}{}.{}",
        plain(largest),
        if picture.breathes() { " The immobile part moves as the patient breathes." } else { "" }
    );
    let title = format!("{}: depth\u{a0}{}", body.name, with_unit(body.depth, &body.units[0]));
    let width = drawn.size[0];
    let bar = if largest > scale { open_colour_bar } else { colour_bar };
    let bar = bar(width, &field.label(&body.units), scale);
    sheet(&title, &[heading(&title, &caption, width), drawn, bar], 1).file()
}

/// A number with its unit; the label `1` means that there is none.
pub(super) fn with_unit(value: f64, unit: &str) -> String {
    if unit == "1" { plain(value) } else { format!("{}\u{a0}{unit}", plain(value)) }
}

/// Draws a triangle in the colours of its values, linear between its corners; 1 is where they end.
fn in_bands(drawing: &mut Drawing, corners: &[(Px, f64); 3]) {
    for (band, points) in bands(corners) {
        drawing.polygon(&format!("f{band}"), &points);
    }
}

/// A convex polygon cut where its value, linear in it, passes from one colour to the next: colours, and what has them. 1 is
/// where they end.
pub(super) fn bands(corners: &[(Px, f64)]) -> Vec<(usize, Vec<Px>)> {
    let of = |value: f64| ((value * BANDS as f64).max(0.0) as usize).min(BANDS - 1);
    let least = corners.iter().map(|corner| corner.1).fold(f64::INFINITY, f64::min);
    let most = corners.iter().map(|corner| corner.1).fold(f64::NEG_INFINITY, f64::max);
    let (first, last) = (of(least), of(most));
    let at = |edge: usize| edge as f64 / BANDS as f64;
    let part = |band: usize| {
        let above = if band == first { corners.to_vec() } else { cut(corners, at(band), 1.0) };
        let between = if band == last { above } else { cut(&above, at(band + 1), -1.0) };
        (band, between.into_iter().map(|corner| corner.0).collect::<Vec<Px>>())
    };
    (first..=last).map(part).filter(|(_, points)| points.len() > 2).collect()
}

/// A target that has moved: a ring where it was, a dot where it is.
pub(super) fn moved_target(drawing: &mut Drawing, rest: Px, now: Px) {
    drawing.circle("under", rest, 6.0);
    drawing.circle("target", rest, 6.0);
    drawing.marker(Marker::Circle, "dot", now);
}

/// The part of a convex polygon whose value is above a level (`side` 1), or below (−1).
fn cut(corners: &[(Px, f64)], level: f64, side: f64) -> Vec<(Px, f64)> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        let [before, after] = [from, to].map(|corner| side * (corner.1 - level));
        if before >= 0.0 {
            kept.push(*from);
        }
        if before * after < 0.0 {
            let part = before / (before - after);
            kept.push(([0, 1].map(|k| from.0[k] + part * (to.0[k] - from.0[k])), level));
        }
    }
    kept
}

struct Picture<'a> {
    body: &'a ResultBody,
    triangles: Vec<[usize; 3]>,
    plane: Plane,
    /// Longer side of the body, length.
    extent: f64,
}

impl<'a> Picture<'a> {
    fn new(body: &'a ResultBody) -> Self {
        let geometry = &body.geometry;
        let far = |point: &[f64; 2], way: f64| [0, 1].map(|k| point[k] + way * geometry.needle_axis[k]);
        let [low, high] = Plane::around(geometry.outline.iter().copied(), 0.0, WIDTH).corners();
        let extent = (high[0] - low[0]).max(high[1] - low[1]);
        let needle = far(&middle(&geometry.needle_contact), -OUTSIDE * extent);
        let all = geometry.outline.iter().chain(&body.nodes).copied().chain([needle]);
        let plane = Plane::around(all, MARGIN * extent, WIDTH);
        let triangles = triangles(&geometry.nodes, &geometry.outline);
        Self { body, triangles, plane, extent }
    }

    /// Whether what the scene holds has moved.
    fn breathes(&self) -> bool {
        let geometry = &self.body.geometry;
        let motion = Motion { rest: &geometry.nodes, moved: &self.body.nodes, triangles: &self.triangles };
        let far = |point: &[f64; 2]| {
            let now = motion.of(*point);
            (now[0] - point[0]).hypot(now[1] - point[1]) > MOVES * self.extent
        };
        geometry.immobile.iter().flatten().any(far)
    }

    fn draw(&self, drawing: &mut Drawing, values: &[f64], scale: f64) {
        let (body, geometry, plane) = (self.body, &self.body.geometry, &self.plane);
        let nodes = plane.path(&body.nodes);
        drawing.open_group("field");
        for corners in &self.triangles {
            in_bands(
                drawing,
                &corners.map(|corner| (nodes[corner], if scale > 0.0 { values[corner] / scale } else { 0.0 })),
            );
        }
        drawing.close_group();
        let motion = Motion { rest: &geometry.nodes, moved: &body.nodes, triangles: &self.triangles };
        let moved = |points: &[[f64; 2]]| plane.path(&points.iter().map(|p| motion.of(*p)).collect::<Vec<_>>());
        drawing.polygon("rest", &plane.path(&geometry.outline));
        for inclusion in &geometry.inclusions {
            let rim = moved(inclusion);
            drawing.polygon("under", &rim);
            drawing.polygon("rim", &rim);
        }
        // It moves where the patient does.
        let outline = moved(&geometry.outline);
        for part in &geometry.immobile {
            drawing.held(&moved(part), plane.length(STROKES * self.extent), |point| inside(&outline, point));
        }
        self.needle(drawing);
        if let Some(paddle) = geometry.paddles.iter().find(|paddle| Some(paddle.index) == body.paddle) {
            let segment = moved(&paddle.segment);
            drawing.polyline("paddle best", &segment);
            let [x, y] = middle(&segment);
            drawing.text("title halo", [x, y + 4.5], Anchor::Middle, &paddle.index.to_string());
        }
        moved_target(drawing, plane.at(geometry.target), moved(&[geometry.target])[0]);
    }

    fn needle(&self, drawing: &mut Drawing) {
        let geometry = &self.body.geometry;
        let contact = middle(&geometry.needle_contact);
        let at = |way: f64| self.plane.at([0, 1].map(|k| contact[k] + way * geometry.needle_axis[k]));
        drawing.line("under", at(self.body.depth - OUTSIDE * self.extent), at(self.body.depth));
        drawing.needle(at(self.body.depth - OUTSIDE * self.extent), at(self.body.depth));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Geometry;

    /// A square of 2 × 2 nodes a side, sheared: what is drawn covers it once, and every colour has the share of its values.
    #[test]
    fn colours_share_the_body_as_its_values_do() {
        let corners = [([0.0, 0.0], 0.0), ([100.0, 0.0], 1.0), ([0.0, 100.0], 0.0)];
        let mut drawing = Drawing::new([100.0; 2], "");
        in_bands(&mut drawing, &corners);
        let file = drawing.file();
        let document = roxmltree::Document::parse(&file).unwrap();
        let area = |class: &str| -> f64 {
            let of = document.descendants().filter(|node| node.attribute("class") == Some(class));
            let area = |points: &str| {
                let numbers: Vec<f64> = points.split([' ', ',']).map(|number| number.parse().unwrap()).collect();
                let points: Vec<[f64; 2]> = numbers.chunks(2).map(|pair| [pair[0], pair[1]]).collect();
                let edges = crate::output::surface::edges(&points);
                0.5 * edges.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>().abs()
            };
            of.map(|polygon| area(polygon.attribute("points").unwrap())).sum()
        };
        for band in 0..BANDS {
            // The triangle is as wide at x as 1 − x.
            let [from, to] = [band, band + 1].map(|edge| 1.0 - edge as f64 / BANDS as f64);
            let share = 0.5e4 * (from * from - to * to);
            assert!(
                (area(&format!("f{band}")) - share).abs() < 0.02 * share + 1.0,
                "{band}: {}",
                area(&format!("f{band}"))
            );
        }
    }

    fn body() -> ResultBody {
        let all = (0..=10).flat_map(|i| (0..=10).map(move |j| [f64::from(i), f64::from(j)]));
        let nodes: Vec<[f64; 2]> = all.collect();
        let geometry = Geometry {
            outline: vec![[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]],
            immobile: vec![vec![[0.0, 0.0], [10.0, 0.0]]],
            needle_contact: vec![[0.0, 4.0], [0.0, 6.0]],
            needle_axis: [1.0, 0.0],
            orthogonal: [0.0, 1.0],
            target: [5.0, 5.0],
            paddles: Vec::new(),
            inclusions: Vec::new(),
            nodes: nodes.clone(),
        };
        let moved = nodes.iter().map(|[x, y]| [x + 0.3, y - 0.4 * y / 10.0]).collect();
        let strain = (0..nodes.len()).map(|k| if k == 60 { 123.0 } else { 0.1 }).collect();
        ResultBody {
            name: "square".to_owned(),
            units: ["mm".to_owned(), "kPa".to_owned()],
            geometry,
            depth: 2.0,
            paddle: None,
            nodes: moved,
            strain,
            von_mises: Vec::new(),
        }
    }

    #[test]
    fn fields_are_what_they_are_called() {
        let body = body();
        let largest = |field: Field| field.values(&body).unwrap().into_iter().fold(0.0, f64::max);
        assert!((largest(Field::Size) - 0.5).abs() < 1e-12 && (largest(Field::Orthogonal) - 0.4).abs() < 1e-12);
        assert!(Field::VonMises.values(&body).is_none());
        // One node at a rim does not make the rest one colour.
        let strain = Field::Strain.values(&body).unwrap();
        assert_eq!(Field::Strain.scale(&strain), 0.1);
        let picture = svg(&body, Field::Strain, &strain);
        assert!(picture.contains(&plain(123.0)), "the whole is told");
        let ends = |field: Field| svg(&body, field, &field.values(&body).unwrap()).contains(" and more</text>");
        assert!(ends(Field::Strain) && !ends(Field::Size), "the bar says whether it ends there");
        assert!(picture.contains("depth\u{a0}2\u{a0}mm") && svg(&body, Field::Size, &[0.0; 121]).contains("[mm]"));
    }
}
