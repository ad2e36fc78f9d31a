//! A needle that slips: the shaft, and what the tissue resists it with.

use crate::choice::choice;
use crate::geometry::Point2;
use serde::Serialize;

choice! {
    /// How a needle meets the tissue.
    #[derive(Default)]
    pub enum Mechanics {
        /// The tissue of the contact moves with the needle and never slips.
        #[default]
        Patch,
        /// A rigid straight needle that punctures, cuts and slips.
        Shaft,
    }
}

/// What tissue resists a needle with; in the plane, forces are per unit thickness.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Resistance {
    /// Force at which the tip cuts.
    pub cutting_force: f64,
    /// Friction per length of shaft up to which tissue sticks to it.
    pub static_friction: f64,
    /// Friction per length of shaft that slides infinitely slowly.
    pub kinetic_friction: f64,
    /// What a sliding shaft adds per length and speed.
    pub viscous_friction: f64,
}

impl Resistance {
    /// Friction per length of a shaft that slides at this speed.
    pub fn sliding(&self, speed: f64) -> f64 {
        self.kinetic_friction + self.viscous_friction * speed
    }

    /// Friction per length that a shaft which sticks must overcome: never less than what follows.
    pub fn holding(&self, speed: f64) -> f64 {
        self.static_friction.max(self.sliding(speed))
    }
}

/// A rigid straight needle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Shaft {
    /// Where it enters the body.
    pub entry: Point2,
    /// Radius, length. In the plane the needle is a line, and the radius is told and not used.
    pub radius: f64,
    /// Length behind the tip that the cutting force is spread over.
    pub tip_length: f64,
    /// Force on the contact at which the skin is punctured; infinite: never.
    pub puncture_force: f64,
    /// Speed that friction is taken at, length per second.
    pub speed: f64,
    /// Resistance of the body.
    pub resistance: Resistance,
}
