//! Every fault of the catalogue, injected by name, with accounts from outside of the controller.
//!
//! Rows 1 to 32 run in lockstep on a [`bench`](mod@bench) in virtual time: a [`tissue`] that is linear about the controller's own
//! table, the sensors and the actuator of the simulator, and a [`seam`] between sensors and controller where faults act.
//! Rows 33 to 45 need real processes.
//!
//! Nothing that is checked comes from the controller's own word: the [`audit`] knows the fate of every sample, the
//! [`invariants`] are checked against every command, and the schedule's releases against plain arithmetic.

pub mod audit;
pub mod bench;
pub(crate) mod catalogue;
pub mod evidence;
pub mod fault;
pub mod invariants;
mod processes;
pub mod random;
pub mod report;
pub(crate) mod rows;
pub mod seam;
pub mod tissue;

use std::path::Path;

use firmware::contract::Table;
use model_offline::model::TissueModel;
use model_offline::scene::Scene;
use model_offline::table::{TableOptions, build};

use crate::error::SimError;

/// The paddle of the bundled scene that holds the target best.
pub(crate) const PADDLE: u32 = 3;

/// The controller's table for the bundled scene: what everything here is tried on.
///
/// # Errors
/// [`SimError::Scene`], [`SimError::Model`], [`SimError::TableBuild`].
pub fn fixture() -> Result<Table<f64, 2>, SimError> {
    let scene = Scene::read(Path::new("paper")).map_err(|error| SimError::Scene(error.into()))?;
    Ok(build(&TissueModel::new(&scene)?, PADDLE, &TableOptions::default())?)
}
