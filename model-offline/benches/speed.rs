//! `cargo bench -p model-offline`: the placement study, and one Newton iteration.

use criterion::{Criterion, criterion_group, criterion_main};
use model_offline::model::TissueModel;
use model_offline::placement::{PlacementOptions, place};
use model_offline::scene::Scene;
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::Vector2;
use std::time::{Duration, Instant};

fn paper() -> TissueModel {
    TissueModel::new(&Scene::bundled("paper").expect("bundled")).expect("the paper's scene")
}

fn placement(c: &mut Criterion) {
    let model = paper();
    c.bench_function("placement study, one tissue, one thread, 106 nodes", |b| {
        b.iter(|| place(&model, &PlacementOptions { threads: 1, ..Default::default() }).expect("all depths converge"));
    });
    c.bench_function("discretization, 106 nodes", |b| b.iter(paper));
}

fn newton(c: &mut Criterion) {
    let model = paper();
    c.bench_function("Newton iteration (assembly, factorisation, solve), 106 nodes", |b| {
        b.iter_custom(|count| {
            let (mut spent, mut iterations) = (Duration::ZERO, 0_u64);
            while iterations < count {
                let mut body = model.body(Some(2), NewtonSettings::default()).expect("enough is constrained");
                let before = body.equilibrium().effort().iterations;
                let start = Instant::now();
                for k in 1..=10 {
                    body.drive(0.01 * f64::from(k), Vector2::zeros()).expect("converges");
                }
                spent += start.elapsed();
                iterations += u64::from(body.equilibrium().effort().iterations - before);
            }
            spent.mul_f64(count as f64 / iterations as f64)
        });
    });
}

criterion_group!(benches, placement, newton);
criterion_main!(benches);
