//! Forces along the shaft and tissue that agree.

use super::complementarity::{Bounds, forces_between};
use super::error::NeedleError;
use super::path::hat_integrals;
use super::springs::Springs;
use super::state::{STEP_TOLERANCE, SlippingNeedle, newton_settings};
use super::station::{Slide, Station, add_force, spread};
use crate::geometry::Point2;
use crate::model::Pose;
use crate::solver::equilibrium::Failure;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Change of the stations' displacements, over the spacing, at which forces and tissue agree.
const AGREED: f64 = 1e-7;
/// Change of the forces, over the largest, at which they do: in units of displacement small forces would never be asked.
const SETTLED: f64 = 1e-6;
/// Part of the largest force so far below which forces are none: of a body that has come back to rest all are rounding.
const NEGLIGIBLE: f64 = 1e-3;
/// Change of the stations' displacements that is rounding, whatever it is of the forces (of a body that is carried along there
/// are none): over the spacing, and over how far from the origin they are.
const ROUNDING: f64 = 1e-13;
const ROUNDING_OF_PLACES: f64 = 4.0 * f64::EPSILON;
/// Rounds of forces and equilibria, and of breaking loose.
const ROUNDS: usize = 40;
/// Round from which on what has broken loose stays loose: just where it does, one round may hold it and the next not.
const DOUBTFUL: usize = 10;
/// Round from which on only a part of the way to the next forces is taken where the rounds do not come nearer, and the
/// smallest part: under a tip the tissue stiffens, so that what is found at one force may lead back to the one before.
const DAMPED: usize = 6;
const SMALLEST_SHARE: f64 = 0.125;
/// A compliance that leaves more than this part of the error is computed anew.
const STALE: f64 = 0.5;
/// Error of the equilibria on the way, over what the forces changed last, and the largest.
const FORCING: f64 = 1e-2;
const LOOSEST: f64 = 1e-4;
/// Stations nearer to the tip than this part of their distance from each other give way to it.
const CLEARANCE: f64 = 0.3;
/// A tip that is in by less than this part of it is held across the needle by the skin alone.
const AT_THE_SKIN: f64 = 0.3;

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

