//! `cargo bench -p model-offline --bench table`: the speed goals as a table, ours beside a recorded table of a peer
//! (DOLFINx 0.5 with MUMPS, one thread, on a machine of the same kind), and how cost grows with nodes.
//!
//! To measure the peer in the same run: `apt-get install python3-dolfinx`, then
//! `STILLPOINT_PEER=1 cargo bench -p model-offline --bench table`; it runs `benches/peer_dolfinx.py` on one thread.

use model_offline::discretization::nodes::graded::{Grading, InterfaceFit, graded_nodes};
use model_offline::discretization::{Integration, Method, Planar, Resolution};
use model_offline::model::TissueModel;
use model_offline::placement::adaptive::discretise;
use model_offline::placement::rest::rest_responses;
use model_offline::placement::{PlacementOptions, PlacementStudy};
use model_offline::scene::Scene;
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::Vector2;
use std::time::Instant;

/// Degree, degrees of freedom, seconds for five Jacobians, worst error of the measures, milliseconds per Newton iteration.
const PEER: [(u32, u32, f64, f64, f64); 7] = [
    (1, 212, 0.0051, 13.9, 0.63),
    (1, 2_942, 0.039, 4.2, 7.2),
    (1, 45_362, 0.98, 1.1, 189.0),
    (2, 772, 0.011, 4.7, 2.1),
    (2, 2_942, 0.059, 2.5, 9.1),
    (2, 11_482, 0.22, 1.25, 47.0),
    (2, 45_362, 1.25, 0.6, 242.0),
];

/// Continuum limits of the measures of `paper`, homogeneous (tests/golden).
const LIMITS: [f64; 5] = [5.2935, 3.7929, 3.3150, 3.5596, 4.5066];

/// Rule, spacing, at most and aim in milliseconds per Newton iteration.
const NEWTON: [(Integration, f64, f64, f64); 6] = [
    (Integration::ScniStabilised, 0.025, 5.0, 3.0),
    (Integration::ScniStabilised, 0.0125, 30.0, 12.0),
    (Integration::ScniStabilised, 0.0042, 1000.0, 400.0),
    (Integration::Scni, 0.0125, 70.0, 40.0),
    (Integration::FemT6, 0.025, 7.0, 4.0),
    (Integration::FemT6, 0.0084, 180.0, 100.0),
];

fn homogeneous() -> Scene {
    Scene::bundled("paper").expect("bundled").without_inclusions()
}

