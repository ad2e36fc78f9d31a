//! How much more the target may answer than a table believes, when the tissue is another one of the scene's.

use crate::model::TissueModel;
use crate::solver::equilibrium::{Failure, NewtonSettings};
use firmware::contract::Knot;

/// Bounds are rounded up to this: a gain does not depend on digits that the model does not have.
const STEP: f64 = 0.05;

/// Largest |λ| of J·Ĵ⁻¹ over the knots' depths, with J of the body without its inclusions and Ĵ of the table, rounded up; 1
/// where the scene has no other tissue. An insertion that stops early bounds the depths that it reached.
///
/// # Errors
/// [`Failure`] when the other body at rest cannot be solved.
pub(super) fn largest_amplification(
    model: &TissueModel,
    position: usize,
    knots: &[Knot<f64, 2>],
) -> Result<f64, Failure> {
    if model.scene().inclusions.is_empty() {
        return Ok(1.0);
    }
    let other = model.with_tissue_of(&model.scene().without_inclusions());
    let mut body = other.body(Some(position), NewtonSettings::default())?;
    let mut largest = 1.0_f64;
    for knot in knots {
        let Ok(jacobian) = body.drive(knot.depth, knot.paddle_path).and_then(|()| body.actuation_jacobian()) else {
            break;
        };
        let Some(believed) = knot.jacobian[0].try_inverse() else { break };
        let values = (jacobian * believed).complex_eigenvalues();
        largest = values.iter().fold(largest, |m, value| m.max(value.norm()));
    }
    Ok((largest / STEP).ceil() * STEP)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::table::{TableOptions, build};

    #[test]
    fn a_stiffer_inclusion_mistaken_lowers_the_gain_and_the_papers_stays() {
        let table = |stiffness: f64| {
            let mut scene = Scene::bundled("paper").unwrap();
            scene.inclusions[0].stiffness = stiffness;
            build(&TissueModel::new(&scene).unwrap(), 1, &TableOptions::default()).unwrap()
        };
        let (paper, soft) = (table(100.0), table(0.01));
        println!("paper {}, soft {}", paper.gains.lambda_max, soft.gains.lambda_max);
        assert_eq!(paper.gains.lambda_max, TableOptions::default().lambda_max);
        assert!(soft.gains.lambda_max >= paper.gains.lambda_max);
        assert!(soft.gains.loop_gain <= paper.gains.loop_gain);
    }

    #[test]
    fn without_another_tissue_nothing_is_amplified() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap().without_inclusions()).unwrap();
        let table = build(&model, 3, &TableOptions { knots: 2, ..TableOptions::default() }).unwrap();
        assert_eq!(largest_amplification(&model, 2, &table.knots).unwrap(), 1.0);
    }
}
