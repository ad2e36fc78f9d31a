//! The table that faults and timing are tried on.

use firmware::contract::Table;
use model_offline::model::TissueModel;
use model_offline::scene::Scene;
use model_offline::table::{TableOptions, build};

use super::error::SimError;

/// The paddle of the bundled scene that holds the target best.
pub const PADDLE: u32 = 3;

/// The controller's table for the bundled scene.
///
/// # Errors
/// [`SimError::Scene`], [`SimError::Model`], [`SimError::TableBuild`].
pub fn paper_table() -> Result<Table<f64, 2>, SimError> {
    let scene = Scene::read(std::path::Path::new("paper"))?;
    Ok(build(&TissueModel::new(&scene)?, PADDLE, &TableOptions::default())?)
}
