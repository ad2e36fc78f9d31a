//! A commented scene to start from, on a block of tissue or on an outline from elsewhere.

mod layout;
mod sides;

use self::layout::Layout;
use super::Scene;
use super::import::{ImportError, Imported, ImportedNeedle, Role};
use super::millimetres;
use crate::geometry::{Point2, Polygon};
use crate::material::Preset;
use crate::number::in_unit;
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

/// Longer side of the starter block where its unit is known, mm; in other units as many of them.
const BLOCK_MM: f64 = 100.0;

impl StarterNames {
    /// Longer side of the starter block, in its unit: 100 mm where the unit is known.
    pub fn block(&self) -> f64 {
        millimetres(&self.length).map_or(BLOCK_MM, |unit_mm| BLOCK_MM / unit_mm)
    }
}

/// Depth of the insertion, part of the body's size: deeper, a soft block may give way beside a paddle that follows.
const DEPTH: f64 = 0.035;
/// And part of its width: thin bodies bend.
const ACROSS: f64 = 0.07;

/// Depth that is suggested for a body of this size and width, which its tissue bears with a paddle that follows.
pub fn depth_for(size: f64, width: f64) -> f64 {
    rounded(DEPTH * size).min(rounded(ACROSS * width))
}

/// The text of a valid, commented scene. Without an import: a block of 100 by 60 mm with one inclusion, in units that are not
/// known of 100 by 60.
///
/// What holds the body, where the needle goes in and where paddles may sit is a suggestion where the import does not
/// give it: what faces down and is lowest is immobile, the needle enters what faces up and is highest, paddles sit on the longest
/// of the other sides, the target is the innermost point ahead of the needle. A side is what lies between corners: a curve
/// is one, however many edges it has, and becomes straight under a paddle.
pub fn starter(names: &StarterNames, imported: Option<&Imported>) -> String {
    let block = || {
        let rectangle =
            |a: [f64; 2], b: [f64; 2]| Polygon::new([a, [b[0], a[1]], b, [a[0], b[1]]].map(Point2::from).to_vec()).ok();
        let side = |part: f64| names.block() * part;
        let outline = rectangle([0.0, 0.0], [side(1.0), side(0.6)])?;
        let inclusion = rectangle([side(0.55), side(0.25)], [side(0.75), side(0.45)]);
        // Beside the needle's line, where it moves across it, and a paddle can reach it.
        let target = Point2::new(side(0.81), side(0.3));
        let needle = ImportedNeedle::into_block(side(1.0), side(0.6));
        let body = Imported::of(outline, inclusion.into_iter().collect());
        Some(Imported { target: Some(target), needle: Some(needle), ..body })
    };
    let Some(imported) = imported.cloned().or_else(block) else {
        return String::new();
    };
    Layout::of(&imported).text(names, &imported)
}

/// The starter scene of an import, which is a valid one; what the import does not give is named in its summary.
///
/// # Errors
/// [`ImportError::NoScene`] says whose shape makes it invalid, and what to do.
pub fn imported(names: &StarterNames, imported: &mut Imported) -> Result<String, ImportError> {
    let layout = Layout::of(imported);
    let text = layout.text(names, imported);
    let parts = [
        (imported.immobile.is_empty(), "fixed"),
        (imported.needle.is_none(), "needle"),
        (imported.target.is_none(), "target"),
        (imported.paddles.is_empty(), "paddles"),
        (imported.material.is_none(), "material of the body"),
        (imported.inclusions.iter().any(|inclusion| inclusion.material.is_none()), "stiffness of inclusions"),
        (imported.depth.is_none(), "depth of the needle"),
    ];
    for (paddle, by) in &layout.straightened {
        let by = in_unit(*by, &names.length);
        let note =
            format!("outline: straight under suggested paddle {paddle}, which is stiff; the curve was up to {by} off");
        imported.summary.notes.push(note);
    }
    imported.summary.suggested = parts.iter().filter(|part| part.0).map(|part| part.1).collect();
    match Scene::parse(&text, "<new scene>") {
        Ok(_) => Ok(text),
        Err(error) => {
            let role = role_at(&text, error.line);
            Err(ImportError::NoScene { role, what: error.message, help: format!("{}; {}", hint(role), error.help) })
        }
    }
}

