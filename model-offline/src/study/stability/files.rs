//! The study as CSV.

use super::Stability;
use crate::discretization::Integration;
use crate::output::csv::table;

fn family(integration: Integration) -> &'static str {
    if !integration.is_element() { "rkpm" } else { "fem" }
}

/// One row per entry.
pub fn csv(study: &Stability) -> Vec<u8> {
    let columns = [
        "method",
        "integration",
        "parameter",
        "value",
        "spacing",
        "nodes",
        "depth_reached",
        "reason",
        "support",
        "seed",
        "increments",
        "min_stretch",
        "law_limit_stretch",
        "ellipticity",
        "energy",
        "detail",
    ];
    table(columns, &study.rows, |(entry, o)| {
        let s = &entry.experiment;
        let integration = s.method.integration;
        [
            family(integration).to_owned(),
            integration.name().to_owned(),
            entry.parameter.name().to_owned(),
            entry.value.to_string(),
            s.spacing.to_string(),
            o.nodes.to_string(),
            format!("{:.6}", o.depth),
            o.reason.to_string(),
            if integration.is_element() { String::new() } else { s.method.support.to_string() },
            s.seed.to_string(),
            s.increments.to_string(),
            format!("{:.6}", o.min_stretch),
            super::claim::limit_of(study, s).map_or_else(String::new, |limit| format!("{limit:.6}")),
            format!("{:.6}", o.ellipticity),
            format!("{:.6e}", o.energy),
            o.detail.clone(),
        ]
    })
}

/// One row per method.
pub fn zero_energy_csv(study: &Stability) -> Vec<u8> {
    let columns = [
        "method",
        "integration",
        "spacing",
        "jitter_percent",
        "nodes",
        "zero_modes",
        "checkerboard_over_smooth",
        "checkerboard_felt",
        "interior_felt",
        "least_felt",
        "bloch_share",
    ];
    table(columns, &study.zero_energy, |z| {
        [
            family(z.integration).to_owned(),
            z.integration.name().to_owned(),
            study.spacing.to_string(),
            format!("{:.0}", 100.0 * z.jitter),
            z.nodes.to_string(),
            z.zero_modes.to_string(),
            format!("{:.6e}", z.checkerboard_over_smooth),
            format!("{:.6e}", z.checkerboard_energy_ratio),
            format!("{:.6e}", z.interior_energy_ratio),
            format!("{:.6e}", z.least_energy_ratio),
            format!("{:.6e}", z.bloch_share),
        ]
    })
}
