//! The tables that faults and timing are tried on.

use firmware::contract::{SpatialTable, Table};
use model_offline::model::TissueModel;
use model_offline::placement::space::workflow::insertion_model;
use model_offline::scene::Scene;
use model_offline::scene::space::AnyScene;
use model_offline::table::space::SpaceTable;
use model_offline::table::{TableBuildError, TableOptions, build};

use super::error::SimError;

/// The paddle of the bundled scene that holds the target best.
pub const PADDLE: u32 = 3;

/// The scene of faults in space, as a file has it.
pub const BRICK: &str = include_str!("faults/brick.toml");

/// Its paddles.
pub const BRICK_PADDLES: [u32; 2] = [3, 6];

/// Knots of its table: the path is smooth, and every bit of the file is flipped.
const BRICK_KNOTS: usize = 9;

/// The controller's table for the bundled scene.
///
/// # Errors
/// [`SimError::Scene`], [`SimError::Model`], [`SimError::TableBuild`].
pub fn paper_table() -> Result<Table<f64, 2>, SimError> {
    let scene = Scene::read(std::path::Path::new("paper"))?;
    Ok(build(&TissueModel::new(&scene)?, PADDLE, &TableOptions::default())?)
}

/// The controller's table for a small body in space with two paddles.
///
/// # Errors
/// [`SimError::Scene`], [`SimError::Model`], [`SimError::TableBuild`].
pub fn brick_table() -> Result<SpatialTable<f64, 2>, SimError> {
    let paddles = TableBuildError::Paddles(BRICK_PADDLES.len());
    let AnyScene::Space(scene) = AnyScene::parse(BRICK, "brick.toml")? else { return Err(paddles.into()) };
    let options = TableOptions { knots: BRICK_KNOTS, ..TableOptions::default() };
    match SpaceTable::build(&insertion_model(&scene)?, &BRICK_PADDLES, &options)? {
        SpaceTable::Two(table) => Ok(*table),
        SpaceTable::One(_) => Err(paddles.into()),
    }
}
