//! A script for ParaView.

use super::in_unit;
use crate::scene::Scene;

/// What a script shows.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    /// File of the body, or of a series of it: a name in the folder of the script.
    pub body: &'a str,
    /// File of needle, target and paddles; none where the body's file has them too.
    pub parts: &'a str,
    /// Whether stress is in the body's file.
    pub stress: bool,
}

/// A Python script that shows the deformed body, coloured by von Mises stress (by the largest principal strain where no stress
/// is known), with needle, target, immobile boundary and paddles: `paraview --script=FILE`, or `pvpython FILE
/// picture.png` for a picture without a window.
pub fn script(scene: &Scene, shown: Shown<'_>) -> String {
    let Shown { body, parts, stress } = shown;
    let displacement = in_unit("displacement", &scene.length_unit);
    let (colour, component) = if stress {
        (in_unit("von_mises_stress", &scene.stress_unit), "")
    } else {
        ("principal_strain".to_owned(), "X")
    };
    // What JSON takes for a string Python does, too.
    let quoted = |text: &str| serde_json::json!(text).to_string();
    format!(
        r#"# {name}: the deformed body with needle (black), target (orange), immobile boundary (grey) and paddles (blue).
# In ParaView: paraview --script=THIS. Without a window: pvpython THIS picture.png
import os
import sys

from paraview.simple import *

here = os.path.dirname(os.path.abspath(__file__)) if "__file__" in globals() else os.getcwd()


def deformed(name):
    """The file, every point where it is now."""
    source = OpenDataFile(os.path.join(here, name))
    return WarpByVector(Input=source, Vectors=["POINTS", {displacement}])


view = GetActiveViewOrCreate("RenderView")
view.InteractionMode = "2D"
view.UseColorPaletteForBackground = 0
view.Background = [1.0, 1.0, 1.0]
view.OrientationAxesVisibility = 0

body = Show(deformed({body}), view)
body.Representation = "Surface With Edges"
body.EdgeColor = [0.75, 0.75, 0.75]
ColorBy(body, ("CELLS", {colour}, {component}))
body.RescaleTransferFunctionToDataRange(True, False)
body.SetScalarBarVisibility(view, True)
bar = GetScalarBar(GetColorTransferFunction({colour}), view)
bar.TitleColor = bar.LabelColor = [0.0, 0.0, 0.0]
bar.Orientation = "Horizontal"
bar.WindowLocation = "Lower Center"
bar.ScalarBarLength = 0.5

everything = deformed({parts})
for part, colour, width in [
    (1, [0.0, 0.0, 0.0], 6.0),
    (2, [0.84, 0.37, 0.0], 20.0),
    (3, [0.4, 0.4, 0.4], 5.0),
    (4, [0.0, 0.45, 0.7], 6.0),
]:
    one = Threshold(Input=everything, Scalars=["CELLS", "part"])
    one.LowerThreshold = one.UpperThreshold = part
    shown = Show(one, view)
    shown.ColorArrayName = [None, ""]
    shown.AmbientColor = shown.DiffuseColor = colour
    shown.LineWidth = shown.PointSize = width
    shown.RenderPointsAsSpheres = 1

scene = GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
scene.GoToLast()
ResetCamera(view)
view.CameraParallelScale *= 1.4
Render(view)
if len(sys.argv) > 1:
    SaveScreenshot(sys.argv[1], view, ImageResolution=[1280, 960])
"#,
        name = scene.name.replace(['\n', '\r'], " "),
        displacement = quoted(&displacement),
        body = quoted(body),
        parts = quoted(parts),
        colour = quoted(&colour),
        component = quoted(component),
    )
}
