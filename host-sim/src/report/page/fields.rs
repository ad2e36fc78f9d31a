//! What the colours of a body can show, as the scripts of the page read it.

use model_offline::output::field_picture::Field;
use serde::Serialize;

/// A field that the reader may choose.
#[derive(Clone, Debug, Serialize)]
pub(super) struct ShownField {
    /// Its name in the script.
    pub(super) key: &'static str,
    /// What a reader sees, with its unit.
    pub(super) label: String,
    /// Part of the values that may be beyond the scale: some fields are without bound at the rim of a contact.
    beyond: f64,
}

impl ShownField {
    /// With these labels of length and stress.
    pub(super) fn new(field: Field, units: &[String; 2]) -> Self {
        Self { key: key(field), label: field.label(units), beyond: field.beyond() }
    }
}

/// What the script calls a field.
pub(super) fn key(field: Field) -> &'static str {
    match field {
        Field::Orthogonal => "orthogonal",
        Field::Size => "size",
        Field::Strain => "strain",
        Field::VonMises => "von_mises",
    }
}
