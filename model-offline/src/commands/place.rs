//! `model-offline place`: the whole placement study.

use super::common::{Common, SceneArgs, check_outputs};
use super::error::CliError;
use super::json::write_json;
use model_offline::output;
use model_offline::placement::{PlacementOptions, PlacementStudy, study};
use model_offline::scene::Scene;
use model_offline::table::{self, TableOptions};
use std::fmt::Write as _;
use std::path::PathBuf;

/// Options of `place`.
#[derive(Debug, clap::Args)]
pub(super) struct PlaceArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Write the study as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the controller table of the best dynamic paddle.
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(args: &PlaceArgs) -> Result<(), CliError> {
    let scene = args.common.over(args.scene.read()?)?;
    check_outputs(&args.scene.scene, &[("--json", args.json.as_deref()), ("--table", args.table.as_deref())])?;
    place(&scene, args).map_err(|error| error.reported(args.json.as_deref(), &scene))
}

fn place(scene: &Scene, args: &PlaceArgs) -> Result<(), CliError> {
    let bar = args.common.progress(study::steps(scene));
    let progress = || bar.inc(1);
    let options = PlacementOptions { threads: args.common.threads(), progress: &progress, ..Default::default() };
    let study = PlacementStudy::run(scene, &options)?;
    bar.finish_and_clear();
    if let Some(path) = &args.table {
        let built = table::build(&study.model, study.placement.optimum.dynamic_paddle, &TableOptions::default())?;
        output::write_whole(path, &table::to_bytes(&built)?)?;
    }
    let check = study.cross_check();
    let document = serde_json::json!({
        "scene": scene.name,
        "tissue": scene.tissue(),
        "nodes": study.model.nodes(),
        "dofs": study.model.dofs(),
        "integration": scene.discretization.method.integration,
        "wall_s": study.wall_s,
        "error_estimate": study.error_estimate,
        "cross_check": check,
        "static_nodes": study.placement.profile_nodes,
        "paddles": study.placement.paddles,
        "optimum": study.placement.optimum,
    });
    write_json(args.json.as_deref(), &document)?;
    if !args.common.quiet {
        print!("{}", summary(&study));
        if let Some(check) = check {
            println!("{}", check.line());
        }
    }
    Ok(())
}

fn summary(study: &PlacementStudy) -> String {
    let (scene, optimum) = (study.model.scene(), study.placement.optimum);
    let mut out = format!(
        "{} · {} tissue · {} nodes · {:.0} ms\n\n paddle   ‖J⁻¹n‖   J⁻¹n                  max orthogonal (static)\n",
        scene.name,
        scene.tissue(),
        study.model.nodes(),
        1e3 * study.wall_s
    );
    for p in &study.placement.paddles {
        let mark = |best: u32| if p.index == best { "*" } else { " " };
        let stopped = p
            .static_study
            .failure
            .as_ref()
            .map_or(String::new(), |f| format!("  stopped at depth {:.4}: {}", f.depth, f.reason));
        let _ = writeln!(
            out,
            "{:>7}  {:8.4}{} ({:8.4}, {:8.4})  {:12.6}{}{stopped}",
            p.index,
            p.controllability_measure,
            mark(optimum.dynamic_paddle),
            p.best_direction[0],
            p.best_direction[1],
            p.static_study.max_orthogonal,
            mark(optimum.static_paddle),
        );
    }
    if let Some(e) = study.error_estimate {
        let _ = writeln!(
            out,
            "\nestimated error: controllability {:.2} %, small-depth target displacement {:.2} % of the largest",
            100.0 * e.controllability,
            100.0 * e.target_displacement
        );
    }
    let _ = writeln!(
        out,
        "\nbest static paddle: {}; best dynamic paddle: {}",
        optimum.static_paddle, optimum.dynamic_paddle
    );
    for line in study.verdict() {
        let _ = writeln!(out, "{line}");
    }
    out
}
