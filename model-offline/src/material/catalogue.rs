//! What the catalogue of laws knows about each besides its response.

use super::error::MaterialError;
use super::lame::LameParameters;
use super::section::MaterialSection;

/// A law that scene files can name.
pub(super) trait Catalogued: Sized {
    /// Whether a section that names the model means this law: where one name stands for several.
    fn reads<M>(_: &MaterialSection<M>) -> bool {
        true
    }

    /// The law from its moduli.
    fn read<M>(section: &MaterialSection<M>) -> Result<Self, MaterialError>;

    /// Whether stress is proportional to the displacement gradient, so that one tangent serves every state.
    fn is_linear(&self) -> bool {
        false
    }

    /// Whether equilibria at finite depth have a limit when the nodes are refined. Laws that soften in compression
    /// without end have none under a needle's edge.
    fn has_mesh_limit(&self) -> bool {
        false
    }

    /// Moduli of linear elasticity with the same tangent at rest; none where that is not isotropic.
    fn linearised(&self) -> Option<LameParameters>;

    /// The law with another factor on its exponential term; none where it has no such term.
    fn with_exponential_factor(&self, _: f64) -> Option<Result<Self, MaterialError>> {
        None
    }

    /// The law with another Poisson ratio and the same shear modulus; none where it is not given by λ and μ.
    fn with_poisson_ratio(&self, _: f64) -> Option<Result<Self, MaterialError>> {
        None
    }
}
