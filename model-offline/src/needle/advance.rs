//! One increment: the tip holds, cuts or is withdrawn.

use super::complementarity::Bounds;
use super::error::NeedleError;
use super::state::SlippingNeedle;
use super::trial::{Tip, Trial};
use crate::geometry::Point2;
use nalgebra::Vector2;

/// Positions of the tip that are tried.
const ROUNDS: usize = 40;

impl SlippingNeedle<'_> {
    /// Takes the tip to `depth` and the paddle to its displacement, in one increment.
    ///
    /// # Errors
    /// [`NeedleError`]; the needle is then where it was.
    pub fn advance(&mut self, depth: f64, paddle: Vector2<f64>) -> Result<(), NeedleError> {
        let before = self.clone();
        let outcome = self.increment(depth, paddle);
        if outcome.is_err() {
            *self = before;
        }
        outcome
    }

    fn increment(&mut self, depth: f64, paddle: Vector2<f64>) -> Result<(), NeedleError> {
        self.paddle = paddle;
        let ahead = self.ahead();
        let (engaged, trial) = self.tip_finds_its_place(depth, ahead)?;
        self.commit(depth, engaged, trial);
        Ok(())
    }

    /// The direction in the undeformed body that the needle's line has ahead of the tip.
    fn ahead(&self) -> Point2 {
        let (axis, normal) = (self.axis(), self.normal());
        if self.is_small_strain() {
            return axis;
        }
        let coefficients = self.equilibrium.coefficients();
        let off = |x: Point2| normal.dot(&(x + self.model.displacement_at(&x, coefficients) - self.shaft.entry));
        let (end, step) = (self.path.at(self.path.length(), axis), self.model.spacing());
        let on_axis = end + axis * step;
        let on_line = on_axis - normal * (off(on_axis) - off(end));
        (on_line - end).normalize()
    }

    /// The three things that a tip does: it holds, it cuts, or it is withdrawn.
    fn tip_finds_its_place(&mut self, depth: f64, ahead: Point2) -> Result<(f64, Trial), NeedleError> {
        let cut = self.path.length();
        if self.engaged < cut {
            let (engaged, trial) = self.tip_at(depth, ahead, 0.0)?;
            if engaged < cut {
                return Ok((engaged, trial));
            }
        }
        let cutting_force = self.model.scene().resistance_at(self.path.at(cut, ahead), &self.shaft).cutting_force;
        let held = self.cutting_force(cutting_force, cut);
        let trial = self.trial(depth, ahead, Tip { engaged: cut, bounds: Bounds { lower: 0.0, upper: held } })?;
        if trial.tip_force >= held {
            self.tip_at(depth, ahead, cutting_force)
        } else if trial.tip_force <= 0.0 {
            self.tip_at(depth, ahead, 0.0)
        } else {
            Ok((cut, trial))
        }
    }

    /// The part of a cutting force that the part of the tip takes which is in.
    fn cutting_force(&self, whole: f64, engaged: f64) -> f64 {
        whole * (engaged / self.shaft.tip_length).min(1.0)
    }

    /// Where the tip is at this depth, under a force that is known: the root of where the tissue at an arc length is, by
    /// secants that begin with a body that does not move.
    fn tip_at(&mut self, depth: f64, ahead: Point2, force: f64) -> Result<(f64, Trial), NeedleError> {
        if self.is_small_strain() {
            let engaged = depth.max(0.0);
            let bounds = Bounds::exactly(self.cutting_force(force, engaged));
            return Ok((engaged, self.trial(depth, ahead, Tip { engaged, bounds })?));
        }
        let enough = 1e-6 * self.model.spacing();
        let mut engaged = (self.engaged + depth - self.depth).max(0.0);
        let mut last: Option<(f64, f64)> = None;
        // Between these the root lies: the tissue jumps a little where a station is passed, maybe over it.
        let (mut behind, mut beyond) = (0.0, f64::INFINITY);
        for _ in 0..ROUNDS {
            let bounds = Bounds::exactly(self.cutting_force(force, engaged));
            let trial = self.trial(depth, ahead, Tip { engaged, bounds })?;
            let off = engaged + trial.tip_displacement - depth;
            if off > 0.0 {
                beyond = f64::min(beyond, engaged);
            } else {
                behind = f64::max(behind, engaged);
            }
            if off.abs() <= enough || beyond - behind <= enough {
                return Ok((engaged, trial));
            }
            let slope = last.map_or(1.0, |(there, then)| ((off - then) / (engaged - there)).clamp(0.2, 5.0));
            last = Some((engaged, off));
            let next = engaged - off / slope;
            let inside = behind < next && next < beyond;
            engaged = if inside { next } else { 0.5 * (behind + beyond) };
        }
        Err(NeedleError::NoForces { depth })
    }

    /// Makes a trial the state of the needle.
    fn commit(&mut self, depth: f64, engaged: f64, trial: Trial) {
        let Trial { mut contacts, tip_force, tip_displacement } = trial;
        let base = self.base_force();
        self.energy.friction += self.dissipated(&contacts, depth);
        self.energy.cutting += tip_force * self.tip_passed(&contacts, depth, engaged);
        self.engaged = engaged;
        for contact in &contacts {
            self.path.cut_to(contact.arc_length, contact.at);
        }
        // What the tip has passed is what the tissue there has not gone along with.
        self.cut = if self.is_small_strain() { self.cut.max(depth - tip_displacement) } else { self.path.length() };
        let axis = self.axis();
        for contact in &mut contacts {
            contact.axial = axis.dot(&contact.stencil.interpolate(self.equilibrium.coefficients()));
            contact.known = true;
        }
        let tip = contacts.pop();
        for station in &mut self.stations {
            match contacts.iter().find(|contact| contact.arc_length == station.arc_length) {
                Some(contact) => *station = contact.clone(),
                // Not reached yet, left by the tip, or so near to it that the tip stands in for it: what comes next slides.
                None => (station.known, station.across, station.along) = (false, 0.0, 0.0),
            }
        }
        (self.tip, self.tip_force) = (tip, tip_force);
        self.energy.work += 0.5 * (base + self.base_force()) * (depth - self.depth);
        self.depth = depth;
        self.last.copy_from_slice(self.equilibrium.coefficients());
        self.energy.stored = self.equilibrium.energy() + self.load_work();
    }
}
