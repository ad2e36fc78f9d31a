//! Paddles attached one after the other to a body in the plane that is factorised once, without any.
//!
//! The body holds without a paddle, so that attaching one is dense work on its own rows Λ: forces λ on them with
//! `C λ = g − Λ u°` give them the displacements g, where C = Λ K⁻¹ Λᵀ and u° is what the body does without the paddle. The
//! fields are then `u° + K⁻¹ Λᵀ λ`, all of a paddle through the factor together.

use super::condensed::{CondensedBody, singular};
use super::fields::{Fields, Loads, RATES};
use crate::discretization::Stencil;
use crate::linalg::DenseCholesky;
use crate::mechanics::ConstrainedRows;
use crate::model::{Condensing, ModelError, TissueModel};
use faer::Mat;
use nalgebra::Vector2;
use std::ops::Range;

/// What the paddles' nodes may be off their places per unit rate, before the forces on them are corrected.
const ENOUGH: f64 = 1e-11;
/// The same for what is always held.
const HELD_WITHIN: f64 = 1e-12;
/// Corrections of the forces at most; each gains the digits that the factor holds.
const MAX_CORRECTIONS: usize = 4;

/// Displacements of the nodes alone under forces on them, so many unknowns per field; see [`CondensedBody::fields`].
fn nodal_fields(body: &mut CondensedBody<2>, forces: &[f64], values: &[f64], unknowns: usize) -> Vec<f64> {
    let with_ports = body.unknowns();
    if with_ports == unknowns {
        return body.fields(forces, values, HELD_WITHIN);
    }
    let mut padded = Vec::with_capacity(forces.len() / unknowns * with_ports);
    for field in forces.chunks_exact(unknowns) {
        padded.extend_from_slice(field);
        padded.resize(padded.len() + with_ports - unknowns, 0.0);
    }
    let fields = body.fields(&padded, values, HELD_WITHIN);
    fields.chunks_exact(with_ports).flat_map(|field| &field[..unknowns]).copied().collect()
}

/// A body at rest to which paddles are attached.
#[derive(Debug)]
pub(super) struct Attaching<'m> {
    model: &'m TissueModel,
    body: CondensedBody<2>,
    paddles: &'m [Vec<Stencil<2>>],
    /// Compliance between the rows of all paddles, paddle after paddle, and of the target, which come last; two each.
    compliance: Mat<f64>,
    /// Fields without a paddle: the needle's rate, then the loads.
    unattached: Vec<f64>,
}

impl<'m> Attaching<'m> {
    /// Factorises the body without paddles; none where its [rows](TissueModel::attachable_rows) are not attachable, or where it
    /// does not hold without paddles.
    ///
    /// # Errors
    /// [`ModelError`] when there is no memory for the factor.
    pub(super) fn new(model: &'m TissueModel, loads: Loads) -> Result<Option<Self>, ModelError> {
        let rows = model.attachable_rows().zip(model.constrained_rows(None));
        let Some(((paddles, held), condensing)) = rows.zip(model.condensing_analysis()) else { return Ok(None) };
        let Condensing { analysis, retained, ports } = condensing;
        let sampled = (&**model.rule(), model.tissue());
        let mut body = match CondensedBody::new(sampled, analysis, (*retained, ports.as_ref()), held) {
            Ok(body) => body,
            Err(error) if error.is_too_large() => return Err(error),
            Err(_) => return Ok(None),
        };
        let mut forces = vec![0.0; model.dofs()];
        forces.extend(loads.forces(model));
        let mut values = model.prescribed_values(None, 1.0, Vector2::zeros());
        values.resize(values.len() * forces.len() / model.dofs(), 0.0);
        let unattached = nodal_fields(&mut body, &forces, &values, model.dofs());
        let compliance = body.compliance(paddles.iter().flatten().chain([model.target_row()]));
        Ok(Some(Self { model, body, paddles, compliance, unattached }))
    }

    /// Rows of a paddle in the compliance.
    fn rows(&self, paddle: usize) -> Range<usize> {
        let before = 2 * self.paddles[..paddle].iter().map(Vec::len).sum::<usize>();
        before..before + 2 * self.paddles[paddle].len()
    }

