//! The colours of a field and what they mean.

use super::drawing::{Anchor, Drawing};
use super::number::plain;
use super::style::BANDS;

/// A bar of the colours from 0 to `largest`, with what they show and its unit below.
pub fn colour_bar(width: f64, label: &str, largest: f64) -> Drawing {
    bar(width, label, largest, false)
}

/// The same where some values are beyond the last colour's.
pub fn open_colour_bar(width: f64, label: &str, last: f64) -> Drawing {
    bar(width, label, last, true)
}

fn bar(width: f64, label: &str, largest: f64, and_more: bool) -> Drawing {
    let mut drawing = Drawing::new([width, 46.0], format!("Colours of the {label}"));
    let step = (width - 20.0) / BANDS as f64;
    for band in 0..BANDS {
        drawing.rectangle(&format!("f{band}"), [10.0 + band as f64 * step, 4.0], [step, 12.0]);
    }
    for (part, anchor) in [(0.0, Anchor::Start), (0.5, Anchor::Middle), (1.0, Anchor::End)] {
        let more = if and_more && part == 1.0 { " and more" } else { "" };
        let value = format!("{}{more}", plain(part * largest));
        drawing.text("tick", [10.0 + part * (width - 20.0), 29.0], anchor, &value);
    }
    drawing.text("muted", [0.5 * width, 43.0], Anchor::Middle, label);
    drawing
}
