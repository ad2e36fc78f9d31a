//! A second opinion on an answer that carries no error estimate: quadratic triangles that certify their own error.

use super::reference::Reference;
use super::study::Placement;
use serde::Serialize;

/// Distance from which on the answer is not to be trusted.
const DOUBTFUL: f64 = 0.15;

/// How far the controllability measures may be from the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CrossCheck {
    /// Worst relative distance of the controllability measures from the limit of the triangles, with what that leaves open.
    pub controllability: f64,
    /// The paddle where it is.
    pub paddle: u32,
    /// Nodes of the quadratic triangles.
    pub nodes: usize,
}

/// The worst of the errors that a reference finds, of those that [count](Reference::counts); none where there is nothing to
/// compare.
pub fn cross_check(placement: &Placement, reference: &Reference) -> Option<CrossCheck> {
    let rest: Vec<_> = placement.paddles.iter().map(|p| p.rest()).collect();
    let errors = reference.errors(&rest).into_iter().zip(&placement.paddles).zip(reference.counts(&rest));
    let counted = errors.filter(|(_, counts)| *counts).map(|(error, _)| error);
    let (controllability, paddle) = counted.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(CrossCheck { controllability, paddle: paddle.index, nodes: reference.nodes })
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
            "cross-check: ‖J⁻¹n‖ up to {:.1} % off, judged by quadratic triangles on {} nodes (paddle {}){advice}",
            100.0 * self.controllability,
            self.nodes,
            self.paddle
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Integration, Resolution};
    use crate::model::TissueModel;
    use crate::placement::study::{PlacementOptions, place};
    use crate::scene::Scene;

    #[test]
    fn coarse_nodes_are_found_out_and_fine_ones_are_not_accused() {
        let check = |integration, spacing| {
            let mut scene = Scene::bundled("paper").unwrap();
            (scene.needle.depth, scene.needle.increments) = (0.001, 1);
            scene.discretization.method.integration = integration;
            scene.discretization.resolution = Resolution::Spacing(spacing);
            let model = TissueModel::new(&scene).unwrap();
            let placement = place(&model, &PlacementOptions::default()).unwrap();
            cross_check(&placement, &Reference::compute(&scene, 0.01).unwrap()).unwrap()
        };
        let (coarse, fine) = (check(Integration::Dni, 0.2), check(Integration::Gauss, 0.05));
        assert!(coarse.controllability > DOUBTFUL && coarse.line().contains("too far"), "{coarse:?}");
        assert!(fine.controllability < 0.08 && !fine.line().contains("too far"), "{fine:?}");
    }
}