    fn columns(&self) -> usize {
        2 + self.unattached.len() / self.model.dofs()
    }

    /// Field `c` without the paddle: nothing for its own rates.
    fn before(&self, c: usize) -> Option<&[f64]> {
        let unknowns = self.model.dofs();
        c.checked_sub(2).map(|f| &self.unattached[f * unknowns..(f + 1) * unknowns])
    }

    /// Cholesky factor of a paddle's compliance.
    fn factor(&self, rows: &Range<usize>) -> Result<DenseCholesky, ModelError> {
        let own = self.compliance.submatrix(rows.start, rows.start, rows.len(), rows.len());
        DenseCholesky::new(own.to_owned())
            .map_err(|_| singular("the compliance of the paddle is not positive definite").into())
    }

    /// What the paddle's nodes have to move beyond `fields`, if anything: a column per field.
    fn missing<'f>(&self, paddle: usize, field: impl Fn(usize) -> Option<&'f [f64]>) -> Mat<f64> {
        let rows = &self.paddles[paddle];
        let mut missing = Mat::zeros(2 * rows.len(), self.columns());
        for c in 0..self.columns() {
            for (r, row) in rows.iter().enumerate() {
                let at = field(c).map_or(Vector2::zeros(), |field| row.interpolate(field));
                for axis in 0..2 {
                    missing[(2 * r + axis, c)] = f64::from(u8::from(c == axis)) - at[axis];
                }
            }
        }
        missing
    }

    /// What the target does per unit of every rate with a paddle attached.
    ///
    /// # Errors
    /// [`ModelError`] when the paddle's compliance is singular.
    pub(super) fn target(&self, paddle: usize) -> Result<[Vector2<f64>; RATES], ModelError> {
        let rows = self.rows(paddle);
        let mut forces = self.missing(paddle, |c| self.before(c));
        self.factor(&rows)?.solve(forces.as_mut());
        let target = self.compliance.nrows() - 2;
        Ok(std::array::from_fn(|c| {
            let moved = |axis: usize| -> f64 {
                rows.clone().map(|r| self.compliance[(r, target + axis)] * forces[(r - rows.start, c)]).sum()
            };
            let before = self.before(c).map_or(Vector2::zeros(), |field| self.model.target_row().interpolate(field));
            before + Vector2::new(moved(0), moved(1))
        }))
    }

    /// The fields with a paddle attached.
    ///
    /// # Errors
    /// [`ModelError`] when the paddle's compliance is singular.
    pub(super) fn fields(&mut self, paddle: usize, fields: &mut Fields) -> Result<(), ModelError> {
        let unknowns = self.model.dofs();
        let factor = self.factor(&self.rows(paddle))?;
        let rows = ConstrainedRows::new(self.paddles[paddle].iter());
        let still = vec![0.0; self.model.prescribed_values(None, 0.0, Vector2::zeros()).len() * self.columns()];
        for c in 0..self.columns() {
            match self.before(c) {
                Some(before) => fields.field_mut(c).copy_from_slice(before),
                None => fields.field_mut(c).fill(0.0),
            }
        }
        for _ in 0..MAX_CORRECTIONS {
            let mut forces = self.missing(paddle, |c| Some(fields.field(c)));
            if forces.norm_max() <= ENOUGH {
                break;
            }
            factor.solve(forces.as_mut());
            let mut right = vec![0.0; self.columns() * unknowns];
            for (c, right) in right.chunks_exact_mut(unknowns).enumerate() {
                let column: Vec<f64> = (0..forces.nrows()).map(|r| forces[(r, c)]).collect();
                rows.add_transpose::<2>(&column, right);
            }
            let more = nodal_fields(&mut self.body, &right, &still, unknowns);
            for (c, more) in more.chunks_exact(unknowns).enumerate() {
                fields.field_mut(c).iter_mut().zip(more).for_each(|(x, d)| *x += d);
            }
        }
        Ok(())
    }
}