fn milliseconds(mut work: impl FnMut(), repeats: u32) -> f64 {
    (0..repeats)
        .map(|_| {
            let start = Instant::now();
            work();
            1e3 * start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

fn worst_error(model: &TissueModel) -> f64 {
    let responses = rest_responses(model).expect("enough is constrained");
    responses.iter().zip(LIMITS).map(|(r, l)| (r.controllability_measure / l - 1.0).abs()).fold(0.0, f64::max)
}

/// Milliseconds per Newton iteration along an insertion, the proof that every state is stable included: best of three, and
/// the number of nodes.
fn newton(integration: Integration, spacing: f64) -> (usize, f64) {
    let mut scene = homogeneous();
    scene.discretization.resolution = Resolution::Spacing(spacing);
    scene.discretization.method = Method::new(integration);
    let model = TissueModel::new(&scene).expect("the paper's scene");
    let best = (0..3)
        .map(|_| {
            let mut body = model.body(Some(2), NewtonSettings::default()).expect("enough is constrained");
            let before = body.equilibrium().effort().iterations;
            let start = Instant::now();
            for k in 1..=3 {
                body.drive(0.001 * f64::from(k), Vector2::zeros()).expect("shallow");
            }
            1e3 * start.elapsed().as_secs_f64() / f64::from(body.equilibrium().effort().iterations - before)
        })
        .fold(f64::INFINITY, f64::min);
    (model.nodes(), best)
}

/// All five Jacobians with known grading, node generation included: milliseconds, worst error, nodes.
fn five_jacobians(integration: Integration, grading: Grading) -> (f64, f64, usize) {
    let scene = homogeneous();
    let method = Method::new(integration);
    let build = || {
        let planar = Planar::new(&scene.outline, &[], graded_nodes(&scene.features(), &grading), None, method)
            .expect("graded nodes");
        TissueModel::on(&scene, planar, grading.finest).expect("features have nodes")
    };
    let time = milliseconds(|| drop(rest_responses(&build()).expect("enough is constrained")), 5);
    let model = build();
    (time, 100.0 * worst_error(&model), model.nodes())
}

fn main() {
    println!("one thread; best of several runs\n");
    println!("{:<72} {:>10} {:>10} {:>10}", "work", "ours", "at most", "aim");
    let row = |work: &str, ours: f64, goal: f64, aim: f64| {
        println!("{work:<72} {ours:>7.2} ms {goal:>7.1} ms {aim:>7.1} ms");
    };
    for (integration, spacing, goal, aim) in NEWTON {
        let (nodes, time) = newton(integration, spacing);
        row(&format!("Newton iteration, {nodes} nodes, {integration}"), time, goal, aim);
    }
    let fine = Grading::level(&homogeneous().features(), 2, InterfaceFit::Between);
    let rule = Integration::default();
    let (time, error, nodes) = five_jacobians(rule, fine);
    row(&format!("five Jacobians, {rule}, graded, {nodes} nodes, worst error {error:.2} %"), time, 20.0, 8.0);
    let coarse =
        Grading { coarsest: 0.2, finest: 0.015, slope: 0.55, interface: 1.0, narrow: 0.5, fit: InterfaceFit::On };
    let (time, error, nodes) = five_jacobians(Integration::FemT6, coarse);
    row(&format!("five Jacobians, quadratic triangles, graded, {nodes} nodes, error {error:.2} %"), time, 5.0, 3.0);
    for (integration, goals) in
        [(rule, [(100.0, 30.0), (400.0, 150.0)]), (Integration::FemT6, [(15.0, 8.0), (300.0, 100.0)])]
    {
        let mut scene = homogeneous();
        scene.discretization.method = Method::new(integration);
        scene.discretization.resolution = Resolution::Tolerance(0.01);
        let (model, _) = discretise(&scene).expect("the tolerance is reached");
        let time = milliseconds(|| drop(discretise(&scene).expect("reached")), 3);
        let error = 100.0 * worst_error(&model);
        let [(goal, aim), (study_goal, study_aim)] = goals;
        row(&format!("the same from tolerance 0.01 alone, {integration}, error {error:.2} %"), time, goal, aim);
        let study = |threads| {
            let options = PlacementOptions { threads, ..Default::default() };
            milliseconds(|| drop(PlacementStudy::run(&scene, &options).expect("controllable")), 2)
        };
        let (one, two) = (study(1), study(2));
        row(&format!("whole placement study of one tissue at 1 %, {integration}"), one, study_goal, study_aim);
        println!(
            "{:<72} {:>7.2} ×  {:>7.1} ×  {:>7.1} ×",
            "the same on two threads, times faster",
            one / two,
            1.6,
            1.9
        );
    }

    println!("\npeer, recorded (DOLFINx + MUMPS, one thread)");
    println!("{:>7} {:>8} {:>18} {:>12} {:>16}", "degree", "dofs", "five Jacobians", "worst error", "Newton iteration");
    for (degree, dofs, seconds, error, newton) in PEER {
        println!("{degree:>7} {dofs:>8} {:>15.1} ms {error:>10.1} % {newton:>13.1} ms", 1e3 * seconds);
    }

    if std::env::var_os("STILLPOINT_PEER").is_some() {
        measure_peer();
    }

    println!("\nhow the cost of a Newton iteration grows");
    for integration in [Integration::default(), Integration::Scni, Integration::FemT6] {
        let points: Vec<(f64, f64)> = [0.1, 0.05, 0.025, 0.0125, 0.00625]
            .iter()
            .map(|&h| {
                let (nodes, time) = newton(integration, h);
                println!("{integration} {nodes:>8} nodes {time:>10.2} ms");
                ((nodes as f64).ln(), time.ln())
            })
            .collect();
        println!("{integration}: time grows as nodes^{:.2}", slope(&points));
    }
}

/// Runs the peer on this machine and prints its own lines.
fn measure_peer() {
    println!("\npeer, measured in this run");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peer_dolfinx.py");
    for (refinement, degree) in [("1", "1"), ("4", "1"), ("1", "2"), ("2", "2"), ("4", "2"), ("8", "2")] {
        let output = std::process::Command::new("/usr/bin/python3")
            .env("OMP_NUM_THREADS", "1")
            .args([script, refinement, degree])
            .output();
        match output {
            Ok(o) if o.status.success() => print!("{}", String::from_utf8_lossy(&o.stdout)),
            Ok(o) => println!("the peer failed: {}", String::from_utf8_lossy(&o.stderr).lines().last().unwrap_or("")),
            Err(error) => println!("the peer cannot be started: {error}"),
        }
    }
}

/// Least-squares slope.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / points.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>()
}
