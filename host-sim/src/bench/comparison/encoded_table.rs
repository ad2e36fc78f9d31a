//! Tables as files: read, and held against the scene that is simulated.

use std::path::Path;

use firmware::contract::{Table, decode};
use model_offline::number::length;
use model_offline::scene::Scene;
use model_offline::table::EndedEarly;

use crate::bench::error::SimError;
use crate::record::files::read_bytes;
use model_offline::scene::TissueVariant;

/// Reads and validates a table file.
///
/// # Errors
/// [`SimError::File`], [`SimError::Table`].
pub fn read_table(path: &Path) -> Result<EncodedTable, SimError> {
    let bytes = read_bytes(path)?;
    let table = decode(&bytes).map_err(|source| SimError::Table { path: path.to_owned(), source })?;
    Ok(EncodedTable { table, bytes, ended: None })
}

/// A table, and the bytes that the controller decodes.
#[derive(Clone, Debug)]
pub struct EncodedTable {
    /// The table in double precision.
    pub table: Table<f64, 2>,
    /// Its bytes in the controller's number type.
    pub bytes: Vec<u8>,
    /// Why it is not as deep as its scene's insertion, where it was built here and ended early.
    pub ended: Option<EndedEarly>,
}

/// Says so where a table ends before the needle does, both depths as lengths, and why where that is known.
pub(in crate::bench) fn ends_early(depth_end: f64, needle_depth: f64, ended: Option<&EndedEarly>) -> Option<String> {
    // As deep but for rounding.
    if depth_end >= needle_depth * (1.0 - 1e-9) {
        return None;
    }
    let plainly =
        || format!("the table ends at depth {}, and the needle goes to {}", length(depth_end), length(needle_depth));
    Some(ended.map_or_else(plainly, ToString::to_string))
}

/// Refuses a table in other units of length and stress than `expected`.
///
/// # Errors
/// [`SimError::TableUnits`].
pub fn check_units<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    path: &Path,
    expected: &[String; 2],
) -> Result<(), SimError> {
    let found = [table.units.length.as_str().to_owned(), table.units.stress.as_str().to_owned()];
    if found == *expected {
        return Ok(());
    }
    Err(SimError::TableUnits { path: path.to_owned(), found, expected: expected.clone() })
}

/// Whether a table was computed from this scene, with or without its inclusions, and with or without what a simple model
/// leaves out.
pub fn is_of(table: &Table<f64, 2>, scene: &Scene) -> bool {
    let simple = scene.without_a_past();
    let is = |scene: &Scene| TissueVariant::ALL.iter().any(|tissue| tissue.of(scene).hash() == table.scene_hash);
    is(scene) || is(&simple)
}
