//! `model-offline materials`: the materials that scenes can name.

use super::error::CliError;
use super::json::write_json;
use model_offline::material::{MaterialError, NamedMaterial, Preset, RelaxationSection};
use model_offline::output::check_outputs;
use model_offline::tell;
use std::fmt::Write as _;
use std::path::PathBuf;
use strum::VariantArray as _;

/// What stands where there is no number.
const NONE: &str = "–";

/// Options of `materials`.
#[derive(Debug, clap::Args)]
pub(super) struct MaterialsArgs {
    /// Write them as JSON, each with the section that a scene in kPa would write in its place.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &MaterialsArgs) -> Result<(), CliError> {
    check_outputs(&[], &[("--json", args.json.as_deref())])?;
    let all: Result<Vec<NamedMaterial>, MaterialError> =
        Preset::VARIANTS.iter().map(|preset| NamedMaterial::of(*preset)).collect();
    let all = all.map_err(|error| CliError::usage(error.to_string(), error.help()))?;
    write_json(args.json.as_deref(), &all)?;
    tell!("{}", text(&all));
    Ok(())
}

fn text(all: &[NamedMaterial]) -> String {
    let mut out = "preset        law          μ at rest, kPa      ν   relaxation: g (tau, s)\n".to_owned();
    for named in all {
        let law = named.material.model.map_or(NONE.to_owned(), |model| model.to_string());
        let (shear, poisson) = (named.shear_modulus_kpa, named.poisson_ratio);
        let terms = named.material.relaxation.as_ref().map_or(NONE.to_owned(), terms);
        let _ = writeln!(out, "{:<12}  {law:<11}  {shear:>14.3}  {poisson:>5.3}   {terms}", named.preset.name());
    }
    for NamedMaterial { preset, source, judgement, .. } in all {
        let _ = write!(out, "\n{preset}\n  source: {source}\n  judged: {judgement}\n");
    }
    out
}

fn terms(RelaxationSection { g, tau }: &RelaxationSection) -> String {
    g.iter().zip(tau).map(|(share, time)| format!("{share} ({time})")).collect::<Vec<_>>().join(", ")
}
