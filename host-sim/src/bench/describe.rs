//! Scene, model and placement study in the words of the result.

use model_offline::placement::{PlacementStudy, StaticStudy};
use model_offline::scene::Scene;

use super::result::{NoPaddlePlacement, PaddlePlacement, PlacementResult, SimulationSettings};
use super::study_failure::StudyFailure;
use crate::world::simulation::Simulation;
use model_offline::scene::TissueVariant;

/// Settings of the simulation.
pub fn settings(scene: &Scene, simulation: &Simulation, table_knows_the_world: bool) -> SimulationSettings {
    let Simulation { loop_settings, actuator, .. } = simulation;
    SimulationSettings {
        rate_hz: loop_settings.rate,
        insertion_s: simulation.needle.insertion_s(),
        wait_s: simulation.needle.wait_s(),
        pauses_s: simulation.needle.pauses_s(),
        duration_s: simulation.duration_s,
        depth: simulation.depth,
        needle_depth: Some(simulation.needle.depth()),
        world: scene.effects().into_iter().map(str::to_owned).collect(),
        table_knows_the_world,
        sensor: simulation.sensor.title(),
        feedback: loop_settings.feedback.name().to_owned(),
        target_rate_hz: loop_settings.target_rate,
        target_latency_ms: loop_settings.latency,
        noise: loop_settings.noise_for(simulation.depth),
        paddle_lag_ms: actuator.lag_s * 1e3,
        paddle_delay_ticks: actuator.delay_ticks,
        paddle_gain: actuator.gain,
        paddle_max_rate: actuator.max_rate,
        paddle_max_displacement: scene.actuator.max_displacement,
    }
}

/// The command line of this process, without the directory of the program.
pub fn command_line() -> Vec<String> {
    let mut arguments: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    if let Some(program) = arguments.first_mut() {
        *program = std::path::Path::new(program.as_str())
            .file_name()
            .map_or_else(|| env!("CARGO_PKG_NAME").to_owned(), |name| name.to_string_lossy().into_owned());
    }
    arguments
}

/// A placement study of which some paddle can control the target.
pub fn placement(tissue: TissueVariant, study: &PlacementStudy) -> PlacementResult {
    let PlacementStudy { model, placement, wall_s, .. } = study;
    PlacementResult {
        tissue,
        nodes: model.nodes(),
        integration: model.scene().discretization.method.integration,
        wall_s: *wall_s,
        best_static: placement.optimum.static_paddle,
        best_dynamic: placement.optimum.dynamic_paddle,
        paddles: placement
            .paddles
            .iter()
            .map(|paddle| PaddlePlacement {
                index: paddle.index,
                jacobian: paddle.jacobian,
                controllability_measure: paddle.best_direction.map(|_| paddle.controllability_measure),
                best_direction: paddle.best_direction,
                depth: paddle.static_study.depth.clone(),
                orthogonal: paddle.static_study.orthogonal.clone(),
                max_orthogonal: paddle.static_study.max_orthogonal,
                reached_depth: paddle.static_study.reached_depth,
                failure: paddle.static_study.failure.as_ref().map(StudyFailure::from),
            })
            .collect(),
        no_paddle: Some(no_paddle(&placement.no_paddle.static_study)),
    }
}

fn no_paddle(study: &StaticStudy) -> NoPaddlePlacement {
    NoPaddlePlacement {
        depth: study.depth.clone(),
        orthogonal: study.orthogonal.clone(),
        max_orthogonal: study.max_orthogonal,
        reached_depth: study.reached_depth,
        failure: study.failure.as_ref().map(StudyFailure::from),
    }
}
