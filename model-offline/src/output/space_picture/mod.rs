//! A deformed body in space drawn: three orthogonal sections through the target, and its outside, coloured by a field.
//!
//! The planes stay where they are while the body moves: through the target at rest, two of them along the needle, one across. Of a
//! body whose needle goes along a coordinate axis they are planes of coordinates.

mod body;
mod edges;
mod frame;
mod outside;
mod section;
mod sections;

pub use self::body::{Colours, DrawnBody, PaddlePatch, Shown, SpaceGeometry, SpaceState};
pub use self::frame::{CutPlane, planes, seen_from};
pub use self::outside::outside;
pub use self::section::{Cut, cut};
pub use self::sections::sections;
use super::chart::number::plain;
use super::chart::{Key, Legend, Marker, colour_bar, heading, open_colour_bar, sheet};
use super::field_picture::{Field, with_unit};

/// Width of each drawing of a picture of its own, px.
const WIDTH: f64 = 380.0;

/// Outside and sections as a picture of its own, coloured by a field with these values at the nodes.
pub fn svg(body: &DrawnBody, field: Field, values: &[f64]) -> String {
    let DrawnBody { name, geometry, state, held_still } = body;
    let largest = values.iter().copied().fold(0.0, f64::max);
    let scale = field.scale(values);
    let colours = Colours::Field { values, scale };
    let shown = Shown { geometry, state, colours, way: None, held_still: *held_still };
    let mut drawings = vec![outside(&shown, WIDTH)];
    drawings.extend(sections(&shown, WIDTH));
    let all = sheet("", &drawings, 2);
    let caption = format!(
        "Outside, and sections through the target at rest; displacements as they are. Blue: paddle (its rim, where a section \
         does not cut it); grey: needle and its contact; black or hatched: immobile; dashed: at rest, and inclusions; ring: \
         target at rest, dot: now. Largest value at a node:\u{a0}{}.",
        plain(largest)
    );
    let title = format!("{name}: depth\u{a0}{}", with_unit(state.depth, &geometry.units[0]));
    let width = all.size[0];
    let bar = if largest > scale { open_colour_bar } else { colour_bar };
    let bar = bar(width.min(WIDTH), &field.label(&geometry.units), scale);
    sheet(&title, &[heading(&title, &caption, width), all, bar], 1).file()
}

/// A body at rest with everything that its scene names: outside and sections, to be looked at before it is solved. The needle
/// is to go `depth` deep, length.
pub fn scene_svg(geometry: &SpaceGeometry, depth: f64) -> String {
    let state = SpaceState::at_rest(geometry);
    let shown = Shown { geometry, state: &state, colours: Colours::Parts, way: Some(depth), held_still: true };
    let mut drawings = vec![outside(&shown, WIDTH)];
    drawings.extend(sections(&shown, WIDTH));
    let all = sheet("", &drawings, 2);
    let title = format!("Scene {}", geometry.name);
    let caption = "At rest, to scale, on a coarse mesh: outside, and sections through the target. Dotted: rims of paddles that a section does \
                   not cut.";
    let heading = heading(&title, caption, all.size[0]);
    let legend = legend(geometry, depth).drawing(all.size[0]);
    sheet(&title, &[heading, all, legend], 1).file()
}

fn legend(geometry: &SpaceGeometry, depth: f64) -> Legend {
    let line = |class: &str| Key::Series(Some(class.to_owned()), None);
    let mark = |marker: Marker, class: &str| Some((marker, class.to_owned()));
    let mut legend = Legend::default();
    legend.add(Key::Area("body".to_owned()), "body");
    if !geometry.inclusions.is_empty() {
        legend.add(Key::Area("inclusion".to_owned()), "inclusion");
    }
    legend.add(line("immobile"), "immobile");
    legend.add(line("paddle"), "paddle");
    legend.add(Key::Series(None, mark(Marker::Circle, "target")), "target");
    legend.add(line("contact"), "needle contact");
    legend.add(line("needle"), "needle");
    let way = format!("needle's way, {}", with_unit(depth, &geometry.units[0]));
    legend.add(Key::Series(Some("needle dashed".to_owned()), mark(Marker::Diamond, "arrow")), &way);
    legend
}
