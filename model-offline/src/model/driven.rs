//! Bodies of either dimension that needle and paddles move, seen as one.

use super::Body;
use super::space::SpaceBody;
use crate::discretization::Stencil;
use crate::geometry::Point;
use crate::solver::equilibrium::{Equilibrium, Failure};
use nalgebra::{Const, Dyn, OMatrix};

/// D rows, a column per control.
pub type PerControl<const D: usize> = OMatrix<f64, Const<D>, Dyn>;

/// A body in D dimensions that is moved by its controls: the needle's depth, then D displacements per attached paddle, lengths.
pub trait DrivenBody<const D: usize>: Clone + Send + Sync {
    /// Number of paddles attached.
    fn paddles(&self) -> usize;

    /// The equilibrium behind it.
    fn equilibrium(&self) -> &Equilibrium<D>;

    /// The equilibrium behind it, to change settings and to ask for responses.
    fn equilibrium_mut(&mut self) -> &mut Equilibrium<D>;

    /// The target's row `u(X_t) = Σ_I Ψ_I(X_t) d_I`.
    fn target_row(&self) -> &Stencil<D>;

    /// Finest distance of nodes, length.
    fn spacing(&self) -> f64;

    /// Prescribed values at these controls.
    fn prescribed(&self, controls: &[f64]) -> Vec<f64>;

    /// Takes the body to these controls along a straight path.
    ///
    /// # Errors
    /// [`Failure`]; the body is then at the last converged state.
    fn drive_to(&mut self, controls: &[f64]) -> Result<(), Failure>;

    /// Where its controls are.
    fn controls(&self) -> Vec<f64>;

    /// Target displacement.
    fn target(&self) -> Point<D> {
        self.target_row().interpolate(self.equilibrium().coefficients())
    }

    /// What the target is displaced by per control beside what its row says; none for most.
    fn beside_row(&self) -> Option<&PerControl<D>> {
        None
    }
}

/// Paddle displacements of controls.
fn paddles_of<const D: usize>(controls: &[f64]) -> impl Iterator<Item = Point<D>> {
    controls.get(1..).unwrap_or_default().chunks_exact(D).map(Point::from_column_slice)
}

/// Depth and paddle displacements as controls.
pub(crate) fn controls_of<const D: usize>(depth: f64, paddles: &[Point<D>]) -> Vec<f64> {
    std::iter::once(depth).chain(paddles.iter().flat_map(|p| p.iter().copied())).collect()
}

impl DrivenBody<2> for Body<'_> {
    fn paddles(&self) -> usize {
        usize::from(self.attached.is_some())
    }

    fn equilibrium(&self) -> &Equilibrium<2> {
        &self.equilibrium
    }

    fn equilibrium_mut(&mut self) -> &mut Equilibrium<2> {
        &mut self.equilibrium
    }

    fn target_row(&self) -> &Stencil<2> {
        &self.model.target
    }

    fn spacing(&self) -> f64 {
        self.model.spacing
    }

    fn prescribed(&self, controls: &[f64]) -> Vec<f64> {
        self.model.prescribed_values(self.attached, controls[0], paddles_of(controls).next().unwrap_or_default())
    }

    fn drive_to(&mut self, controls: &[f64]) -> Result<(), Failure> {
        self.drive(controls[0], paddles_of(controls).next().unwrap_or_default())
    }

    fn controls(&self) -> Vec<f64> {
        controls_of(self.depth(), &[self.paddle()][..self.paddles()])
    }
}

impl DrivenBody<3> for SpaceBody<'_> {
    fn paddles(&self) -> usize {
        SpaceBody::paddles(self).len()
    }

    fn equilibrium(&self) -> &Equilibrium<3> {
        SpaceBody::equilibrium(self)
    }

    fn equilibrium_mut(&mut self) -> &mut Equilibrium<3> {
        SpaceBody::equilibrium_mut(self)
    }

    fn target_row(&self) -> &Stencil<3> {
        self.model().target_row()
    }

    fn spacing(&self) -> f64 {
        self.model().spacing()
    }

    fn prescribed(&self, controls: &[f64]) -> Vec<f64> {
        self.prescribed_values(controls[0], &paddles_of(controls).collect::<Vec<_>>())
    }

    fn drive_to(&mut self, controls: &[f64]) -> Result<(), Failure> {
        self.drive(controls[0], &paddles_of(controls).collect::<Vec<_>>())
    }

    fn controls(&self) -> Vec<f64> {
        controls_of(self.depth(), SpaceBody::paddles(self))
    }

    fn target(&self) -> Point<3> {
        self.target_displacement()
    }

    fn beside_row(&self) -> Option<&PerControl<3>> {
        self.beside()
    }
}
