//! Hyperelastic laws: strain energy W, first Piola–Kirchhoff stress P = ∂W/∂F and tangent A = ∂P/∂F.
//!
//! All functions take the displacement gradient H = F − I instead of F: at small strain, forming F loses digits.
//! Laws written in the Green–Lagrange strain E = ½ (H + Hᵀ + HᵀH) give the second Piola–Kirchhoff stress
//! S = ∂W/∂E and the material tangent C = ∂S/∂E; then P = F S and A_iJkL = δ_ik S_JL + F_iM C_MJNL F_kN.
//! A scene file writes out its law, or names a [preset](Preset) of the literature.
//! A material may [relax](Relaxation): its law then gives the stress of a fast deformation.
//! In two dimensions the state is plane strain. Isotropic laws must be stable in space at rest also where they are used in
//! the plane: plane strain is a slice of a solid.
//!
//! A law is one file that implements [`Material`], and one line of the registry in [`law`].

mod barrier;
mod catalogue;
mod error;
mod fung;
mod fung_general;
mod kinematics;
mod lame;
pub mod law;
mod linear;
#[allow(clippy::module_inception)] // The trait that the folder is about.
mod material;
mod named;
mod neo_hookean;
mod preset;
mod relaxation;
mod saint_venant_kirchhoff;
mod section;
mod stress;

pub use error::MaterialError;
pub use fung_general::FungTensors;
pub use kinematics::{Matrix, Tensor4, determinant, green_lagrange};
pub use law::{Law, MaterialModel, MaterialSection};
pub use material::{Material, Response};
pub use named::NamedMaterial;
pub use preset::Preset;
pub use relaxation::Relaxation;
pub use section::{RelaxationSection, TensorEntry};
pub use stress::UnknownStress;