/// Part of the way to the next forces: half of the last one where that did not come as much nearer as it should have.
fn next_share(share: f64, left: f64) -> f64 {
    if left > 1.0 - 0.5 * share { f64::max(SMALLEST_SHARE, 0.5 * share) } else { f64::min(1.0, 2.0 * share) }
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
            contacts.push(if station.known { station.clone() } else { self.joined(station, (depth, engaged), ahead)? });
        }
        let same = |tip: &&Station| (tip.arc_length - engaged).abs() <= 1e-12 * self.model.scene().needle.depth;
        contacts.push(match self.tip.as_ref().filter(same) {
            Some(tip) => tip.clone(),
            None => self.joined(&self.station(engaged, self.path.at(engaged, ahead))?, (depth, engaged), ahead)?,
        });
        Ok(contacts)
    }

    /// A station that the shaft has held without its being asked, or that it has just come to.
    pub(super) fn joined(
        &self,
        station: &Station,
        (depth, engaged): (f64, f64),
        ahead: Point2,
    ) -> Result<Station, NeedleError> {
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
            // On the way in: what the tip leaves behind on the way out was held before.
            joined.takes_over = tip.slide == Slide::Forward && engaged > self.engaged && depth > self.pose.depth;
            joined.axial = self.axis().dot(&joined.stencil.interpolate(&self.last));
        }
        Ok(joined)
    }

    /// Begins where another trial of the same increment ended: the tip lies beside where its way went straight as far as
    /// that one's did, and forces are that one's.
    fn begin_at(&self, contacts: &mut [Station], near: &Trial, ahead: Point2) -> Result<(), NeedleError> {
        let ([stations @ .., tip], [others @ .., other]) = (contacts, &near.contacts[..]) else { return Ok(()) };
        for station in stations {
            if let Some(same) = others.iter().find(|other| other.arc_length == station.arc_length) {
                (station.across, station.along) = (same.across, same.along);
            }
        }
        (tip.across, tip.along) = (other.across, other.along);
        if self.lies_where_it_is(tip) && self.lies_where_it_is(other) {
            let beside = self.normal().dot(&(other.at - self.path.at(other.arc_length, ahead)));
            tip.at = self.path.at(tip.arc_length, ahead) + self.normal() * beside;
            tip.stencil = self.model.planar().value_stencil(&tip.at)?;
        }
        Ok(())
    }

    /// Forces and tissue that agree with the tip there; `near` is another trial of the same increment.
    pub(super) fn trial(
        &mut self,
        depth: f64,
        ahead: Point2,
        tip: Tip,
        near: Option<&Trial>,
    ) -> Result<Trial, NeedleError> {
        let mut contacts = self.contacts(depth, ahead, tip.engaged)?;
        if let Some(near) = near {
            self.begin_at(&mut contacts, near, ahead)?;
        }
        let places: Vec<f64> = contacts.iter().map(|contact| contact.arc_length).collect();
        let lengths = hat_integrals(&places, 0.0, tip.engaged);
        let spread = spread(&places, tip.engaged, self.shaft.tip_length);
        let mut before: Vec<Slide> = contacts.iter().map(|contact| contact.slide).collect();
        let m = contacts.len();
        let mut forces = DVector::from_fn(2 * m + 1, |i, _| match i {
            i if i < m => contacts[i].across,
            i if i < 2 * m => self.first_guess(&contacts[i - m], lengths[i - m]),
            _ => self.tip_force.clamp(tip.bounds.lower, tip.bounds.upper),
        });
        let enough = AGREED * self.model.spacing();
        let mut compliance: Option<DMatrix<f64>> = None;
        self.hold_by_springs(&contacts);
        // What is known of the tissue without springs says nothing of it with them.
        let (mut last, mut fresh, mut share) = (f64::INFINITY, self.is_sprung, 1.0);
        for round in 0..ROUNDS {
            let external = self.external(&contacts, &forces, &spread);
            let loose = self.drive(depth, &external, last)?;
            let felt = self.felt(&contacts, depth, tip.engaged, &spread);
            let known = match compliance.take() {
                Some(known) => known,
                None => {
                    self.respond(&mut contacts, fresh).map_err(|source| NeedleError::Equilibrium { depth, source })?;
                    self.compliance(&contacts, &spread)
                }
            };
            let at_zero = &felt - &known * &forces;
            let found = self.friction(&mut contacts, (&lengths, &before, tip.bounds), (&known, &at_zero), &forces);
            let Some((found, regimes)) = found else {
                if std::mem::replace(&mut fresh, true) {
                    return Err(NeedleError::NoForces { depth });
                }
                self.follow_the_tissue(&mut contacts, &felt)?;
                // A compliance of several states may be none.
                continue;
            };
            if round >= DOUBTFUL {
                before = regimes;
            }
            // Responses of several states make a compliance that is not symmetric: what is felt across the needle decides too.
            // Points that are to lie on the line are as far off it as what is felt.
            let off = felt.rows(0, m).amax();
            let moved = &known * (&found - &forces);
            let change = moved.amax().max(off);
            let scale = found.amax().max(NEGLIGIBLE * self.largest_force);
            let settled = (&found - &forces).amax() <= SETTLED * scale || change <= self.rounding();
            if change <= enough && settled && loose <= STEP_TOLERANCE {
                for (k, contact) in contacts.iter_mut().enumerate() {
                    (contact.across, contact.along) = (forces[k], forces[m + k]);
                    contact.length = lengths[k];
                    contact.slip += self.slipped(contact, depth, tip.engaged);
                }
                let tip_displacement = self.tip_displacement(&contacts, &spread);
                self.largest_force = self.largest_force.max(forces.amax());
                return Ok(Trial { contacts, tip_force: forces[2 * m], tip_displacement });
            }
            share = if round >= DAMPED { next_share(share, change / last) } else { 1.0 };
            forces += (found - &forces) * share;
            // Where the tissue will be under the new forces: behind them this would converge half as fast.
            self.follow_the_tissue(&mut contacts, &(&felt + &(moved * share)))?;
            fresh = change > STALE * last && !fresh;
            if !fresh {
                compliance = Some(known);
            }
            last = change;
        }
        Err(NeedleError::NoForces { depth })
    }

    /// Puts springs on the stations that are held on the line, where forces have not been found without.
    fn hold_by_springs(&mut self, contacts: &[Station]) {
        if !self.is_sprung {
            return;
        }
        let there = |at: Point2| self.pose.lateral - self.normal().dot(&(at - self.shaft.entry));
        let held = contacts.iter().filter(|contact| !self.lies_where_it_is(contact));
        let stations = held.map(|contact| (contact, there(contact.at)));
        let stiffness = self.equilibrium.rest_stiffness();
        let springs = Springs::new((self.normal(), stiffness), stations, self.model.analysis().pattern());
        if self.springs.as_deref() != Some(&springs) {
            let springs = Arc::new(springs);
            self.springs = Some(Arc::clone(&springs));
            self.equilibrium.hold(springs);
        }
    }

    /// What is no change of a station's displacement.
    fn rounding(&self) -> f64 {
        let (entry, depth) = (self.shaft.entry, self.model.scene().needle.depth);
        f64::max(ROUNDING * self.model.spacing(), ROUNDING_OF_PLACES * (entry.norm() + depth))
    }

    /// Takes the tissue to its equilibrium under loads, as good as the forces are that it is for, which changed it by `last`;
    /// a linear tissue's is found in one step. How good it is: Newton's last step, over the spacing.
    fn drive(&mut self, depth: f64, external: &[f64], last: f64) -> Result<f64, NeedleError> {
        let loosest = if self.is_small_strain() { STEP_TOLERANCE } else { LOOSEST };
        let loose = (FORCING * last / self.model.spacing()).clamp(STEP_TOLERANCE, loosest);
        self.equilibrium.set_settings(newton_settings(loose));
        let driven = self.equilibrium.drive_loaded(&self.prescribed(), external);
        driven.map_err(|source| NeedleError::Equilibrium { depth, source })?;
        Ok(loose)
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

    /// Makes stations that have just been cut the points that lie on the needle's line, off which the present ones are by
    /// what is felt across it.
    fn follow_the_tissue(&self, contacts: &mut [Station], felt: &DVector<f64>) -> Result<(), NeedleError> {
        let normal = self.normal();
        for (k, contact) in contacts.iter_mut().enumerate() {
            if self.lies_where_it_is(contact) && felt[k] != 0.0 {
                contact.at -= normal * felt[k];
                contact.stencil = self.model.planar().value_stencil(&contact.at)?;
            }
        }
        Ok(())
    }

    /// The forces that fit a compliance; what breaks loose slides with less.
    ///
    /// Static friction holds what kinetic friction would not, so that there may be two answers. What slid before the
    /// increment is asked to stick by kinetic friction alone, what stuck by static friction, in every round: no guess on the
    /// way to the answer may decide which of the two it is. Returned with how each was asked in the end.
    fn friction(
        &self,
        contacts: &mut [Station],
        (lengths, before, tip): (&[f64], &[Slide], Bounds),
        (compliance, at_zero): (&DMatrix<f64>, &DVector<f64>),
        start: &DVector<f64>,
    ) -> Option<(DVector<f64>, Vec<Slide>)> {
        let m = contacts.len();
        let (mut start, mut regimes) = (start.clone(), before.to_vec());
        for _ in 0..ROUNDS {
            let across = |contact: &Station| match self.lies_where_it_is(contact) {
                true => Bounds::exactly(0.0),
                false => Bounds::HOLDS,
            };
            let mut bounds: Vec<Bounds> = contacts.iter().map(across).collect();
            bounds.extend(contacts.iter().zip(lengths).zip(&regimes).map(|((contact, length), regime)| {
                let holding = contact.resistance.holding(self.shaft.speed) * length;
                let sliding = contact.resistance.sliding(self.shaft.speed) * length;
                match (regime, contact.known && !contact.takes_over) {
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
            let decided = contacts.iter_mut().enumerate().filter(|(_, contact)| contact.known && !contact.takes_over);
            for (k, contact) in decided {
                let (force, Bounds { lower, upper }) = (forces[m + k], bounds[m + k]);
                let slides = match force {
                    force if force >= upper => Slide::Forward,
                    force if force <= lower => Slide::Backward,
                    _ => Slide::Sticks,
                };
                if slides != Slide::Sticks && slides != regimes[k] {
                    (broke, regimes[k]) = (true, slides);
                }
                // What has been let loose does not stick again in the same increment.
                contact.slide = if regimes[k] == before[k] { slides } else { regimes[k] };
            }
            if !broke {
                return Some((forces, regimes));
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
