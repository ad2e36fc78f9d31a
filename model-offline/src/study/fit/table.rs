//! The smallest table that interpolates within its share of the tolerance.

use super::LAW_NODES;
use super::rejection::{Alternative, Rejected, RejectionReason};
use crate::model::{TissueModel, graded_model};
use crate::placement::study::best_dynamic;
use crate::scene::Scene;
use crate::scene::schema::TableScalar;
use crate::table::{TableBuildError, TableOptions, build as build_table};
use firmware::contract::Table;

/// Knots of the table that the others are held against, and the numbers tried.
const DENSE_KNOTS: usize = 65;
const KNOTS: [usize; 6] = [2, 3, 5, 9, 17, 33];

/// A table that is enough.
pub(super) struct FittedTable {
    pub knots: u32,
    pub scalar: TableScalar,
    pub rejected: Vec<Rejected>,
}

/// The table that the scene asks for, else the usual one: not fitted.
pub(super) fn usual(scene: &Scene) -> FittedTable {
    let (knots, scalar) = scene.fit.as_ref().map_or_else(
        || (TableOptions::default().knots as u32, TableScalar::default()),
        |fit| (fit.table_knots, fit.table_scalar),
    );
    FittedTable { knots, scalar, rejected: Vec::new() }
}

/// The fewest knots, and the number type.
pub(super) fn table(model: &TissueModel, tolerance: f64) -> Result<FittedTable, TableBuildError> {
    let mut rejected = Vec::new();
    // Interpolation errors come from the law, not from the nodes.
    let small = if model.nodes() <= LAW_NODES {
        model.clone()
    } else {
        graded_model(model.scene(), model.planar().method(), -2)?
    };
    let paddle = best_dynamic(&small)?;
    let table = |knots: usize, depth: Option<f64>| {
        let mut model = small.clone();
        if let Some(depth) = depth {
            let mut scene = small.scene().clone();
            scene.needle.depth = depth;
            model = model.with_tissue_of(&scene);
        }
        build_table(&model, paddle, &TableOptions { knots, ..TableOptions::default() })
    };
    let dense = table(DENSE_KNOTS, None)?;
    let depth = dense.validity.depth_end;
    let mut knots = DENSE_KNOTS;
    for count in KNOTS {
        let error = table_distance(&table(count, Some(depth))?, &dense);
        if error <= tolerance {
            knots = count;
            break;
        }
        rejected.push(Rejected::new(Alternative::Knots(count), RejectionReason::Interpolation(error)));
    }
    let rounding = table_distance(&dense.cast::<f32>().cast::<f64>(), &dense);
    // Rounding must disappear in the tolerance, not use it up.
    let scalar = if rounding <= 0.01 * tolerance {
        TableScalar::F32
    } else {
        rejected.push(Rejected::new(Alternative::SinglePrecision, RejectionReason::Rounding(rounding)));
        TableScalar::F64
    };
    Ok(FittedTable { knots: knots as u32, scalar, rejected })
}

/// Worst relative difference of Jacobian, and of the paddle's path over its largest value.
fn table_distance(a: &Table<f64, 2>, b: &Table<f64, 2>) -> f64 {
    let end = b.validity.depth_end;
    let farthest = b.knots.iter().map(|k| k.paddle_path.norm()).fold(f64::MIN_POSITIVE, f64::max);
    (0..=200)
        .filter_map(|k| {
            let depth = end * f64::from(k) / 200.0;
            let (a, b) = (a.locate(depth)?, b.locate(depth)?);
            let ([a_jacobian], [b_jacobian]) = (a.jacobian(), b.jacobian());
            let jacobian = (a_jacobian - b_jacobian).norm() / b_jacobian.norm();
            Some(jacobian.max((a.paddle_path() - b.paddle_path()).norm() / farthest))
        })
        .fold(0.0, f64::max)
}
