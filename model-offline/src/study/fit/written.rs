//! A fit as a scene file, and on one screen.

use super::Fit;
use super::plant::EndToEnd;
use crate::number::length;
use crate::scene::schema::FitSection;

impl Fit {
    /// The text of the scene with the choice written into it; everything else, comments included, stays.
    ///
    /// # Errors
    /// What the text does not parse as; a scene that was read before always does.
    pub fn written_into(&self, text: &str) -> Result<String, toml_edit::TomlError> {
        let mut document: toml_edit::DocumentMut = text.parse()?;
        let section = &mut document["discretization"];
        if let Some(table) = section.as_table_like_mut() {
            for key in ["spacing", "tolerance", "level", "support", "basis"] {
                table.remove(key);
            }
        }
        match self.chosen.level {
            Some(level) => section["level"] = toml_edit::value(i64::from(level)),
            None => section["spacing"] = toml_edit::value(self.chosen.spacing),
        }
        section["integration"] = toml_edit::value(self.chosen.integration.name());
        if let Some(support) = self.chosen.support {
            section["support"] = toml_edit::value(support);
            section["basis"] = toml_edit::value(self.chosen.basis.name());
        }
        let FitSection { plant, plant_tolerance, table_knots, table_scalar, effects } = self.section();
        let mut fit = toml_edit::Table::new();
        fit["plant"] = toml_edit::value(plant.to_string());
        if let Some(tolerance) = plant_tolerance {
            fit["plant_tolerance"] = toml_edit::value(tolerance);
        }
        fit["table_knots"] = toml_edit::value(i64::from(table_knots));
        fit["table_scalar"] = toml_edit::value(table_scalar.to_string());
        if let Some(effects) = effects {
            let names: toml_edit::Array = effects.iter().map(|effect| effect.name()).collect();
            fit["effects"] = toml_edit::value(names);
        }
        document["fit"] = toml_edit::Item::Table(fit);
        Ok(document.to_string())
    }

    /// The part of the choice that the scene's `[fit]` carries.
    pub fn section(&self) -> FitSection {
        FitSection {
            plant: self.chosen.plant,
            plant_tolerance: Some(self.chosen.plant_tolerance),
            table_knots: self.chosen.table_knots,
            table_scalar: self.chosen.table_scalar,
            effects: self.world.as_ref().map(|world| world.needed.clone()),
        }
    }

    /// The answer on one screen.
    pub fn summary(&self) -> String {
        use std::fmt::Write as _;
        let c = &self.chosen;
        // Their plant is learnt by a simulation: there is no step to time.
        let in_time = self.world.as_ref().filter(|world| !world.needed.is_empty());
        let plant =
            in_time.map_or_else(|| format!("{} plant", c.plant), |_| "plant along the path of an insertion,".into());
        let step = in_time.map_or_else(
            || format!("one step of the plant in {:.2} µs", self.step_us),
            |_| "the plant is learnt by a simulation and was not timed".into(),
        );
        let nodes = match c.level {
            Some(level) => format!("graded nodes, level {level}"),
            None => format!("nodes {} apart", length(c.spacing)),
        };
        let support = c.support.map_or(String::new(), |s| format!(", {} basis, support {s}", c.basis));
        let mut out = format!(
            "{} · {} tissue · tolerance {}\n\nchosen: {}{support}, {nodes} ({}); {} law; {plant} to depth {}; {} table knots, {}\n\
             estimated error {:.3} %, distance from the next finer model {:.3} %\n\
             all Jacobians in {:.2} ms, {step} (fitted in {:.1} s)\n",
            self.scene,
            self.tissue,
            self.tolerance,
            c.integration,
            c.nodes,
            c.law,
            length(c.plant_depth),
            c.table_knots,
            c.table_scalar,
            100.0 * self.error_estimate,
            100.0 * self.verified_error,
            1e3 * self.wall_s,
            self.fit_wall_s,
        );
        if let Some(world) = &self.world {
            out.push_str(&world.summary(self.tolerance));
        }
        let _ = match self.end_to_end {
            _ if in_time.is_some() => writeln!(out),
            EndToEnd { error: Some(error), depth, nodes } => {
                let beyond = if error > self.tolerance { ": ABOVE the tolerance" } else { "" };
                writeln!(
                    out,
                    "end to end, against the full model on {nodes} nodes, to depth {depth:.4}: {:.3} %{beyond}\n",
                    100.0 * error
                )
            }
            EndToEnd { error: None, nodes, .. } => {
                writeln!(out, "end to end: nothing to compare with ({nodes} nodes go nowhere)\n")
            }
        };
        out.push_str("rejected:\n");
        for r in &self.rejected {
            let _ = writeln!(out, "  {:<56} {:>10}  {}", r.alternative.to_string(), r.reason.number_text(), r.reason);
        }
        out
    }
}
