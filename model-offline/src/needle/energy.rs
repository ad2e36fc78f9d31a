//! Where the work at the base goes.

use super::state::SlippingNeedle;
use super::station::{Station, spread};
use nalgebra::Vector2;

impl SlippingNeedle<'_> {
    /// How far the tip has gone in this increment past the tissue that it pushes, as that lies deformed: the mean of what it
    /// pushed before and what it pushes now.
    pub(super) fn tip_passed(&self, contacts: &[Station], depth: f64, engaged: f64) -> f64 {
        let (axis, now, before) = (self.axis(), self.equilibrium.coefficients(), &self.last);
        let gone_along = |stations: &[&Station], engaged: f64| -> f64 {
            let places: Vec<f64> = stations.iter().map(|station| station.arc_length).collect();
            let moved = |at: &Station| axis.dot(&(at.stencil.interpolate(now) - at.stencil.interpolate(before)));
            let shares = spread(&places, engaged, self.shaft.tip_length);
            stations.iter().zip(shares).map(|(station, share)| share * moved(station)).sum()
        };
        let new = gone_along(&contacts.iter().collect::<Vec<_>>(), engaged);
        let held = self.holding().0;
        let old = if held.is_empty() { new } else { gone_along(&held, self.engaged) };
        depth - self.pose.depth - 0.5 * (old + new)
    }

    /// What friction takes in this increment: where the shaft was already, and over the triangle of slip behind a tip that
    /// moves on.
    pub(super) fn dissipated(&self, contacts: &[Station], depth: f64) -> f64 {
        let per_length = |station: &Station| if station.length > 0.0 { station.along / station.length } else { 0.0 };
        let were = self.stations.iter().filter(|station| station.known).chain(&self.tip);
        let slid: f64 = were
            .map(|station| {
                let now = contacts.iter().find(|contact| contact.arc_length == station.arc_length);
                let slid = self.slipped(station, depth, self.engaged);
                let friction = now.map_or(per_length(station).abs() * slid.signum(), per_length);
                friction * station.length * slid
            })
            .sum();
        let [.., tip] = contacts else { return slid };
        let on = tip.arc_length - self.tip.as_ref().map_or(0.0, |tip| tip.arc_length);
        slid + if on > 0.0 { 0.5 * per_length(tip) * on * on } else { 0.0 }
    }

    /// The tip's force, as a mean over what it has passed: it grows until the tip is in over its length.
    pub(super) fn mean_tip_force(&self, now: f64, engaged: f64) -> f64 {
        let part = |engaged: f64| self.cutting_force(1.0, engaged);
        if engaged > self.engaged && part(engaged) > 0.0 {
            now * 0.5 * (1.0 + part(self.engaged) / part(engaged))
        } else {
            now
        }
    }

    /// Force of the shaft on the tissue, across its line.
    pub(super) fn force_across(&self) -> f64 {
        self.holding().0.iter().map(|contact| contact.across).sum()
    }

    /// Forces of the paddle and of the base on the tissue.
    pub(super) fn held_forces(&self) -> [Vector2<f64>; 2] {
        let [immobile, _] = self.rows;
        let reactions: Vec<f64> = self.equilibrium.reactions().collect();
        let (base, paddle) = reactions.split_at(2 * immobile);
        let sum = |forces: &[f64]| forces.chunks_exact(2).map(|force| Vector2::new(force[0], force[1])).sum();
        [sum(paddle), sum(base)]
    }

    /// Work that the present forces would do over the present displacements.
    pub(super) fn load_work(&self) -> f64 {
        let (contacts, spread) = self.holding();
        let (axis, normal) = (self.axis(), self.normal());
        let works = contacts.iter().zip(&spread).map(|(contact, share)| {
            let force = normal * contact.across + axis * (contact.along + self.tip_force * share);
            force.dot(&contact.stencil.interpolate(self.equilibrium.coefficients()))
        });
        works.sum()
    }
}
