//! A script for ParaView.

use super::in_unit;
use crate::output::space_picture::{SpaceGeometry, planes, seen_from};

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
    format!(
        r#"# {name}: the deformed body with needle (black), target (orange), immobile boundary (grey) and paddles (blue).
# In ParaView: paraview --script=THIS. Without a window: pvpython THIS picture.png
import os
import sys

from paraview.simple import *

BODY, PARTS = {body}, {parts}


def folders():
    """Where the files may be: beside this script, of which ParaView's window does not tell where it is."""
    if "__file__" in globals():
        yield os.path.dirname(os.path.abspath(__file__))
    try:
        with open("/proc/self/cmdline", "rb") as line:
            words = [os.fsdecode(word) for word in line.read().split(b"\0")]
    except OSError:
        words = []
    for word, following in zip(words, words[1:]):
        if word.startswith("--script"):
            yield os.path.dirname(os.path.abspath(word.partition("=")[2] or following))
    yield os.getcwd()


here = next((folder for folder in folders() if os.path.exists(os.path.join(folder, BODY))), None)
if here is None:
    raise RuntimeError("start ParaView in the folder of this script: " + BODY + " is there")


def deformed(name):
    """The file, every point where it is now."""
    source = OpenDataFile(os.path.join(here, name))
    return WarpByVector(Input=source, Vectors=["POINTS", {displacement}])


view = GetActiveViewOrCreate("RenderView")
{mode}
view.UseColorPaletteForBackground = 0
view.Background = [1.0, 1.0, 1.0]
view.OrientationAxesVisibility = 0
if len(sys.argv) > 1:
    # Texts keep their size beside the picture's.
    view.ViewSize = [1280, 960]

body = deformed(BODY)
{cut}body = Show(body, view)
body.Representation = "Surface With Edges"
body.EdgeColor = [0.75, 0.75, 0.75]
ColorBy(body, ("{of}", {colour}, {component}))
body.SetScalarBarVisibility(view, True)
bar = GetScalarBar(GetColorTransferFunction({colour}), view)
bar.TitleColor = bar.LabelColor = [0.0, 0.0, 0.0]
bar.Orientation = "Horizontal"
bar.WindowLocation = "Lower Center"
bar.ScalarBarLength = 0.5

everything = deformed(PARTS)


def part(number):
    """Of needle (1), target (2), immobile boundary (3) and paddles (4) one."""
    one = Threshold(Input=everything, Scalars=["CELLS", "part"])
    one.LowerThreshold = one.UpperThreshold = number
    return one


def painted(source, colour):
    """The source, in one colour."""
    shown = Show(source, view)
    shown.ColorArrayName = [None, ""]
    shown.AmbientColor = shown.DiffuseColor = colour
    return shown


for number, colour, width in [
    (1, [0.0, 0.0, 0.0], 6.0),
    (3, [0.4, 0.4, 0.4], 5.0),
    (4, [0.0, 0.45, 0.7], 6.0),
]:
    shown = painted(part(number), colour)
    shown.LineWidth = width{representation}

everything.UpdatePipeline()
low, high = [everything.GetDataInformation().GetBounds()[end:4:2] for end in (0, 1)]
ball = Glyph(Input=part(2), GlyphType="Sphere", ScaleArray=["POINTS", "No scale array"], GlyphMode="All Points")
ball.ScaleFactor = 0.04 * max(high[0] - low[0], high[1] - low[1])
painted(ball, [0.84, 0.37, 0.0])

scene = GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
scene.GoToLast()
# At rest there is nothing to scale colours by.
body.RescaleTransferFunctionToDataRangeOverTime()
{camera}ResetCamera(view)
view.CameraParallelScale *= 1.4
Render(view)
if len(sys.argv) > 1:
    SaveScreenshot(sys.argv[1], view, ImageResolution=[1280, 960])
"#,
        name = scene.replace(['\n', '\r'], " "),
        displacement = quoted(&displacement),
        body = quoted(body),
        parts = quoted(parts),
        colour = quoted(&colour),
        component = quoted(component),
        of = if of_points { "POINTS" } else { "CELLS" },
    )
}
