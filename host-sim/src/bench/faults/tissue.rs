//! Tissue that costs nothing: linear about the table's own path, so that millions of ticks take seconds.

use firmware::contract::Table;
use nalgebra::{SMatrix, SVector};

use crate::world::error::WorldError;
use crate::world::tissue::TissueResponse;

/// Target displacement y(z, u) = y_path(z) + Σ J(z)·(G·R·u − u_path(z)) + n·push over all paddles, exact on the path for G·R = 1.
#[derive(Clone, Copy, Debug)]
pub struct LinearTissue<'t, const D: usize = 2, const N: usize = 1, const P: usize = 1> {
    table: &'t Table<f64, D, N, P>,
    /// True over assumed response to the paddles, G.
    pub gain: f64,
    /// Which way it responds, R.
    pub turn: SMatrix<f64, D, D>,
    /// Displacement by something that nobody knows of, length.
    pub push: f64,
    /// Where that goes: components along the directions orthogonal to the needle, of norm 1; [`sideways`] unless somebody changes it.
    pub push_direction: SVector<f64, N>,
}

/// Components of the direction n of a push along the directions orthogonal to the needle: in space some of both.
pub fn sideways<const N: usize>() -> SVector<f64, N> {
    SVector::from_fn(|i, _| if N == 1 { 1.0 } else { [0.8, 0.6][i % 2] })
}

impl<'t, const D: usize, const N: usize, const P: usize> LinearTissue<'t, D, N, P> {
    /// Tissue as the table says.
    pub fn new(table: &'t Table<f64, D, N, P>) -> Self {
        Self { table, gain: 1.0, turn: SMatrix::identity(), push: 0.0, push_direction: sideways() }
    }

    /// The table that it follows.
    pub fn table(&self) -> &'t Table<f64, D, N, P> {
        self.table
    }

    /// Displacement of the target with the needle at `depth` and the paddles at `paddles`, lengths.
    pub fn target(&self, depth: f64, paddles: &[SVector<f64, D>]) -> SVector<f64, D> {
        let Some(at) = self.table.locate(depth) else {
            return SVector::zeros();
        };
        let (path, mut target) = (at.paddle_path(), at.target_displacement());
        for ((jacobian, path), paddle) in at.jacobian().iter().zip(path.column_iter()).zip(paddles) {
            target += jacobian * (self.turn * paddle * self.gain - path);
        }
        target + self.table.orthogonal * self.push_direction * self.push
    }

    /// What the controller is to keep at 0: the target's displacement along each direction orthogonal to the needle, length.
    pub fn error(&self, target: &SVector<f64, D>) -> SVector<f64, N> {
        SVector::from_fn(|i, _| self.table.orthogonal.column(i).dot(target))
    }
}

impl<const D: usize, const N: usize, const P: usize> TissueResponse<D> for LinearTissue<'_, D, N, P> {
    fn step(&mut self, depth: f64, paddles: &[SVector<f64, D>]) -> Result<SVector<f64, D>, WorldError> {
        Ok(self.target(depth, paddles))
    }
}
