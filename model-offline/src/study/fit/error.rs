//! Why nothing can be fitted.

use crate::model::ModelError;
use crate::study::effects::EffectsError;
use crate::table::TableBuildError;

/// Why nothing can be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The scene cannot be modelled, or no candidate keeps the tolerance.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// It has no table.
    #[error(transparent)]
    Table(TableBuildError),
    /// The model with all effects of the scene, which the others are held against, cannot be followed.
    #[error("the model with all effects of the scene ({effects}) cannot be taken along its insertion: {source}")]
    World {
        /// The effects.
        effects: String,
        /// Why.
        source: EffectsError,
    },
}

impl From<TableBuildError> for FitError {
    fn from(error: TableBuildError) -> Self {
        match error {
            TableBuildError::Model(error) => Self::Model(error),
            other => Self::Table(other),
        }
    }
}
