//! Units of stress, where numbers have one.

use super::preset::Preset;

/// A preset has stresses in kPa, and the scene's unit of stress is none that is known.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the preset {} has stresses in kPa, and the unit of stress {unit:?} is none of {}", preset.name(), KNOWN_UNITS)]
pub struct UnknownStress {
    /// What was asked for.
    pub preset: Preset,
    /// Label of the unit.
    pub unit: String,
}

const KNOWN_UNITS: &str = "Pa, kPa, MPa, mmHg, psi";

/// Kilopascals per unit of stress, where its label says so.
pub(super) fn kilopascals(unit: &str) -> Option<f64> {
    match unit {
        "Pa" | "N/m²" | "N/m2" => Some(1e-3),
        "kPa" => Some(1.0),
        "MPa" | "N/mm²" | "N/mm2" => Some(1e3),
        // By definition 13.5951 kg/dm³ × 9.80665 m/s² × 1 mm.
        "mmHg" => Some(0.133_322_387_415),
        // A pound, 0.45359237 kg × 9.80665 m/s², on a square inch, 0.0254² m².
        "psi" => Some(6.894_757_293_168_361),
        _ => None,
    }
}
