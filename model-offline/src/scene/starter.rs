//! A commented scene to start from, on a block of tissue or on an outline from elsewhere.

use super::import::Imported;
use crate::geometry::{Point2, Polygon, distance_to_polyline};
use std::fmt::Write as _;

/// What a starter scene is called and measured in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StarterNames {
    /// Name of the scene.
    pub name: String,
    /// Length unit.
    pub length: String,
    /// Stress unit.
    pub stress: String,
}

/// Paddle positions that are suggested at most.
const PADDLES: usize = 5;

/// The text of a valid, commented scene. Without an import: a block of 100 by 60 with one inclusion.
///
/// What holds the body, where the needle goes in and where paddles may sit is a suggestion: the lowest edge is immobile,
/// the needle enters at the highest edge, paddles sit on the longest of the others, the target is the innermost point.
pub fn starter(names: &StarterNames, imported: Option<&Imported>) -> String {
    let block = || {
        let rectangle =
            |a: [f64; 2], b: [f64; 2]| Polygon::new([a, [b[0], a[1]], b, [a[0], b[1]]].map(Point2::from).to_vec()).ok();
        let outline = rectangle([0.0, 0.0], [100.0, 60.0])?;
        Some(Imported { outline, inclusions: rectangle([55.0, 25.0], [75.0, 45.0]).into_iter().collect() })
    };
    let Some(imported) = imported.cloned().or_else(block) else {
        return String::new();
    };
    Layout::suggest(&imported.outline).text(names, &imported)
}

/// Where things go on an outline.
struct Layout {
    immobile: [Point2; 2],
    contact: [Point2; 2],
    axis: Point2,
    depth: f64,
    target: Point2,
    paddles: Vec<[Point2; 2]>,
    spacing: f64,
}

impl Layout {
    fn suggest(outline: &Polygon) -> Self {
        let edges: Vec<[Point2; 2]> = outline.edges().map(|(a, b)| [a, b]).collect();
        let height = |edge: &[Point2; 2]| 0.5 * (edge[0].y + edge[1].y);
        let length = |edge: &[Point2; 2]| (edge[1] - edge[0]).norm();
        let size = outline.size();
        // Short edges are parts of curves: nothing sits on them where a longer one is nearly as good.
        let score = |edge: &[Point2; 2], sign: f64| sign * height(edge) - 0.5 * length(edge);
        let best = |sign: f64, not: Option<usize>| {
            let candidates = (0..edges.len()).filter(|i| Some(*i) != not);
            candidates.min_by(|&a, &b| score(&edges[a], sign).total_cmp(&score(&edges[b], sign))).unwrap_or(0)
        };
        let supported = best(1.0, None);
        let entry = best(-1.0, Some(supported));
        let along = edges[entry][1] - edges[entry][0];
        let middle = edges[entry][0] + along * 0.5;
        let normal = Point2::new(-along.y, along.x).normalize();
        let axis = if outline.contains(middle + normal * (1e-3 * size)) { normal } else { -normal };
        let immobile = edges[supported];
        let contact = [middle - along * 0.15, middle + along * 0.15];
        let mut others: Vec<[Point2; 2]> = (0..edges.len())
            .filter(|i| *i != supported && *i != entry)
            .flat_map(|i| {
                let [a, b] = edges[i];
                // Long edges carry two paddles; none reaches a corner, where it could touch the immobile part.
                let spans: &[(f64, f64)] =
                    if length(&edges[i]) > 0.25 * size { &[(0.15, 0.45), (0.55, 0.85)] } else { &[(0.2, 0.8)] };
                spans.iter().map(move |(from, to)| [a + (b - a) * *from, a + (b - a) * *to]).collect::<Vec<_>>()
            })
            .collect();
        if others.is_empty() {
            others.push([edges[entry][0] + along * 0.02, edges[entry][0] + along * 0.25]);
        }
        others.sort_by(|a, b| length(b).total_cmp(&length(a)));
        others.truncate(PADDLES);
        // Around the body, so that neighbours have neighbouring numbers.
        let station = |p: &[Point2; 2]| {
            let centre = 0.5 * (p[0] + p[1]);
            edges.iter().position(|e| distance_to_polyline(centre, e) < 1e-6 * size).unwrap_or(0)
        };
        others.sort_by_key(station);
        Self {
            immobile,
            contact,
            axis,
            depth: rounded(0.05 * size),
            target: innermost(outline, &contact),
            paddles: others,
            spacing: rounded(size / 25.0),
        }
    }

