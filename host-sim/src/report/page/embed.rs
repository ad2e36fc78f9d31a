//! What pages have in common: their head, and drawings as parts of them.

use maud::{Markup, PreEscaped, html};
use model_offline::output::chart::{Drawing, Panel};

use super::style;

/// Whatever a string in the result says, the page loads nothing.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";

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

/// Head of the page of a scene.
pub(super) fn head_of(scene: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta http-equiv="Content-Security-Policy" content=(POLICY);
            link rel="icon" href="data:,";
            title { "Stillpoint: " (scene) }
            style { (PreEscaped(style::page())) }
        }
    }
}
