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
            // Nobody waits for them while the needle moves.
            strain: Vec::new(),
            von_mises: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_offline::discretization::{Integration, Method, Resolution};
    use model_offline::placement::space::workflow::insertion_model;
    use model_offline::scene::space::SpaceScene;
    use model_offline::solver::equilibrium::NewtonSettings;
    use nalgebra::Vector3;

    /// Beside the way the body is the model's to first order, and what is held is where it is held.
    #[test]
    fn the_body_that_is_shown_is_nearly_the_models() {
        let mut scene = SpaceScene::bundled("block").unwrap().with_method(Method::new(Integration::FemT4));
        scene.discretization.resolution = Resolution::Level(0);
        let model = insertion_model(&scene).unwrap();
        let body = PreparedBody::new(&model, &[3, 6], true, 2).unwrap();
        let shown = SpaceShown::new(&body);
        let way = body.table().way(0.037);
        let beside = [Vector3::new(0.001, 0.0, -0.0005), Vector3::new(0.0, -0.001, 0.0005)];
        let places: Vec<Vector3<f64>> = way.iter().zip(beside).map(|(on_way, by)| on_way + by).collect();
        let paddles = [places[0].into(), places[1].into()];
        let truth = Truth { depth: 0.037, paddles, target: [1.0, 2.0, 3.0], ..Truth::default() };
        let state = shown.state(&truth).unwrap();
        assert_eq!((state.depth, &state.paddles[..], state.target), (0.037, &[3, 6][..], truth.target));
        assert_eq!(state.paddle_displacements, paddles);
        let attached = [3, 6].map(|index| scene.paddle_position(index).unwrap());
        let mut full = model.coarse().body(&attached, NewtonSettings::default()).unwrap();
        full.drive(0.037, &places).unwrap();
        let expected = model.coarse().nodal_displacements(full.equilibrium().coefficients());
        let far = |(shown, full): (&[f64; 3], &Vector3<f64>)| (Vector3::from(*shown) - full).norm();
        let apart = state.displacements.iter().zip(&expected).map(far).fold(0.0, f64::max);
        assert!(state.displacements.len() == expected.len() && apart < 0.05 * 0.037, "{apart}");
        for (place, moved) in attached.iter().zip(&places) {
            for node in model.coarse().paddle_nodes(*place) {
                let shown = Vector3::from(state.displacements[*node as usize]);
                assert!((shown - moved).norm() < 1e-10, "{shown} {moved}");
            }
        }
        let beyond = Truth { depth: 1.0, ..truth };
        assert!(shown.state(&beyond).is_none(), "the table does not reach");
    }
}
