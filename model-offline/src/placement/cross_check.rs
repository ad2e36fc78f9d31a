//! A second opinion on an answer that carries no error estimate: quadratic triangles on a few graded nodes.

use super::rest::rest_responses;
use super::study::PaddleResult;
use crate::discretization::{Integration, Method};
use crate::model::graded_model;
use crate::scene::Scene;
use serde::Serialize;

/// Refinement level of the triangles: wrong by 1 to 3 % on `paper`, `paper-hull`, `breast` and `prostate`, for 5 to 50 ms.
const LEVEL: i32 = 0;
/// Distance from which on the answer is not to be trusted, whatever the triangles are wrong by themselves.
const DOUBTFUL: f64 = 0.15;

/// How far the controllability measures are from those of another method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CrossCheck {
    /// Worst relative distance of the controllability measures.
    pub controllability: f64,
    /// The paddle where it is.
    pub paddle: u32,
    /// Nodes of the quadratic triangles.
    pub nodes: usize,
}

/// Compares results with quadratic triangles on graded nodes; none where those cannot be made.
pub fn cross_check(scene: &Scene, paddles: &[PaddleResult]) -> Option<CrossCheck> {
    let model = graded_model(scene, Method::new(Integration::FemT6), LEVEL).ok()?;
    let others = rest_responses(&model).ok()?;
    let apart = paddles.iter().zip(&others).map(|(paddle, other)| {
        ((paddle.controllability_measure / other.controllability_measure - 1.0).abs(), paddle.index)
    });
    let (controllability, paddle) = apart.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(CrossCheck { controllability, paddle, nodes: model.nodes() })
}

impl CrossCheck {
    /// A line for people.
    pub fn line(&self) -> String {
        let advice = if self.controllability > DOUBTFUL {
            ": too far to trust; use --tolerance, or another --integration (nsni, fem-t6)"
        } else {
            ""
        };
        format!(
            "cross-check: ‖J⁻¹n‖ up to {:.1} % away from quadratic triangles on {} graded nodes (paddle {}){advice}",
            100.0 * self.controllability,
            self.nodes,
            self.paddle
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::Resolution;
    use crate::model::TissueModel;
    use crate::placement::study::{PlacementOptions, place};

    #[test]
    fn coarse_nodes_are_found_out_and_fine_ones_are_not_accused() {
        let check = |integration, spacing| {
            let mut scene = Scene::bundled("paper").unwrap();
            (scene.needle.depth, scene.needle.increments) = (0.001, 1);
            scene.discretization.method.integration = integration;
            scene.discretization.resolution = Resolution::Spacing(spacing);
            let model = TissueModel::new(&scene).unwrap();
            let placement = place(&model, &PlacementOptions::default()).unwrap();
            cross_check(&scene, &placement.paddles).unwrap()
        };
        let (coarse, fine) = (check(Integration::Dni, 0.2), check(Integration::Gauss, 0.05));
        assert!(coarse.controllability > DOUBTFUL && coarse.line().contains("too far"), "{coarse:?}");
        assert!(fine.controllability < 0.08 && !fine.line().contains("too far"), "{fine:?}");
    }
}
