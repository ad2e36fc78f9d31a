//! Drawings as parts of the page.

use maud::{Markup, PreEscaped, html};
use model_offline::output::chart::{Drawing, Panel};

/// Width of a chart in the page's own pixels: letters of 12 px stay that on a phone.
pub(super) const CHART_WIDTH: f64 = 360.0;

/// A drawing in the page, whose style sheet it uses.
pub(super) fn inline(drawing: &Drawing) -> Markup {
    PreEscaped(drawing.inline())
}

/// Charts side by side, as many as there is room for.
pub(super) fn charts(drawings: &[Drawing]) -> Markup {
    html! { div.charts { @for drawing in drawings { figure { (inline(drawing)) } } } }
}

/// The same for charts that nothing in the page refers to.
pub(super) fn panels(panels: &[Panel]) -> Markup {
    charts(&panels.iter().map(|panel| panel.drawing(CHART_WIDTH)).collect::<Vec<_>>())
}
