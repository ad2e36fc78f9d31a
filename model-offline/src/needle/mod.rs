//! A rigid straight needle that punctures, cuts and slips.
//!
//! Until the force on the contact reaches `puncture_force` the needle pushes the contact, as a patch does. Then it is in:
//! tissue along the shaft may not leave the needle's line, slides along it when the friction per length reaches what holds
//! it, and the tip cuts when its force, spread over `tip_length` behind it, reaches `cutting_force` (a part of it while a part
//! of the tip is in).
//!
//! **Solved by elimination.** The tissue is a body in equilibrium under forces p along the shaft, one across the needle and
//! one along it at every station, and one at the tip: `d(p)`, by Newton's method. Its compliance `C = B K⁻¹ Bᵀ` at the
//! stations, with one factor for all, is the exact derivative of what the stations feel; a Newton step on p is then a
//! problem of complementarity with as many unknowns as the shaft has stations, solved exactly. Shape functions
//! at arbitrary points make the rows B, so that no node need lie on the shaft.
//!
//! **What the stations know.** A station is a material point: slip, friction and its state (sticks, slides) are its history.
//! A station that has just been passed slides. Friction does not depend on the force across the needle (Tresca's law):
//! `holding` until it slides, then `kinetic + viscous · speed`.
//!
//! **Small strains.** With a linear law everything is of first order: the shaft acts on the undeformed body down to the
//! depth of the tip, and forces superpose. Else the cut is a curve of material points that lie on the needle's line now, and
//! its length is what the tip has passed.
//!
//! In three dimensions a line force pulls infinitely far: forces would be spread over the needle's radius. Nothing else
//! here is planar but the type of its points.

mod advance;
mod complementarity;
mod course;
mod energy;
mod error;
mod insertion;
mod jacobian;
mod path;
mod reading;
mod springs;
mod state;
mod station;
mod trial;

pub use course::Course;
pub use error::NeedleError;
pub use insertion::{Inserted, Way, insert};
pub use reading::NeedleReading;
pub use state::{EnergyAccount, SlippingNeedle};
pub use station::StationState;
