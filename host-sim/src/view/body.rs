//! What an insertion goes into, as pages are shown it.

use std::sync::Arc;

use model_offline::model::TissueModel;
use model_offline::model::space::SpaceModel;
use model_offline::output::space_picture::SpaceState;
use model_offline::reduction::Tabulated;

use crate::world::space::PreparedBody;
use crate::world::truth::{Truth, from_frame};

/// A body of an insertion.
#[derive(Clone, Debug)]
pub(super) enum ShownBody {
    /// In the plane, with the index of its paddle.
    Plane(Arc<TissueModel>, u32),
    /// In space.
    Space(Arc<SpaceShown>),
}

/// A body in space with the table that answers for it.
#[derive(Debug)]
pub(super) struct SpaceShown {
    pub(super) model: SpaceModel,
    pub(super) table: Arc<Tabulated>,
    /// Indices of its paddles.
    pub(super) paddles: Vec<u32>,
}

impl SpaceShown {
    /// Of a body that is about to be inserted into.
    pub(super) fn new(body: &PreparedBody<'_>) -> Self {
        Self { model: body.model().coarse().clone(), table: Arc::clone(body.table()), paddles: body.paddles().to_vec() }
    }

    /// The body as the table has it, to first order beside its states; none where it does not reach.
    pub(super) fn state(&self, truth: &Truth) -> Option<SpaceState> {
        let places: Vec<_> = truth.paddles.iter().take(self.paddles.len()).map(|moved| from_frame(*moved)).collect();
        let mut body = self.table.body();
        body.drive(truth.depth, &places).ok()?;
        let moved = self.model.nodal_displacements(&body.coefficients());
        Some(SpaceState {
            depth: truth.depth,
            paddles: self.paddles.clone(),
            paddle_displacements: places.into_iter().map(Into::into).collect(),
            displacements: moved.into_iter().map(Into::into).collect(),
            target: truth.target,
        })
    }
}
