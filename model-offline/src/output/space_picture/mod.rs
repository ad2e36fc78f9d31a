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

pub use self::body::{PaddlePatch, Shown, SpaceGeometry, SpaceState, orthogonal};
pub use self::frame::{CutPlane, planes, seen_from};
pub use self::outside::outside;
pub use self::section::{Cut, cut};
pub use self::sections::sections;
use super::chart::number::plain;
use super::chart::{colour_bar, heading, sheet};
use super::field_picture::{Field, with_unit};

/// Width of each drawing of a picture of its own, px.
const WIDTH: f64 = 380.0;

/// Outside and sections as a picture of its own, coloured by what paddles are to take away: the displacement orthogonal to
/// the needle.
pub fn svg(geometry: &SpaceGeometry, state: &SpaceState) -> String {
    let values = &orthogonal(geometry, state)[..];
    let scale = values.iter().copied().fold(0.0, f64::max);
    let shown = Shown { geometry, state, values, scale, held_still: false };
    let mut drawings = vec![outside(&shown, WIDTH)];
    drawings.extend(sections(&shown, WIDTH));
    let all = sheet("", &drawings, 2);
    let caption = format!(
        "Outside, and sections through the target at rest; displacements as they are. Blue: paddle (its rim, where a section \
         does not cut it); grey: needle and its contact; black or hatched: immobile; dashed: at rest, and inclusions; ring: \
         target at rest, dot: now. Largest value at a node:\u{a0}{}.",
        plain(scale)
    );
    let title = format!("{}: depth\u{a0}{}", geometry.name, with_unit(state.depth, &geometry.units[0]));
    let width = all.size[0];
    let bar = colour_bar(width.min(WIDTH), &Field::Orthogonal.label(&geometry.units), scale);
    sheet(&title, &[heading(&title, &caption, width), all, bar], 1).file()
}