/// Whose section a line of the scene is in.
fn role_at(text: &str, line: usize) -> Role {
    let sections = text.lines().take(line).filter(|line| line.starts_with('['));
    match sections.last().and_then(|section| section.trim_start_matches('[').split(']').next()) {
        Some("inclusion") => Role::Inclusion,
        Some("immobile") => Role::Fixed,
        Some("needle") => Role::Needle,
        Some("target") => Role::Target,
        Some("paddle") => Role::Paddle(None),
        _ => Role::Body,
    }
}

/// What to draw otherwise.
fn hint(role: Role) -> &'static str {
    match role {
        Role::Body => "redraw the shape named `body`",
        Role::Inclusion => "redraw or remove the shapes named `inclusion-…`",
        Role::Needle => "draw or move the line named `needle`",
        Role::Target => "draw or move the shape named `target`",
        Role::Paddle(_) => "draw or move the lines named `paddle-1`, `paddle-2`, …",
        Role::Fixed => "draw or move the line named `fixed`",
    }
}

impl Layout {
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
             [domain]                            # the body: a simple polygon\noutline = {}\n\n{}",
            polygon(&self.outline),
            material(imported.material)
        );
        for inclusion in &imported.inclusions {
            let _ = write!(
                out,
                "\n[[inclusion]]                       # a region of another stiffness\noutline = {}\n",
                polygon(&inclusion.outline)
            );
            out += &match inclusion.material {
                None => "stiffness = 10.0                    # times the body's\n".to_owned(),
                Some(preset) => format!("material = {{ preset = \"{preset}\" }}\n"),
            };
        }
        let _ = write!(
            out,
            "\n[immobile]                          # what bone or a table holds: polylines on the outline, or edges of it,\n\
             # {{ edge = 0, from = 0.2, to = 0.4 }}: from vertex 0 to vertex 1, from a fifth of it to two fifths\npaths = [{}]\n\n\
             [needle]\ncontact = {}     # tissue that moves with the needle\n\
             axis = {}                  # direction of insertion\n\
             depth = {}                         # how far the contact is pushed\nincrements = 10\n\n\
             [target]                            # the point to hold still\nposition = {}\n",
            self.immobile.iter().map(|path| points(path)).collect::<Vec<_>>().join(", "),
            points(&self.contact),
            // Of a line in a drawing rounding is left across it.
            point(self.axis.map(|part| if part.abs() < 1e-12 { 0.0 } else { part })),
            number(self.depth),
            point(self.target)
        );
        for (index, paddle) in &self.paddles {
            let _ = write!(
                out,
                "\n[[paddle]]                          # a place where the paddle may sit\nindex = {index}\nsegment = {}\n",
                points(paddle)
            );
        }
        let _ = write!(
            out,
            "\n# [actuator]                        # limits of the paddle; defaults follow from the depth\n\
             # max_displacement = {d}\n# max_rate = {d}                     # per second\n# max_needle_speed = {}\n\n\
             # [sensor]                          # what sees the target: ideal, camera, ultrasound, mri, or numbers of your own\n\
             # preset = \"ultrasound\"\n\n\
             [discretization]\ntolerance = 0.02                    # largest relative error of the controllability measures; or: spacing = {}, between nodes\n\
             integration = \"fem-t6\"              # quadratic triangles, the fastest to a tolerance; scni-stabilised: meshfree, on any nodes\n",
            number(2.0 * self.depth),
            number(self.spacing),
            d = number(self.depth),
        );
        out
    }
}

/// The section of the body's material.
fn material(preset: Option<Preset>) -> String {
    let Some(preset) = preset else {
        return "[material]                          # Young's modulus 2.8, Poisson's ratio 0.4: soft tissue if stress is in kPa\n\
                model = \"neo-hookean\"               # fung | neo-hookean | saint-venant-kirchhoff | linear\n\
                lambda = 4.0                        # E ν / ((1 + ν)(1 − 2ν))\n\
                mu = 1.0                            # E / (2 (1 + ν))\n\
                # In place of these three, where the unit of stress is known: preset = \"breast-fat\", or another of the literature;\n\
                # `model-offline materials` lists them.\n"
            .to_owned();
    };
    format!(
        "[material]                          # `model-offline materials` lists more of them\npreset = \"{preset}\"\n"
    )
}

/// Two significant digits.
fn rounded(value: f64) -> f64 {
    let step = 10f64.powf(value.abs().max(f64::MIN_POSITIVE).log10().floor() - 1.0);
    (value / step).round() * step
}

