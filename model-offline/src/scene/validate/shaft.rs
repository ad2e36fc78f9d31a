//! The rules of a needle that slips.

use super::boundary::Boundary;
use super::{Checked, Validator};
use crate::scene::schema::{InclusionSection, Located};
use crate::scene::{Mechanics, Needle, Resistance, Shaft};

/// The keys that a shaft and an inclusion share, as they stand in the file.
struct ResistanceKeys<'a> {
    cutting_force: &'a Option<Located<f64>>,
    static_friction: &'a Option<Located<f64>>,
    kinetic_friction: &'a Option<Located<f64>>,
    viscous_friction: &'a Option<Located<f64>>,
}

impl ResistanceKeys<'_> {
    fn first(&self) -> Option<&Located<f64>> {
        let Self { cutting_force, static_friction, kinetic_friction, viscous_friction } = self;
        [cutting_force, static_friction, kinetic_friction, viscous_friction].into_iter().find_map(|key| key.as_ref())
    }
}

impl Validator<'_> {
    /// The shaft, where the needle is one.
    pub(super) fn shaft(&self, needle: &Needle, boundary: &Boundary<'_>) -> Checked<Option<Shaft>> {
        let section = &self.file.needle;
        let keys = ResistanceKeys {
            cutting_force: &section.cutting_force,
            static_friction: &section.static_friction,
            kinetic_friction: &section.kinetic_friction,
            viscous_friction: &section.viscous_friction,
        };
        if section.mechanics == Mechanics::Patch {
            let own = [&section.radius, &section.tip_length, &section.puncture_force];
            let given = own.into_iter().flatten().next().or(keys.first()).map(Located::span);
            return match given.or(section.entry.as_ref().map(Located::span)) {
                None => Ok(None),
                Some(span) => Err(self.error(
                    span,
                    "this is about a needle that slips, and the tissue of this needle's contact moves with it",
                    "add mechanics = \"shaft\" to [needle], or remove this key",
                )),
            };
        }
        let entry = match &section.entry {
            None => needle.entry(),
            Some(entry) => {
                let point = self.point(entry.get(), entry.span(), "entry")?;
                let point = if boundary.holds(point) { point } else { boundary.snapped(point, "needle entry") };
                if !boundary.holds(point) {
                    return Err(self.error(
                        entry.span(),
                        format!("the needle enters outside the outline: {}", boundary.off(point)),
                        "put the entry on the boundary, or inside where the needle is in already",
                    ));
                }
                point
            }
        };
        let tip = entry + needle.axis * needle.depth;
        let inside = |share: f64| boundary.holds(entry + (tip - entry) * share);
        if !(1..=64).all(|k| inside(f64::from(k) / 64.0)) {
            return Err(self.error(
                section.depth.span(),
                format!("at depth {} the needle leaves the body", needle.depth),
                "turn the axis, move the entry, or insert less deep: all of the needle's way must be inside",
            ));
        }
        let positive = |key: &Option<Located<f64>>, what: &str, default: f64| match key {
            None => Ok(default),
            Some(value) => self.positive(value, what),
        };
        let radius = positive(&section.radius, "radius", 0.01 * needle.depth)?;
        let tip_length = positive(&section.tip_length, "tip_length", 2.0 * radius)?;
        let puncture_force = match &section.puncture_force {
            None => 0.0,
            Some(value) if *value.get() >= 0.0 => *value.get(),
            Some(value) => {
                return Err(self.error(
                    value.span(),
                    format!("puncture_force is {}", value.get()),
                    "give a force of 0 or more, or inf for a skin that holds",
                ));
            }
        };
        let resistance = self.resistance(&keys, &Resistance::default())?;
        // Skin that never gives way makes it a patch, to the last bit.
        let gives_way = puncture_force.is_finite();
        Ok(gives_way.then_some(Shaft { entry, radius, tip_length, puncture_force, speed: needle.speed, resistance }))
    }

    /// What an inclusion resists a shaft with, where it says so.
    pub(super) fn inclusion_resistance(
        &self,
        section: &InclusionSection,
        shaft: Option<&Shaft>,
    ) -> Checked<Option<Resistance>> {
        let keys = ResistanceKeys {
            cutting_force: &section.cutting_force,
            static_friction: &section.static_friction,
            kinetic_friction: &section.kinetic_friction,
            viscous_friction: &section.viscous_friction,
        };
        match (keys.first(), shaft) {
            (None, _) => Ok(None),
            (Some(_), Some(shaft)) => self.resistance(&keys, &shaft.resistance).map(Some),
            (Some(_), None) if self.file.needle.mechanics == Mechanics::Shaft => {
                self.resistance(&keys, &Resistance::default()).map(|_| None)
            }
            (Some(key), None) => Err(self.error(
                key.span(),
                "this inclusion resists a needle that slips, and the scene's needle does not",
                "add mechanics = \"shaft\" to [needle], or remove this key",
            )),
        }
    }

    fn resistance(&self, keys: &ResistanceKeys<'_>, default: &Resistance) -> Checked<Resistance> {
        let at_least_zero = |key: &Option<Located<f64>>, what: &str, default: f64| match key {
            None => Ok(default),
            Some(value) if value.get().is_finite() && *value.get() >= 0.0 => Ok(*value.get()),
            Some(value) => Err(self.error(
                value.span(),
                format!("{what} is {}", value.get()),
                format!("{what} must be 0 or a positive finite number"),
            )),
        };
        let kinetic_friction = at_least_zero(keys.kinetic_friction, "kinetic_friction", default.kinetic_friction)?;
        // Where only the kinetic one is given, sticking takes no more than sliding.
        let sticking = if keys.kinetic_friction.is_some() { kinetic_friction } else { default.static_friction };
        let static_friction = at_least_zero(keys.static_friction, "static_friction", sticking)?;
        if static_friction < kinetic_friction
            && let Some(key) = keys.static_friction.as_ref().or(keys.kinetic_friction.as_ref())
        {
            return Err(self.error(
                key.span(),
                format!("static_friction {static_friction} is less than kinetic_friction {kinetic_friction}"),
                "a shaft that sticks holds at least as much as one that slides: raise static_friction",
            ));
        }
        Ok(Resistance {
            cutting_force: at_least_zero(keys.cutting_force, "cutting_force", default.cutting_force)?,
            static_friction,
            kinetic_friction,
            viscous_friction: at_least_zero(keys.viscous_friction, "viscous_friction", default.viscous_friction)?,
        })
    }
}
