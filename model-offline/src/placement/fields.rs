//! What a body at rest does to unit rates of paddle and needle and to unit loads on its target.

use crate::model::TissueModel;

/// Rates that are prescribed: paddle along x, along y, needle along its axis.
pub(super) const RATES: usize = 3;

/// Which loads are looked at besides the rates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Loads {
    /// None.
    None,
    /// Unit loads on the target: the adjoint of asking for its displacement.
    OnTarget,
}

impl Loads {
    /// Nodal forces of every load, one load after the other.
    pub(super) fn forces(self, model: &TissueModel) -> Vec<f64> {
        let count = if self == Self::OnTarget { 2 } else { 0 };
        let mut forces = vec![0.0; count * model.dofs()];
        for (axis, forces) in forces.chunks_exact_mut(model.dofs()).enumerate() {
            for (&i, value) in model.target_row().nodes.iter().zip(&model.target_row().values) {
                forces[2 * i as usize + axis] += value;
            }
        }
        forces
    }
}

/// Displacements of one body to unit rates, as nodal coefficients one after the other: paddle along x, paddle along y,
/// needle along its axis, and, where they were asked for, to unit loads on the target along x and y.
#[derive(Debug, Clone)]
pub(super) struct Fields {
    coefficients: Vec<f64>,
    unknowns: usize,
}

impl Fields {
    /// Room for the fields of a model.
    pub(super) fn new(model: &TissueModel, loads: Loads) -> Self {
        let columns = RATES + if loads == Loads::OnTarget { 2 } else { 0 };
        Self { coefficients: vec![0.0; columns * model.dofs()], unknowns: model.dofs() }
    }

    /// Field f in the order above.
    pub(super) fn field(&self, f: usize) -> &[f64] {
        &self.coefficients[f * self.unknowns..(f + 1) * self.unknowns]
    }

    /// All fields, to write.
    pub(super) fn all_mut(&mut self) -> &mut [f64] {
        &mut self.coefficients
    }

    /// Field f, to write.
    pub(super) fn field_mut(&mut self, f: usize) -> &mut [f64] {
        &mut self.coefficients[f * self.unknowns..(f + 1) * self.unknowns]
    }
}