    fn text(&self, names: &StarterNames, imported: &Imported) -> String {
        let StarterNames { name, length, stress } = names;
        let mut out = String::new();
        let _ = write!(
            out,
            "# A scene for model-offline and host-sim. All numbers are in consistent units of your choice; presets\n\
             # of materials and sensors go by the labels. `model-offline schema` describes every key.\n\
             #   model-offline check FILE                  its numbers, and what is seldom meant\n\
             #   model-offline draw FILE -o scene.svg      a picture of it\n\
             #   model-offline place FILE                  which paddle position is best\n\
             #   host-sim run --scene FILE                 simulate the insertion and write a report\n\n\
             [scene]\nname = {name:?}\ndimension = 2                       # plane strain\n\
             units = {{ length = {length:?}, stress = {stress:?} }}\n\n\
             [domain]                            # the body: a simple polygon\noutline = {}\n\n\
             [material]                          # Young's modulus 2.8, Poisson's ratio 0.4: soft tissue if stress is in kPa\n\
             model = \"neo-hookean\"               # fung | neo-hookean | saint-venant-kirchhoff | linear\n\
             lambda = 4.0                        # E ν / ((1 + ν)(1 − 2ν))\nmu = 1.0                            # E / (2 (1 + ν))\n\
             # In place of these three, where the unit of stress is known: preset = \"breast-fat\", or another of the literature;\n\
             # `model-offline materials` lists them.\n",
            polygon(&imported.outline)
        );
        for inclusion in &imported.inclusions {
            let _ = write!(
                out,
                "\n[[inclusion]]                       # a region of another stiffness\noutline = {}\n\
                 stiffness = 10.0                    # times the body's\n",
                polygon(inclusion)
            );
        }
        let _ = write!(
            out,
            "\n[immobile]                          # what bone or a table holds: polylines on the outline, or edges of it,\n\
             # {{ edge = 0, from = 0.2, to = 0.4 }}: from vertex 0 to vertex 1, from a fifth of it to two fifths\npaths = [{}]\n\n\
             [needle]\ncontact = {}     # tissue that moves with the needle\n\
             axis = {}                  # direction of insertion\n\
             depth = {}                         # how far the contact is pushed\nincrements = 10\n\n\
             [target]                            # the point to hold still\nposition = {}\n",
            points(&self.immobile),
            points(&self.contact),
            point(self.axis),
            number(self.depth),
            point(self.target)
        );
        for (i, paddle) in self.paddles.iter().enumerate() {
            let _ = write!(
                out,
                "\n[[paddle]]                          # a place where the paddle may sit\nindex = {}\nsegment = {}\n",
                i + 1,
                points(paddle)
            );
        }
        let _ = write!(
            out,
            "\n# [actuator]                        # limits of the paddle; defaults follow from the depth\n\
             # max_displacement = {d}\n# max_rate = {d}                     # per second\n# max_needle_speed = {}\n\n\
             # [sensor]                          # what sees the target: ideal, camera, ultrasound, mri, or numbers of your own\n\
             # preset = \"ultrasound\"\n\n\
             [discretization]\ntolerance = 0.02                    # largest relative error of the controllability measures; or: spacing = {}, between nodes\n",
            number(2.0 * self.depth),
            number(self.spacing),
            d = number(self.depth),
        );
        out
    }
}

