//! Why numbers do not make a law.

use super::stress::UnknownStress;

/// Why moduli do not make a law.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// Not a finite number.
    #[error("{0} is not a finite number")]
    NotFinite(&'static str),
    /// The law is unstable at rest.
    #[error("the law is not stable at rest: its small-strain tangent has eigenvalue {0:.3e}")]
    Unstable(f64),
    /// The law resists one strain so much more than another that the smaller resistance drowns in the rounding of the larger.
    #[error(
        "the law resists one strain more than 10¹² times as much as another: numbers of sixteen digits cannot tell whether it is stable at rest"
    )]
    TooFarApart,
    /// A modulus is negative where none may be.
    #[error("{0} must not be negative")]
    Negative(&'static str),
    /// Neither a law nor a preset is named.
    #[error("neither model nor preset is given")]
    NoLaw,
    /// A preset where the unit of stress is not known.
    #[error(transparent)]
    UnknownStress(UnknownStress),
    /// A modulus that the law needs is not given.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// A modulus is given that the law does not know.
    #[error("{0} has no meaning for this law")]
    Meaningless(&'static str),
    /// A number that must be positive is not.
    #[error("{0} must be positive")]
    NotPositive(&'static str),
    /// Relaxation that leaves no stress in the end.
    #[error("the shares g of the relaxation sum to {0}: nothing would hold in the end")]
    Fluid(f64),
    /// Shares and times of a relaxation that do not pair.
    #[error("the relaxation has {0} shares g and {1} times tau")]
    Unpaired(usize, usize),
    /// A tensor index beyond the dimension.
    #[error("tensor entry [{0}, {1}, {2}, {3}] has an index beyond 1 (indices count from 0)")]
    Index(u32, u32, u32, u32),
    /// The general form holds for the plane only.
    #[error("the general (A, C) form is planar")]
    PlanarOnly,
}

impl MaterialError {
    /// What to do about it.
    pub fn help(&self) -> &'static str {
        match self {
            Self::NoLaw => {
                "give preset = \"liver\" or another (`model-offline materials` lists them), or a model with its moduli"
            }
            Self::UnknownStress(_) => {
                "name the unit of stress in [scene] units, or write out the numbers (`model-offline materials --json` has them)"
            }
            Self::TooFarApart => {
                "bring its moduli closer together; a lambda of 1000 times mu is Poisson's ratio 0.4995, as incompressible as tissue is known to be"
            }
            Self::Missing(_) => "give every modulus of the law",
            Self::Meaningless(_) => "remove it, or choose another model",
            Self::NotPositive(_) | Self::Fluid(_) | Self::Unpaired(..) => {
                "give as many shares as times, all positive, the shares' sum below 1: e.g. g = [0.3, 0.2], tau = [3.2, 42.0]"
            }
            _ => "the law must be stable at rest: moduli finite, mu > 0, lambda + 2 mu / 3 > 0",
        }
    }
}

pub(super) fn finite(value: f64, name: &'static str) -> Result<f64, MaterialError> {
    if value.is_finite() { Ok(value) } else { Err(MaterialError::NotFinite(name)) }
}

pub(super) fn not_negative(value: f64, name: &'static str) -> Result<f64, MaterialError> {
    if finite(value, name)? < 0.0 { Err(MaterialError::Negative(name)) } else { Ok(value) }
}
