//! The study as CSV.

use super::Stability;
use crate::discretization::Integration;
use std::fmt::Write as _;

fn family(integration: Integration) -> &'static str {
    if !integration.is_element() { "rkpm" } else { "fem" }
}

/// A field of a CSV file (RFC 4180).
fn field(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// One row per setting.
pub fn csv(study: &Stability) -> String {
    let mut out = String::from(
        "method,integration,parameter,value,spacing,nodes,depth_reached,reason,support,seed,increments,min_stretch,law_limit_stretch,ellipticity,energy,detail\n",
    );
    for (entry, o) in &study.rows {
        let s = &entry.setting;
        let support = if !s.method.integration.is_element() { s.method.support.to_string() } else { String::new() };
        let limit = super::verdict::limit_of(study, s).map_or_else(String::new, |l| format!("{l:.6}"));
        let _ = writeln!(
            out,
            "{},{},{},{},{},{},{:.6},{},{support},{},{},{:.6},{limit},{:.6},{:.6e},{}",
            family(s.method.integration),
            s.method.integration.name(),
            entry.parameter.name(),
            entry.value_text(),
            s.spacing,
            o.nodes,
            o.depth,
            o.reason,
            s.seed,
            s.increments,
            o.min_stretch,
            o.ellipticity,
            o.energy,
            field(&o.detail)
        );
    }
    out
}

/// One row per method.
pub fn zero_energy_csv(study: &Stability) -> String {
    let mut out = String::from(
        "method,integration,spacing,jitter_percent,nodes,zero_modes,checkerboard_over_smooth,checkerboard_felt,interior_felt,least_felt,bloch_share\n",
    );
    for z in &study.zero_energy {
        let _ = writeln!(
            out,
            "{},{},{},{:.0},{},{},{:.6e},{:.6e},{:.6e},{:.6e},{:.6e}",
            family(z.integration),
            z.integration.name(),
            study.spacing,
            100.0 * z.jitter,
            z.nodes,
            z.zero_modes,
            z.checkerboard_over_smooth,
            z.checkerboard_energy_ratio,
            z.interior_energy_ratio,
            z.least_energy_ratio,
            z.bloch_share
        );
    }
    out
}
