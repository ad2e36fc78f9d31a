//! Tissue that costs nothing: linear about the table's own path, so that millions of ticks take seconds.

use firmware::contract::Table;
use nalgebra::{Matrix2, Vector2};

use crate::world::error::WorldError;
use crate::world::tissue::TissueResponse;

/// Target displacement y(z, u) = y_path(z) + J(z)·(G·R·u − u_path(z)) + n·push, exact on the path for G·R = 1.
#[derive(Clone, Copy, Debug)]
pub struct LinearTissue<'t> {
    table: &'t Table<f64, 2>,
    /// True over assumed response to the paddle, G.
    pub gain: f64,
    /// Which way it responds, R.
    pub turn: Matrix2<f64>,
    /// Displacement by something that nobody knows of, length.
    pub push: f64,
}

impl<'t> LinearTissue<'t> {
    /// Tissue as the table says.
    pub fn new(table: &'t Table<f64, 2>) -> Self {
        Self { table, gain: 1.0, turn: Matrix2::identity(), push: 0.0 }
    }

    /// The table that it follows.
    pub fn table(&self) -> &'t Table<f64, 2> {
        self.table
    }

    /// Displacement of the target with the needle at `depth` and the paddle at `paddle`, lengths.
    pub fn target(&self, depth: f64, paddle: &Vector2<f64>) -> Vector2<f64> {
        let Some(at) = self.table.locate(depth) else {
            return Vector2::zeros();
        };
        at.target_displacement()
            + at.jacobian()[0] * (self.turn * paddle * self.gain - at.paddle_path())
            + self.table.orthogonal * self.push
    }

    /// What the controller is to keep at 0, length.
    pub fn error(&self, target: &Vector2<f64>) -> f64 {
        self.table.orthogonal.dot(target)
    }
}

impl TissueResponse for LinearTissue<'_> {
    fn step(&mut self, depth: f64, paddles: &[Vector2<f64>]) -> Result<Vector2<f64>, WorldError> {
        Ok(self.target(depth, &paddles.first().copied().unwrap_or_default()))
    }
}