/// The point of a grid that is farthest from the boundary and from the needle's contact.
fn innermost(outline: &Polygon, contact: &[Point2]) -> Point2 {
    let (low, high) = outline.bounds();
    let steps = 40;
    let grid = (0..=steps * steps).map(|n| {
        let share = Point2::new(f64::from(n % steps) / f64::from(steps), f64::from(n / steps) / f64::from(steps));
        low + (high - low).component_mul(&share)
    });
    let room = |p: &Point2| {
        if outline.contains(*p) { outline.distance_to_boundary(*p).min(distance_to_polyline(*p, contact)) } else { 0.0 }
    };
    let best = grid.max_by(|a, b| room(a).total_cmp(&room(b))).unwrap_or(low);
    // Off the middle: on a line of symmetry a target does not move sideways, and there would be nothing to see.
    let aside = best + Point2::new(0.35, 0.0) * room(&best);
    Point2::new(rounded3(aside.x, high.x - low.x), rounded3(aside.y, high.y - low.y))
}

/// Two significant digits.
fn rounded(value: f64) -> f64 {
    let step = 10f64.powf(value.abs().max(f64::MIN_POSITIVE).log10().floor() - 1.0);
    (value / step).round() * step
}

/// A thousandth of `scale`.
fn rounded3(value: f64, scale: f64) -> f64 {
    let step = 10f64.powf(scale.log10().floor() - 2.0);
    (value / step).round() * step
}

/// At most twelve significant digits, always with a point or an exponent, so that TOML reads a float.
fn number(value: f64) -> String {
    let text = format!("{}", format!("{value:.12e}").parse::<f64>().unwrap_or(value) + 0.0);
    if text.contains(['.', 'e', 'n', 'i']) { text } else { text + ".0" }
}

fn point(p: Point2) -> String {
    format!("[{}, {}]", number(p.x), number(p.y))
}

fn points(line: &[Point2]) -> String {
    format!("[{}]", line.iter().map(|p| point(*p)).collect::<Vec<_>>().join(", "))
}

fn polygon(polygon: &Polygon) -> String {
    if polygon.vertices().len() <= 6 {
        return points(polygon.vertices());
    }
    let lines: Vec<String> = polygon
        .vertices()
        .chunks(5)
        .map(|chunk| format!("  {},\n", chunk.iter().map(|p| point(*p)).collect::<Vec<_>>().join(", ")))
        .collect();
    format!("[\n{}]", lines.concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::scene::import::{assemble, svg};

    fn names() -> StarterNames {
        StarterNames { name: "mine".into(), length: "mm".into(), stress: "kPa".into() }
    }

    #[test]
    fn the_starter_is_a_valid_scene() {
        let scene = Scene::parse(&starter(&names(), None), "starter").unwrap();
        assert_eq!((scene.paddles.len(), scene.inclusions.len(), scene.length_unit.as_str()), (4, 1, "mm"));
    }

    /// Every outline gives a scene that passes validation: polygons of 3 to 40 corners, long and short, small and large.
    #[test]
    fn any_outline_becomes_a_valid_scene() {
        for corners in [3, 4, 5, 7, 12, 40] {
            for (width, height) in [(1.0, 1.0), (300.0, 40.0), (0.02, 0.05)] {
                let points = (0..corners).map(|i| {
                    let angle = std::f64::consts::TAU * (f64::from(i) + 0.31) / f64::from(corners);
                    Point2::new(width * angle.cos(), height * angle.sin())
                });
                let imported = assemble(vec![points.collect()], None).unwrap();
                let text = starter(&names(), Some(&imported));
                let scene = Scene::parse(&text, "starter").unwrap_or_else(|e| panic!("{corners} {width}: {e}\n{text}"));
                assert!(scene.needle.depth > 0.0);
            }
        }
    }

    #[test]
    fn a_drawing_becomes_a_valid_scene() {
        let drawing = r#"<svg><path d="M 0 0 C 40 -60 160 -60 200 0 Z"/><circle r="3"/></svg>"#;
        let imported = svg::read(drawing, Some(120.0)).unwrap();
        let scene = Scene::parse(&starter(&names(), Some(&imported)), "drawing").unwrap();
        assert!((scene.outline.bounds().1.x - 120.0).abs() < 0.1);
    }
}