/// Two significant digits, no more than the value.
fn rounded_down(value: f64) -> f64 {
    let step = 10f64.powf(value.abs().max(f64::MIN_POSITIVE).log10().floor() - 1.0);
    if value.is_finite() { (value / step).floor() * step } else { value }
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
    use crate::placement::workflow::model_with_paddle;
    use crate::scene::import::{ImportOptions, svg};
    use crate::solver::equilibrium::NewtonSettings;
    use crate::table::{TableOptions, build};

    fn names() -> StarterNames {
        StarterNames { name: "mine".into(), length: "mm".into(), stress: "kPa".into() }
    }

    #[test]
    fn the_starter_is_a_valid_scene() {
        let scene = Scene::parse(&starter(&names(), None), "starter").unwrap();
        assert_eq!((scene.paddles.len(), scene.inclusions.len(), scene.length_unit.as_str()), (4, 1, "mm"));
    }

    /// At a depth of 5.8 mm the homogeneous block gives way beside the paddle before its end, and the target comes back a part of its way.
    #[test]
    fn the_starters_tissue_bears_what_its_best_paddle_does() {
        let starter = Scene::parse(&starter(&names(), None), "starter").unwrap();
        for scene in [starter.without_inclusions(), starter] {
            let (model, paddle) = model_with_paddle(&scene, None).unwrap();
            let table = build(&model, paddle, &TableOptions::default()).unwrap();
            let mut body = model.body(model.paddle_position(paddle), NewtonSettings::default()).unwrap();
            let mut last = 0.0;
            for (knots, quarter) in
                table.knots.windows(2).flat_map(|knots| (1..=4).map(move |quarter| (knots, quarter)))
            {
                let [from, to] = [&knots[0], &knots[1]];
                let share = 0.25 * f64::from(quarter);
                let depth = from.depth + (to.depth - from.depth) * share;
                body.drive(depth, from.paddle_path + (to.paddle_path - from.paddle_path) * share).unwrap();
                let along = body.target_displacement().dot(&scene.needle.axis);
                assert!(along > last, "{} at {depth}: {along} after {last}", scene.tissue());
                last = along;
            }
        }
    }

    #[test]
    fn the_block_is_as_large_in_every_unit_that_is_known() {
        for (length, side) in [("mm", 100.0), ("cm", 10.0), ("m", 0.1), ("um", 1e5), ("furlong", 100.0)] {
            let scene =
                Scene::parse(&starter(&StarterNames { length: length.into(), ..names() }, None), "starter").unwrap();
            let width = scene.outline.vertices().iter().map(|p| p.x).fold(0.0, f64::max);
            assert!((width / side - 1.0).abs() < 1e-12, "{length}: {width}");
            assert!(scene.needle.depth < 0.1 * side && scene.target.x < side);
        }
    }

    /// Every outline gives a scene that passes validation: polygons of 3 to 40 corners, long and short, small and
    /// large.
    #[test]
    fn any_outline_becomes_a_valid_scene() {
        for corners in [3, 4, 5, 7, 12, 40] {
            for (width, height) in [(1.0, 1.0), (300.0, 40.0), (0.02, 0.05)] {
                let points = (0..corners).map(|i| {
                    let angle = std::f64::consts::TAU * (f64::from(i) + 0.31) / f64::from(corners);
                    Point2::new(width * angle.cos(), height * angle.sin())
                });
                let imported = Imported::of(Polygon::new(points.collect()).unwrap(), Vec::new());
                let text = starter(&names(), Some(&imported));
                let scene = Scene::parse(&text, "starter").unwrap_or_else(|e| panic!("{corners} {width}: {e}\n{text}"));
                assert!(scene.needle.depth > 0.0);
            }
        }
    }

    #[test]
    fn a_drawing_becomes_a_valid_scene() {
        let drawing = r#"<svg><path d="M 0 0 C 40 -60 160 -60 200 0 Z"/><circle r="3"/></svg>"#;
        let imported = svg::read(drawing, &ImportOptions { size: Some(120.0), ..Default::default() }).unwrap();
        let scene = Scene::parse(&starter(&names(), Some(&imported)), "drawing").unwrap();
        assert!((scene.outline.bounds().1.x - 120.0).abs() < 0.1);
    }
}
