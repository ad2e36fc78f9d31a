//! Forces along the shaft and tissue that agree.

use super::complementarity::{Bounds, forces_between};
use super::error::NeedleError;
use super::path::hat_integrals;
use super::state::SlippingNeedle;
use super::station::{Slide, Station, add_force, spread};
use crate::geometry::Point2;
use crate::model::Pose;
use crate::solver::equilibrium::Failure;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Change of the stations' displacements, over the spacing, at which forces and tissue agree.
const AGREED: f64 = 1e-7;
/// Change of the forces, over the largest, at which they do: in units of displacement small forces would never be asked.
const SETTLED: f64 = 1e-5;
/// Part of the largest force so far below which forces are none: of a body that has come back to rest all are rounding.
const NEGLIGIBLE: f64 = 1e-3;
/// Rounds of forces and equilibria, and of breaking loose.
const ROUNDS: usize = 40;
/// A compliance that leaves more than this part of the error is computed anew.
const STALE: f64 = 0.2;
/// Stations nearer to the tip than this part of their distance from each other give way to it.
const CLEARANCE: f64 = 0.3;
/// A tip that is in by less than this part of it is held across the needle by the skin alone.
const AT_THE_SKIN: f64 = 0.02;

/// The tip of one trial.
#[derive(Clone, Copy)]
pub(super) struct Tip {
    /// Arc length of the cut that it is at.
    pub(super) engaged: f64,
    pub(super) bounds: Bounds,
}

/// Forces and tissue that agree.
pub(super) struct Trial {
    /// Ascending; the last one is the tip.
    pub(super) contacts: Vec<Station>,
    pub(super) tip_force: f64,
    /// How far the tissue at the tip is ahead of it, less its arc length.
    pub(super) tip_displacement: f64,
}

