//! `cargo bench -p model-offline --bench table_space`: the speed goals in space as a table, on the homogeneous `block`, one thread.
//!
//! To measure a peer (DOLFINx 0.5 with MUMPS) in the same run: `apt-get install python3-dolfinx`, then
//! `STILLPOINT_PEER=1 cargo bench -p model-offline --bench table_space`; it runs `benches/peer_dolfinx_space.py` on one thread.
//! Our times have the mesh, the peer's have not.

use model_offline::discretization::{Integration, Method, Resolution};
use model_offline::model::space::SpaceModel;
use model_offline::parallel;
use model_offline::placement::space::rest::CondensedRest;
use model_offline::placement::space::workflow;
use model_offline::scene::space::SpaceScene;
use model_offline::solver::equilibrium::NewtonSettings;
use serde_json::Value;
use std::process::Command;
use std::time::Instant;

/// Continuum limits of the measures, with their source.
const GOLDEN: &str = include_str!("../../tests/golden/continuum3d.json");

/// Rule, level, and what five or two percent may take at most and should, s.
const PLACEMENT: [(Integration, i32, &str, f64, f64); 3] = [
    (Integration::FemT10, 0, "5 %", 5.0, 1.5),
    (Integration::FemT10, 1, "2 %", 25.0, 6.0),
    (Integration::ScniStabilised, 2, "5 %", 5.0, 1.5),
];

/// Rule, and what a Newton iteration of 9,300 nodes may take at most and should, s. Level 2 has some 11,500.
const NEWTON: [(Integration, f64, f64); 2] = [(Integration::ScniStabilised, 1.2, 0.4), (Integration::FemT4, 0.4, 0.15)];

/// Grid, degree and ordering of the peer.
const PEER: [[&str; 3]; 5] =
    [["10", "1", "3"], ["lines", "1", "3"], ["20", "1", "3"], ["10", "2", "3"], ["halves", "2", "3"]];

fn block(integration: Integration, resolution: Resolution) -> SpaceScene {
    let support = integration.default_support_in_space();
    let scene = SpaceScene::bundled("block").expect("bundled").without_inclusions();
    let mut scene = scene.with_method(Method { support, ..Method::new(integration) });
    scene.discretization.resolution = resolution;
    scene
}

/// Controllability measures of the limit: of single paddles, or of pairs.
fn limits(sets: &str) -> Vec<f64> {
    let golden: Value = serde_json::from_str(GOLDEN).expect("the golden file is JSON");
    let sets = golden["block"]["homogeneous"][sets].as_array().expect("sets").iter();
    sets.map(|set| set["cm"].as_f64().expect("a measure")).collect()
}

/// Worst relative error of the measures of these sets, percent.
fn worst(rest: &CondensedRest<'_>, sets: &[Vec<usize>], limits: &[f64]) -> f64 {
    let error = |(set, limit): (&Vec<usize>, &f64)| {
        let controllability = rest.response(set).expect("what is attached can be solved").controllability;
        (controllability.expect("a paddle is attached").measure / limit - 1.0).abs()
    };
    100.0 * sets.iter().zip(limits).map(error).fold(0.0, f64::max)
}

fn placement((integration, level, within, most, aim): (Integration, i32, &str, f64, f64)) {
    let scene = block(integration, Resolution::Level(level));
    let singles: Vec<Vec<usize>> = (0..scene.paddles.len()).map(|place| vec![place]).collect();
    let pairs: Vec<Vec<usize>> = scene.pairs.iter().map(|pair| pair.to_vec()).collect();
    let [mut of_singles, mut of_pairs] = [f64::INFINITY; 2];
    let mut said = String::new();
    for _ in 0..2 {
        let start = Instant::now();
        let model = workflow::model(&scene).expect("the block can be meshed");
        let rest = CondensedRest::new(&model).expect("enough is constrained");
        let error = worst(&rest, &singles, &limits("single"));
        of_singles = of_singles.min(start.elapsed().as_secs_f64());
        let start = Instant::now();
        let error_of_pairs = worst(&rest, &pairs, &limits("pair"));
        of_pairs = of_pairs.min(start.elapsed().as_secs_f64());
        said = format!(
            "{integration}, level {level}, {} nodes: {error:.1} % off, pairs {error_of_pairs:.1} %",
            model.nodes()
        );
    }
    println!("{:<78} {of_singles:>8.3} s {most:>6.1} s {aim:>6.1} s", format!("eight paddles within {within}: {said}"));
    println!(
        "{:<78} {of_pairs:>8.3} s {:>6.1} s {:>6.1} s",
        format!("    {} pairs in addition", pairs.len()),
        0.5,
        0.1
    );
}

/// Seconds per Newton iteration along an insertion, the proof that every state is stable included: the best of two.
fn newton((integration, most, aim): (Integration, f64, f64)) {
    let model: SpaceModel = workflow::model(&block(integration, Resolution::Level(2))).expect("a mesh");
    let once = || {
        let mut body = model.body(&[0], NewtonSettings::default()).expect("enough is constrained");
        let before = body.equilibrium().effort().iterations;
        let start = Instant::now();
        for k in 1..=2 {
            body.drive(0.002 * f64::from(k), &[nalgebra::Vector3::zeros()]).expect("shallow");
        }
        start.elapsed().as_secs_f64() / f64::from(body.equilibrium().effort().iterations - before)
    };
    let best = (0..2).map(|_| once()).fold(f64::INFINITY, f64::min);
    let work = format!("Newton iteration, {integration}, {} nodes", model.nodes());
    println!("{work:<78} {best:>8.3} s {most:>6.1} s {aim:>6.2} s");
}

fn main() {
    println!("`block`, homogeneous; one thread; the best of two\n");
    println!("{:<78} {:>10} {:>8} {:>8}", "work", "ours", "at most", "aim");
    parallel::within(1, || {
        PLACEMENT.into_iter().for_each(placement);
        NEWTON.into_iter().for_each(newton);
    });
    if std::env::var_os("STILLPOINT_PEER").is_some() {
        measure_peer();
    } else {
        println!("\nSTILLPOINT_PEER=1 measures DOLFINx with MUMPS beside it (Debian package python3-dolfinx)");
    }
}

/// Runs the peer on this machine and prints its own lines.
fn measure_peer() {
    println!("\npeer, measured in this run: eight paddles, without the mesh");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peer_dolfinx_space.py");
    for call in PEER {
        match Command::new("/usr/bin/python3").env("OMP_NUM_THREADS", "1").arg(script).args(call).output() {
            Ok(o) if o.status.success() => print!("{}", String::from_utf8_lossy(&o.stdout)),
            Ok(o) => println!("the peer failed: {}", String::from_utf8_lossy(&o.stderr).lines().last().unwrap_or("")),
            Err(error) => println!("the peer cannot be started: {error}"),
        }
    }
}
