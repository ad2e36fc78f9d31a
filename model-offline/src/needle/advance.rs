//! One increment: the tip holds, cuts or is withdrawn.

use super::complementarity::Bounds;
use super::error::NeedleError;
use super::state::{EnergyAccount, SlippingNeedle};
use super::trial::{Tip, Trial};
use crate::geometry::Point2;
use crate::model::Pose;
use nalgebra::Vector2;

/// Positions of the tip that are tried.
const ROUNDS: usize = 40;
/// Pieces that one advance is divided into, and the shortest, over the whole.
const MOST_PARTS: usize = 200;
const SHORTEST_PART: f64 = 1.0 / 64.0;
/// Distance, over the spacing, that the tissue may jump where the tip passes a station.
const JUMP: f64 = 0.05;

impl SlippingNeedle<'_> {
    /// Takes the tip to `depth` and the paddle to its displacement: in one increment, or in several where the tip comes
    /// into other tissue on the way, or where one finds no equilibrium.
    ///
    /// # Errors
    /// [`NeedleError`]; the needle is then where it was.
    pub fn advance(&mut self, depth: f64, paddle: Vector2<f64>) -> Result<(), NeedleError> {
        self.take_in(Pose { depth, paddle, ..self.pose }, 0.0)
    }

    /// Takes everything that moves tissue to a pose in so many seconds, in which tissue that relaxes does.
    ///
    /// # Errors
    /// [`NeedleError`]; the needle is then where it was.
    pub fn take_in(&mut self, pose: Pose, seconds: f64) -> Result<(), NeedleError> {
        let before = self.clone();
        let outcome = self.by_parts(pose, seconds);
        if outcome.is_err() {
            *self = before;
        }
        outcome
    }

    fn by_parts(&mut self, to: Pose, seconds: f64) -> Result<(), NeedleError> {
        let from = self.pose;
        let (mut done, mut goal, mut parts) = (0.0, 1.0, 0);
        loop {
            let before = self.clone();
            let pose = from.towards(&to, goal);
            let outcome = self.increment(pose, seconds * (goal - done));
            parts += 1;
            let shorter = match &outcome {
                Ok(None) => {
                    if goal >= 1.0 {
                        return Ok(());
                    }
                    (done, goal) = (goal, f64::min(1.0, goal + 2.0 * (goal - done)));
                    continue;
                }
                Ok(Some(share)) => *share,
                Err(_) => 0.5,
            };
            *self = before;
            if parts >= MOST_PARTS || outcome.is_err() && goal - done < SHORTEST_PART {
                if !self.is_sprung && !self.is_small_strain() {
                    // From here on with springs.
                    (self.is_sprung, goal, parts) = (true, 1.0, 0);
                    continue;
                }
                return outcome.and(Err(NeedleError::NoForces { depth: pose.depth }));
            }
            goal = done + (goal - done) * shorter;
        }
    }

    /// One increment; the share of it that may be taken at once, where the tip would come into other tissue.
    fn increment(&mut self, pose: Pose, seconds: f64) -> Result<Option<f64>, NeedleError> {
        let depth = pose.depth;
        let before = self.pose;
        self.equilibrium.begin(seconds);
        // The depth follows when the increment has been found: what slides is counted from it.
        self.pose = Pose { depth: before.depth, ..pose };
        let ahead = self.ahead();
        let cut = self.path.length();
        let (engaged, trial) = self.tip_finds_its_place(depth, ahead)?;
        if let Some(edge) = self.other_tissue(cut, engaged, ahead) {
            return Ok(Some((edge - cut) / (engaged - cut)));
        }
        self.commit(depth, before, engaged, trial)?;
        self.equilibrium.remember();
        Ok(None)
    }

    /// How far ahead of the tip its tissue is asked for.
    fn probe(&self) -> f64 {
        1e-3 * self.model.spacing()
    }

    /// The arc length between these at which other tissue begins, where one increment must end: the first, found by
    /// bisection between points that are closer than any inclusion is wide.
    fn other_tissue(&self, from: f64, to: f64, ahead: Point2) -> Option<f64> {
        let scene = self.model.scene();
        let tissue = |arc_length: f64| scene.resistance_at(self.path.at(arc_length, ahead), &self.shaft).cutting_force;
        let first = from + self.probe();
        if to <= first + self.probe() {
            return None;
        }
        let pieces = ((to - first) / (0.1 * self.model.spacing())).ceil().clamp(1.0, 1000.0) as usize;
        let at = |k: usize| first + (to - first) * k as f64 / pieces as f64;
        let here = tissue(first);
        let other = (1..=pieces).find(|k| tissue(at(*k)) != here)?;
        let (mut low, mut high) = (at(other - 1), at(other));
        while high - low > 0.1 * self.probe() {
            let middle = 0.5 * (low + high);
            if tissue(middle) == here { low = middle } else { high = middle }
        }
        // So near to the edge that what is asked for next is beyond it.
        (to > high + self.probe()).then_some(high - 0.5 * self.probe())
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
        if depth <= 0.0 && cut <= 0.0 {
            // It has not set out: it leads the point of the skin that it touches, and cuts nothing that comes to meet it.
            self.tip_holds = false;
            return Ok((0.0, self.trial(depth, ahead, Tip { engaged: 0.0, bounds: Bounds::exactly(0.0) }, None)?));
        }
        if self.engaged < cut {
            let (engaged, trial) = self.tip_at(depth, ahead, 0.0)?;
            if engaged < cut {
                self.tip_holds = false;
                return Ok((engaged, trial));
            }
        }
        let cutting_force =
            self.model.scene().resistance_at(self.path.at(cut + self.probe(), ahead), &self.shaft).cutting_force;
        let held = self.cutting_force(cutting_force, cut);
        // A tip that has cut and is pushed on goes on cutting, if that takes it on.
        if self.has_cut
            && !self.is_small_strain()
            && depth > self.pose.depth
            && cut >= self.shaft.tip_length
            && let Ok((engaged, trial)) = self.tip_at(depth, ahead, cutting_force)
            && engaged >= cut
        {
            self.tip_holds = false;
            return Ok((engaged, trial));
        }
        let trial = self.trial(depth, ahead, Tip { engaged: cut, bounds: Bounds { lower: 0.0, upper: held } }, None)?;
        self.tip_holds = false;
        if trial.tip_force >= held {
            self.tip_at(depth, ahead, cutting_force)
        } else if trial.tip_force <= 0.0 {
            self.tip_at(depth, ahead, 0.0)
        } else {
            self.tip_holds = true;
            Ok((cut, trial))
        }
    }

    /// The part of a cutting force that the part of the tip takes which is in.
    pub(super) fn cutting_force(&self, whole: f64, engaged: f64) -> f64 {
        whole * (engaged / self.shaft.tip_length).min(1.0)
    }

    /// Where the tip is at this depth, under a force that is known: the root of where the tissue at an arc length is, by
    /// secants that begin with a body that does not move.
    fn tip_at(&mut self, depth: f64, ahead: Point2, force: f64) -> Result<(f64, Trial), NeedleError> {
        if self.is_small_strain() {
            let engaged = depth.max(0.0);
            // On the undeformed body a blunt tip would have the tissue overtake it: then it holds.
            let bounds = Bounds { lower: 0.0, upper: self.cutting_force(force, engaged) };
            let trial = self.trial(depth, ahead, Tip { engaged, bounds }, None)?;
            self.tip_holds = 0.0 < trial.tip_force && trial.tip_force < bounds.upper;
            return Ok((engaged, trial));
        }
        let enough = 1e-6 * self.model.spacing();
        let mut engaged = (self.engaged + self.tip_rate * (depth - self.pose.depth)).max(0.0);
        let mut last: Option<(f64, f64)> = None;
        let mut near = None;
        // Between these the root lies: the tissue jumps a little where a station is passed, maybe over it.
        let (mut behind, mut beyond) = ((0.0, None), (f64::INFINITY, None));
        for _ in 0..ROUNDS {
            let bounds = Bounds::exactly(self.cutting_force(force, engaged));
            let trial = self.trial(depth, ahead, Tip { engaged, bounds }, near.as_ref())?;
            let off = self.ahead_of_entry(engaged, ahead, &trial) + trial.tip_displacement - depth;
            let before = last.map(|(_, off)| off);
            // An end that stays counts half, so that the other one moves past the root (Illinois).
            let halved =
                |end: (f64, Option<f64>), stays: bool| if stays { (end.0, end.1.map(|off| 0.5 * off)) } else { end };
            if off > 0.0 {
                (behind, beyond) = (halved(behind, before.is_some_and(|before| before > 0.0)), (engaged, Some(off)));
            } else {
                (beyond, behind) = (halved(beyond, before.is_some_and(|before| before <= 0.0)), (engaged, Some(off)));
            }
            if let Some((there, then)) = last
                && engaged != there
            {
                self.tip_slope = ((off - then) / (engaged - there)).clamp(0.2, 50.0);
            }
            if engaged <= 0.0 && off > 0.0 {
                // Even the skin is further on than the tip: the needle is out.
                return Ok((0.0, trial));
            }
            let narrow = beyond.0 - behind.0 <= enough;
            if off.abs() <= enough || narrow && off.abs() <= JUMP * self.model.spacing() {
                return Ok((engaged, trial));
            }
            let next = match (behind, beyond) {
                ((low, Some(below)), (high, Some(above))) => low + (high - low) * below / (below - above),
                _ => {
                    let found = |(there, then): (f64, f64)| ((off - then) / (engaged - there)).clamp(0.2, 50.0);
                    engaged - off / last.map_or(self.tip_slope, found)
                }
            };
            last = Some((engaged, off));
            let inside = behind.0 < next && next < beyond.0;
            engaged = match next {
                next if next <= 0.0 => 0.0,
                next if inside => next,
                _ => 0.5 * (behind.0 + beyond.0),
            };
            near = Some(trial);
        }
        Err(NeedleError::NoForces { depth })
    }

    /// How far the tip's place in the undeformed body is along the axis.
    fn ahead_of_entry(&self, engaged: f64, ahead: Point2, trial: &Trial) -> f64 {
        let at = trial.contacts.last().map_or_else(|| self.path.at(engaged, ahead), |tip| tip.at);
        self.axis().dot(&(at - self.shaft.entry))
    }

    /// Makes a trial the state of the needle.
    ///
    /// # Errors
    /// [`NeedleError::Outrun`]; the state is then spoilt.
    fn commit(&mut self, depth: f64, before: Pose, engaged: f64, trial: Trial) -> Result<(), NeedleError> {
        let Trial { mut contacts, tip_force, tip_displacement } = trial;
        let (base, across, held) = (self.base_force(), self.force_across(), self.last_forces);
        let friction = self.dissipated(&contacts, depth);
        let passed = self.tip_passed(&contacts, depth, engaged);
        let cutting = self.mean_tip_force(tip_force, engaged) * passed;
        self.energy.friction += friction;
        self.energy.cutting += cutting;
        // On the first lengths of a tip every force moves tissue further than the needle has gone.
        let is_in = engaged >= self.shaft.tip_length;
        let EnergyAccount { work, paddle: by_paddle, base: by_base, .. } = self.energy;
        let rounding = -1e-6 * (work.abs() + by_paddle.abs() + by_base.abs());
        let gives = self.energy.friction < rounding || self.energy.cutting < rounding;
        if is_in && (gives || depth <= tip_displacement) {
            return Err(NeedleError::Outrun { depth });
        }
        if depth != self.pose.depth {
            self.tip_rate = ((engaged - self.engaged) / (depth - self.pose.depth)).clamp(0.0, 2.0);
        }
        self.has_cut = engaged > self.path.length();
        self.engaged = engaged;
        for contact in &contacts {
            self.path.cut_to(contact.arc_length, contact.at);
        }
        // What the tip has passed is what the tissue there has not gone along with.
        self.cut = if self.is_small_strain() { self.cut.max(depth - tip_displacement) } else { self.path.length() };
        let axis = self.axis();
        for contact in &mut contacts {
            contact.axial = axis.dot(&contact.stencil.interpolate(self.equilibrium.coefficients()));
            (contact.known, contact.takes_over) = (true, false);
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
        self.energy.work += 0.5 * (base + self.base_force()) * (depth - self.pose.depth);
        self.energy.work += 0.5 * (across + self.force_across()) * (self.pose.lateral - before.lateral);
        self.last_forces = self.held_forces();
        let mean = |k: usize| 0.5 * (held[k] + self.last_forces[k]);
        self.energy.paddle += mean(0).dot(&(self.pose.paddle - before.paddle));
        self.energy.base += mean(1).dot(&(self.pose.base - before.base));
        self.pose.depth = depth;
        self.last.copy_from_slice(self.equilibrium.coefficients());
        let EnergyAccount { work, paddle, base, friction, cutting, .. } = self.energy;
        self.energy.stored = match self.model.tissue().relaxes() {
            true => work + paddle + base - friction - cutting,
            false => self.equilibrium.energy() + self.load_work(),
        };
        Ok(())
    }
}