impl SlippingNeedle<'_> {
    /// The stations that the shaft holds when its tip is at this arc length, and the tip.
    pub(super) fn contacts(&self, depth: f64, ahead: Point2, engaged: f64) -> Result<Vec<Station>, NeedleError> {
        let mut contacts: Vec<Station> = Vec::new();
        for (k, station) in self.stations.iter().enumerate() {
            let gap = match k.checked_sub(1) {
                Some(before) => station.arc_length - self.stations[before].arc_length,
                None => self.stations.get(1).map_or(0.0, |next| next.arc_length - station.arc_length),
            };
            // The skin is held from the first touch on: at depth 0 by the tip itself.
            let clearance = if station.arc_length > 0.0 { CLEARANCE } else { 0.0 };
            if station.arc_length >= engaged - clearance * gap {
                break;
            }
            contacts.push(if station.known { station.clone() } else { self.joined(station, depth, ahead)? });
        }
        let same = |tip: &&Station| (tip.arc_length - engaged).abs() <= 1e-12 * self.model.scene().needle.depth;
        contacts.push(match self.tip.as_ref().filter(same) {
            Some(tip) => tip.clone(),
            None => self.joined(&self.station(engaged, self.path.at(engaged, ahead))?, depth, ahead)?,
        });
        Ok(contacts)
    }

    /// A station that the shaft has held without its being asked, or that it has just come to.
    pub(super) fn joined(&self, station: &Station, depth: f64, ahead: Point2) -> Result<Station, NeedleError> {
        let at = self.path.at(station.arc_length, ahead);
        let moved = at != station.at;
        let mut joined = if moved {
            Station { slip: station.slip, ..self.station(station.arc_length, at)? }
        } else {
            station.clone()
        };
        (joined.across, joined.along) = (0.0, 0.0);
        joined.slide = if depth >= self.pose.depth { Slide::Forward } else { Slide::Backward };
        if let (Some(tip), true) = (&self.tip, station.arc_length <= self.engaged) {
            joined.known = true;
            joined.slide = tip.slide;
            joined.axial = self.axis().dot(&joined.stencil.interpolate(&self.last));
        }
        Ok(joined)
    }

    /// Forces and tissue that agree with the tip there.
    pub(super) fn trial(&mut self, depth: f64, ahead: Point2, tip: Tip) -> Result<Trial, NeedleError> {
        let mut contacts = self.contacts(depth, ahead, tip.engaged)?;
        let places: Vec<f64> = contacts.iter().map(|contact| contact.arc_length).collect();
        let lengths = hat_integrals(&places, 0.0, tip.engaged);
        let spread = spread(&places, tip.engaged, self.shaft.tip_length);
        let m = contacts.len();
        let mut forces = DVector::from_fn(2 * m + 1, |i, _| match i {
            i if i < m => contacts[i].across,
            i if i < 2 * m => self.first_guess(&contacts[i - m], lengths[i - m]),
            _ => self.tip_force.clamp(tip.bounds.lower, tip.bounds.upper),
        });
        let enough = AGREED * self.model.spacing();
        let mut compliance: Option<DMatrix<f64>> = None;
        let (mut last, mut fresh) = (f64::INFINITY, false);
        for _ in 0..ROUNDS {
            let external = self.external(&contacts, &forces, &spread);
            self.equilibrium
                .drive_loaded(&self.prescribed(), &external)
                .map_err(|source| NeedleError::Equilibrium { depth, source })?;
            let felt = self.felt(&contacts, depth, tip.engaged, &spread);
            let known = match compliance.take() {
                Some(known) => known,
                None => {
                    self.respond(&mut contacts, fresh).map_err(|source| NeedleError::Equilibrium { depth, source })?;
                    self.compliance(&contacts, &spread)
                }
            };
            let astray = self.follow_the_tissue(&mut contacts, &felt)?;
            let at_zero = &felt - &known * &forces;
            let found = self.friction(&mut contacts, (&lengths, tip.bounds), (&known, &at_zero), &forces);
            let Some(found) = found else {
                if std::mem::replace(&mut fresh, true) {
                    return Err(NeedleError::NoForces { depth });
                }
                // A compliance of several states may be none.
                continue;
            };
            // Responses of several states make a compliance that is not symmetric: what is felt across the needle decides too.
            let held = |k: &usize| !self.lies_where_it_is(&contacts[*k]);
            let off = (0..m).filter(held).map(|k| felt[k].abs()).fold(0.0, f64::max);
            let change = (&known * (&found - &forces)).amax().max(off).max(astray);
            let scale = found.amax().max(NEGLIGIBLE * self.largest_force);
            let settled = (&found - &forces).amax() <= SETTLED * scale;
            if change <= enough && settled {
                for (k, contact) in contacts.iter_mut().enumerate() {
                    (contact.across, contact.along) = (forces[k], forces[m + k]);
                    contact.length = lengths[k];
                    contact.slip += self.slipped(contact, depth, tip.engaged);
                }
                let tip_displacement = self.tip_displacement(&contacts, &spread);
                self.largest_force = self.largest_force.max(forces.amax());
                return Ok(Trial { contacts, tip_force: forces[2 * m], tip_displacement });
            }
            fresh = change > STALE * last && !fresh;
            if !fresh {
                compliance = Some(known);
            }
            last = change;
            forces = found;
        }
        Err(NeedleError::NoForces { depth })
    }

    /// Friction of a station that has slid so far and goes on, or what it was.
    fn first_guess(&self, contact: &Station, length: f64) -> f64 {
        let sliding = contact.resistance.sliding(self.shaft.speed) * length;
        match (contact.slide, contact.known) {
            (Slide::Forward, false) => sliding,
            (Slide::Backward, false) => -sliding,
            _ => contact.along,
        }
    }

    /// Whether a station has just been cut, behind the skin that the tip took with it: the tip goes through the tissue
    /// that it meets and pushes none aside, so that the station is the material point that lies on the needle's line,
    /// under no force across it. In an old cut there is nothing to choose.
    pub(super) fn lies_where_it_is(&self, station: &Station) -> bool {
        let is_new = !station.known && station.arc_length > self.path.length();
        !self.is_small_strain() && (is_new || self.is_beside_the_skin(station))
    }

    /// Whether a tip has only just come in: the skin, which it took with it, is held instead.
    pub(super) fn is_beside_the_skin(&self, station: &Station) -> bool {
        let gap = self.stations.get(1).map_or(0.0, |next| next.arc_length);
        0.0 < station.arc_length && station.arc_length < AT_THE_SKIN * gap
    }

    /// Makes stations that have just been cut the points that lie on the needle's line; how far they were off it.
    pub(super) fn follow_the_tissue(&self, contacts: &mut [Station], felt: &DVector<f64>) -> Result<f64, NeedleError> {
        let (normal, mut astray) = (self.normal(), 0.0);
        for (k, contact) in contacts.iter_mut().enumerate() {
            if self.lies_where_it_is(contact) && felt[k] != 0.0 {
                contact.at -= normal * felt[k];
                contact.stencil = self.model.planar().value_stencil(&contact.at)?;
                astray = f64::max(astray, felt[k].abs());
            }
        }
        Ok(astray)
    }

    /// The forces that fit a compliance; what breaks loose slides with less.
    pub(super) fn friction(
        &self,
        contacts: &mut [Station],
        (lengths, tip): (&[f64], Bounds),
        (compliance, at_zero): (&DMatrix<f64>, &DVector<f64>),
        start: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        let m = contacts.len();
        let mut start = start.clone();
        // What has been let loose once in this search does not stick again in it.
        let mut loose = vec![false; m];
        for _ in 0..ROUNDS {
            let across = |contact: &Station| match self.lies_where_it_is(contact) {
                true => Bounds::exactly(0.0),
                false => Bounds::HOLDS,
            };
            let mut bounds: Vec<Bounds> = contacts.iter().map(across).collect();
            bounds.extend(contacts.iter().zip(lengths).map(|(contact, length)| {
                let holding = contact.resistance.holding(self.shaft.speed) * length;
                let sliding = contact.resistance.sliding(self.shaft.speed) * length;
                match (contact.slide, contact.known) {
                    (Slide::Forward, false) => Bounds::exactly(sliding),
                    (Slide::Backward, false) => Bounds::exactly(-sliding),
                    (Slide::Sticks, _) => Bounds { lower: -holding, upper: holding },
                    (Slide::Forward, true) => Bounds { lower: -holding, upper: sliding },
                    (Slide::Backward, true) => Bounds { lower: -sliding, upper: holding },
                }
            }));
            bounds.push(tip);
            let forces = forces_between(&bounds, compliance, at_zero, &start)?;
            let mut broke = false;
            for (k, contact) in contacts.iter_mut().enumerate().filter(|(_, contact)| contact.known) {
                let (force, Bounds { lower, upper }) = (forces[m + k], bounds[m + k]);
                let slides = match force {
                    force if force >= upper => Slide::Forward,
                    force if force <= lower => Slide::Backward,
                    _ => Slide::Sticks,
                };
                if slides != contact.slide && slides != Slide::Sticks {
                    (broke, loose[k]) = (true, true);
                    contact.slide = slides;
                } else if !loose[k] {
                    contact.slide = slides;
                }
            }
            if !broke {
                return Some(forces);
            }
            start = forces;
        }
        None
    }

    /// What the stations feel: how far they are off the line, how far tissue has gone along with the needle more than it
    /// did, and how far the tissue at the tip is ahead of it.
    pub(super) fn felt(&self, contacts: &[Station], depth: f64, engaged: f64, spread: &[f64]) -> DVector<f64> {
        let (axis, normal) = (self.axis(), self.normal());
        let coefficients = self.equilibrium.coefficients();
        let m = contacts.len();
        let at = match contacts.last() {
            Some(tip) if !self.is_small_strain() => axis.dot(&(tip.at - self.shaft.entry)),
            Some(_) => self.cut,
            None => engaged,
        };
        let mut felt = DVector::zeros(2 * m + 1);
        for (k, contact) in contacts.iter().enumerate() {
            let u = contact.stencil.interpolate(coefficients);
            let rest = if self.is_small_strain() { 0.0 } else { normal.dot(&(contact.at - self.shaft.entry)) };
            felt[k] = rest + normal.dot(&u) - self.pose.lateral;
            if contact.known {
                felt[m + k] = axis.dot(&u) - contact.axial - (depth - self.pose.depth);
            }
        }
        felt[2 * m] = at + self.tip_displacement(contacts, spread) - depth;
        felt
    }

    /// Displacement along the axis of the tissue at the tip, as its force is spread.
    pub(super) fn tip_displacement(&self, contacts: &[Station], spread: &[f64]) -> f64 {
        let coefficients = self.equilibrium.coefficients();
        let axial = |contact: &Station| self.axis().dot(&contact.stencil.interpolate(coefficients));
        contacts.iter().zip(spread).map(|(contact, share)| share * axial(contact)).sum()
    }

    /// How far the needle slid past a station in this increment.
    pub(super) fn slipped(&self, contact: &Station, depth: f64, engaged: f64) -> f64 {
        let axial = self.axis().dot(&contact.stencil.interpolate(self.equilibrium.coefficients()));
        match contact.known {
            true => depth - self.pose.depth - (axial - contact.axial),
            false if depth >= self.pose.depth => (engaged - contact.arc_length).max(0.0),
            false => 0.0,
        }
    }

    /// The dead loads that forces across, along and at the tip are.
    pub(super) fn external(&self, contacts: &[Station], forces: &DVector<f64>, spread: &[f64]) -> Vec<f64> {
        let (axis, normal, m) = (self.axis(), self.normal(), contacts.len());
        let mut external = vec![0.0; self.model.dofs()];
        for (k, contact) in contacts.iter().enumerate() {
            let along = forces[m + k] + forces[2 * m] * spread[k];
            add_force(&contact.stencil, normal * forces[k] + axis * along, &mut external);
        }
        external
    }

    pub(super) fn prescribed(&self) -> Vec<f64> {
        let [immobile, moved] = self.rows;
        let Pose { base, paddle, .. } = self.pose;
        let rows = |value: Point2, count: usize| std::iter::repeat_n([value.x, value.y], count);
        rows(base, immobile).chain(rows(paddle, moved)).flatten().collect()
    }

    /// Computes the responses that are missing, or all of them anew.
    pub(super) fn respond(&mut self, contacts: &mut [Station], anew: bool) -> Result<(), Failure> {
        let missing: Vec<usize> = (0..contacts.len()).filter(|&k| anew || contacts[k].responses.is_none()).collect();
        let dofs = self.model.dofs();
        let mut loads = vec![0.0; 2 * missing.len() * dofs];
        for (pair, &k) in loads.chunks_exact_mut(2 * dofs).zip(&missing) {
            let (across, along) = pair.split_at_mut(dofs);
            add_force(&contacts[k].stencil, self.normal(), across);
            add_force(&contacts[k].stencil, self.axis(), along);
        }
        if missing.is_empty() {
            return Ok(());
        }
        let responses = match anew {
            true => self.equilibrium.linear_responses(&[], &loads)?,
            false => self.equilibrium.rough_responses(&loads)?,
        };
        for (pair, &k) in responses.chunks_exact(2 * dofs).zip(&missing) {
            let (across, along) = pair.split_at(dofs);
            contacts[k].responses = Some(Arc::new([across.to_vec(), along.to_vec()]));
        }
        Ok(())
    }

    /// What unit forces across, along and at the tip do to what the stations feel.
    pub(super) fn compliance(&self, contacts: &[Station], spread: &[f64]) -> DMatrix<f64> {
        let (axis, normal, m) = (self.axis(), self.normal(), contacts.len());
        let mut compliance = DMatrix::zeros(2 * m + 1, 2 * m + 1);
        for (k, by) in contacts.iter().enumerate() {
            for (direction, response) in by.responses.iter().flat_map(|both| both.iter()).enumerate() {
                let column = direction * m + k;
                for (row, contact) in contacts.iter().enumerate() {
                    let u = contact.stencil.interpolate(response);
                    compliance[(row, column)] = normal.dot(&u);
                    compliance[(m + row, column)] = axis.dot(&u);
                }
            }
        }
        for row in 0..2 * m {
            compliance[(row, 2 * m)] = (0..m).map(|k| spread[k] * compliance[(row, m + k)]).sum();
        }
        for column in 0..=2 * m {
            compliance[(2 * m, column)] = (0..m).map(|k| spread[k] * compliance[(m + k, column)]).sum();
        }
        compliance
    }
}
