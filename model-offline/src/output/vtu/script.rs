//! A script for ParaView.

use super::in_unit;
use crate::output::space_picture::{SpaceGeometry, planes, seen_from};

/// The script, with names between `@` where something is put in.
const TEMPLATE: &str = include_str!("script.py.in");

/// What a script shows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shown<'a> {
    /// Name of the scene.
    pub scene: &'a str,
    /// Labels of length and stress.
    pub units: [&'a str; 2],
    /// File of the body, or of a series of it: a name in the folder of the script.
    pub body: &'a str,
    /// File of needle, target and paddles.
    pub parts: &'a str,
    /// Whether stress is in the body's file.
    pub stress: bool,
    /// Whether stress and strain are of points, as nodal rules in space have them, not of cells.
    pub of_points: bool,
    /// How a body in space is looked at; none in the plane.
    pub in_space: Option<Sight>,
}

/// How a body in space is looked at: cut open by a plane, whose side towards the eye is left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// A point of the plane, which is also looked at, length.
    pub origin: [f64; 3],
    /// Unit normal of the plane, towards the eye.
    pub normal: [f64; 3],
    /// Unit directions towards the eye and upwards.
    pub view: [[f64; 3]; 2],
}

impl Sight {
    /// A cut along the needle through the target at rest, with these paddles (indices) on this side.
    pub fn new(geometry: &SpaceGeometry, paddles: &[u32]) -> Self {
        let view = seen_from(geometry, paddles);
        let [one, other, _] = planes(geometry).map(|plane| plane.normal);
        let normal = if one.dot(&view[0]).abs() > other.dot(&view[0]).abs() { one } else { other };
        let normal = if normal.dot(&view[0]) < 0.0 { -normal } else { normal };
        Self { origin: geometry.target, normal: normal.into(), view: view.map(Into::into) }
    }

    fn lines(&self) -> [String; 3] {
        let Self { origin, normal, view: [towards, up] } = self;
        let eye: [f64; 3] = std::array::from_fn(|k| origin[k] + towards[k]);
        [
            "view.InteractionMode = \"3D\"\nview.CameraParallelProjection = 1".to_owned(),
            format!(
                "body = Clip(Input=body, ClipType=\"Plane\")\n\
                 body.ClipType.Origin = {origin:?}\nbody.ClipType.Normal = {normal:?}\n"
            ),
            format!("view.CameraFocalPoint = {origin:?}\nview.CameraPosition = {eye:?}\nview.CameraViewUp = {up:?}\n"),
        ]
    }
}

/// A Python script that shows the deformed body, coloured by von Mises stress (by the largest principal strain where no stress
/// is known), with needle, target, immobile boundary and paddles: `paraview --script=FILE`, or `pvpython FILE
/// picture.png` for a picture without a window. A body in space is cut open.
pub fn script(shown: Shown<'_>) -> String {
    let Shown { scene, units: [length, stress_unit], body, parts, stress, of_points, in_space } = shown;
    let flat = ["view.InteractionMode = \"2D\"".to_owned(), String::new(), String::new()];
    let [mode, cut, camera] = in_space.map_or(flat, |sight| sight.lines());
    // Lines are drawn over the surface that they lie in; surfaces are not.
    let representation = if in_space.is_some() { "\n    shown.Representation = \"Wireframe\"" } else { "" };
    let displacement = in_unit("displacement", length);
    let (colour, component) =
        if stress { (in_unit("von_mises_stress", stress_unit), "") } else { ("principal_strain".to_owned(), "X") };
    // What JSON takes for a string Python does, too.
    let quoted = |text: &str| serde_json::json!(text).to_string();
    fill(&[
        ("name", &scene.replace(['\n', '\r'], " ")),
        ("displacement", &quoted(&displacement)),
        ("body", &quoted(body)),
        ("parts", &quoted(parts)),
        ("colour", &quoted(&colour)),
        ("component", &quoted(component)),
        ("of", if of_points { "POINTS" } else { "CELLS" }),
        ("mode", &mode),
        ("cut", &cut),
        ("camera", &camera),
        ("representation", representation),
    ])
}

/// The script with these in the place of their names. What is put in is not looked at again, whatever it contains.
fn fill(named: &[(&str, &str)]) -> String {
    let pieces = TEMPLATE.split('@').enumerate().map(|(i, piece)| match i % 2 {
        0 => piece,
        _ => named.iter().find(|(name, _)| *name == piece).map_or(piece, |(_, text)| text),
    });
    pieces.collect()
}
