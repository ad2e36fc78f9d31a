//! What a paddle does to the target while the needle is in.

use super::error::NeedleError;
use super::state::SlippingNeedle;
use super::station::{Slide, Station};
use crate::geometry::Point2;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

/// A displacement that is held: the mean of points along a direction.
struct Held<'c> {
    along: Point2,
    /// Which of the points' responses is that to a force along it.
    response: usize,
    points: Vec<(&'c Station, f64)>,
}

impl SlippingNeedle<'_> {
    /// Actuation Jacobian d(target displacement)/d(paddle displacement) with the needle as it is: stations that stick are
    /// held, those that slide go on sliding; a tip that holds is held, one that cuts goes on
    /// cutting with the same force.
    ///
    /// # Errors
    /// [`NeedleError`].
    pub fn actuation_jacobian(&mut self) -> Result<Matrix2<f64>, NeedleError> {
        let depth = self.pose.depth;
        let failed = |source| NeedleError::Equilibrium { depth, source };
        let mut contacts: Vec<Station> = self.holding().0.into_iter().cloned().collect();
        self.respond(&mut contacts, true).map_err(failed)?;
        let (axis, normal) = (self.axis(), self.normal());
        // What is held: points on the line, points that stick, and a tip that holds, as its force is spread.
        let mut rows: Vec<Held<'_>> = Vec::new();
        for contact in &contacts {
            if !self.is_beside_the_skin(contact) {
                rows.push(Held { along: normal, response: 0, points: vec![(contact, 1.0)] });
            }
            if contact.slide == Slide::Sticks {
                rows.push(Held { along: axis, response: 1, points: vec![(contact, 1.0)] });
            }
        }
        if self.tip_holds {
            let spread = self.holding().1;
            let points = contacts.iter().zip(spread).filter(|(_, share)| *share > 0.0).collect();
            rows.push(Held { along: axis, response: 1, points });
        }
        let felt = |response: &[f64]| {
            let values = rows.iter().map(|Held { along, points, .. }| -> f64 {
                points.iter().map(|(at, share)| share * along.dot(&at.stencil.interpolate(response))).sum()
            });
            DVector::from_iterator(rows.len(), values)
        };
        let responses: Vec<Vec<f64>> = rows
            .iter()
            .map(|Held { response: which, points, .. }| {
                let mut response = vec![0.0; self.model.dofs()];
                for (at, share) in points {
                    let own = at.responses.iter().flat_map(|both| both[*which].iter());
                    response.iter_mut().zip(own).for_each(|(sum, value)| *sum += share * value);
                }
                response
            })
            .collect();
        let mut compliance = DMatrix::zeros(rows.len(), rows.len());
        for (column, response) in responses.iter().enumerate() {
            compliance.set_column(column, &felt(response));
        }
        let largest = if rows.is_empty() { 0.0 } else { compliance.diagonal().amax() };
        (0..rows.len()).for_each(|i| compliance[(i, i)] += 1e-13 * largest);
        let target = self.model.target_row();
        let mut jacobian = Matrix2::zeros();
        for axis in 0..2 {
            let [immobile, moved] = self.rows;
            let by: Vector2<f64> = Vector2::ith(axis, 1.0);
            let rates: Vec<f64> = std::iter::repeat_n([0.0; 2], immobile)
                .chain(std::iter::repeat_n([by.x, by.y], moved))
                .flatten()
                .collect();
            let free = self.equilibrium.sensitivities(&rates).map_err(failed)?;
            let mut moved = target.interpolate(&free);
            if rows.is_empty() {
                // The needle holds nothing yet.
                jacobian.set_column(axis, &moved);
                continue;
            }
            let held = compliance.clone().lu().solve(&-felt(&free)).ok_or(NeedleError::NoForces { depth })?;
            for (response, force) in responses.iter().zip(held.iter()) {
                moved += target.interpolate(response) * *force;
            }
            jacobian.set_column(axis, &moved);
        }
        Ok(jacobian)
    }
}
