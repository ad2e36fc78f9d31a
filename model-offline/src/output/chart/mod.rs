//! Charts and drawings as SVG: the only such module of the workspace.
//!
//! [`Figure`] is [`Panel`]s in a grid, a panel is two [`Axis`] and what is drawn between them; [`Drawing`] holds any
//! shapes, [`Plane`] maps a scene onto it. All of them write *classes*, never colours: in a page the style sheet
//! ([`style::page`]) gives them colours for light, dark and print, and [`Drawing::file`] makes a file of its own.
//!
//! # What every chart keeps to
//! - A series has a colour (Okabe & Ito) *and* a shape or a pattern; filled or open tells at most one second property.
//! - Letters are at least 12 px, nothing is drawn over them, and no text is wider than its place: names stand in legends
//!   below the panel, or once above all where several panels share them; titles are wrapped.
//! - What has no place on the axes is left out and breaks its line, except failures: a chart that hides what did not work
//!   misleads. A failure without a value stands in a band above the axes.
//! - Every marker says what it is under the pointer. The same figure gives the same bytes.
//!
//! # Why by hand
//! `plotters` 0.3.7 (SVG backend) was tried on the three hardest pictures, as it is and with a backend of our own that
//! writes classes. Its backends get whole pixels only (`BackendCoord` is a pair of `i32`; its issue 128 has been open
//! since 2020): outlines of a deformed body become stairs and cells leave gaps, unless everything is drawn ten times
//! larger, and then its own distances between ticks and labels no longer fit. A value that is not a number is drawn at the
//! lower end of the axis, one beyond the range at its edge, as if measured there. Dashes are cut into separate lines (125
//! elements for two curves), markers are circle, triangle and cross only, the legend can only lie inside the axes, over
//! the points, and a style carries a colour, no class: light and dark would need classes smuggled through colours. What
//! would have been left to it are ticks and two linear maps, about 130 lines here ([`axis`](self::Axis)). `poloto` has
//! classes and no logarithmic axes; `charts-rs` reads fonts and writes colours.
//!
//! # Example
//! ```
//! use model_offline::output::chart::{Axis, Colour, Figure, Marker, Panel, Series};
//!
//! let mut panel = Panel::new("Halving the spacing quarters the error", Axis::log("spacing", "mm"), Axis::log("error", "%"));
//! panel.series.push(Series::scatter("fem-t6", Colour::Vermillion, Marker::TriangleDown, vec![(2.0, 4.0), (1.0, 1.0)]));
//! let figure = Figure { title: String::new(), caption: String::new(), panels: vec![panel], columns: 1 };
//! assert!(figure.svg().starts_with("<svg xmlns="));
//! ```

mod axis;
mod draw;
mod drawing;
mod figure;
mod legend;
mod map;
mod notes;
pub mod number;
mod panel;
mod parts;
mod plane;
mod plot_area;
mod ramp;
pub mod style;

#[cfg(test)]
mod tests;

pub use axis::{Axis, Scale};
pub use drawing::{Anchor, Drawing, Marker, Px, escape, sheet};
pub use figure::{Figure, heading};
pub use legend::{Key, Legend};
pub use map::{map, map_of};
pub use notes::Names;
pub use panel::{Bars, Dash, Note, Panel, Place, ReferenceLine, Series, Strip};
pub use plane::Plane;
pub use ramp::{colour_bar, open_colour_bar};
pub use style::Colour;
