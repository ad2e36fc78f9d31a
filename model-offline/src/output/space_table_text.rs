//! A table in space as text and JSON, for people and scripts.

use super::table_text::{head, hex};
use crate::placement::space::Controllability;
use crate::table::space::SpaceTable;
use firmware::contract::SpatialTable;
use nalgebra::{DMatrix, Vector3};
use std::fmt::Write as _;

/// A screen's worth about a table.
pub fn summary(table: &SpaceTable) -> String {
    match table {
        SpaceTable::One(table) => summary_of(table),
        SpaceTable::Two(table) => summary_of(table),
    }
}

/// The whole table as JSON.
pub fn json(table: &SpaceTable) -> serde_json::Value {
    match table {
        SpaceTable::One(table) => json_of(table),
        SpaceTable::Two(table) => json_of(table),
    }
}

/// 1/σ_min(NᵀJ) of the paddles together.
fn measure<const P: usize>(table: &SpatialTable<f64, P>, knot: usize) -> f64 {
    let jacobian = &table.knots[knot].jacobian;
    let whole = DMatrix::from_fn(3, 3 * P, |r, c| jacobian[c / 3][(r, c % 3)]);
    Controllability::of(&whole, &table.orthogonal).measure
}

fn summary_of<const P: usize>(table: &SpatialTable<f64, P>) -> String {
    let mut out = head(table);
    out.push_str("\n   depth   paddle path                          1/σ_min(NᵀJ)  axial target  static orthogonal\n");
    for (k, knot) in table.knots.iter().enumerate() {
        for (p, path) in knot.paddle_path.column_iter().enumerate() {
            let lead = if p == 0 { format!("{:8.4}", knot.depth) } else { " ".repeat(8) };
            let _ = write!(out, "{lead}  ({:9.6}, {:9.6}, {:9.6})", path.x, path.y, path.z);
            if p == 0 {
                let _ = write!(
                    out,
                    "  {:12.4}  {:12.6}  {:16.6}",
                    measure(table, k),
                    knot.target_displacement.dot(&table.needle_axis),
                    table.orthogonal.tr_mul(&knot.static_target_displacement).norm(),
                );
            }
            out.push('\n');
        }
    }
    out
}

fn json_of<const P: usize>(table: &SpatialTable<f64, P>) -> serde_json::Value {
    let v = |v: &Vector3<f64>| [v.x, v.y, v.z];
    let columns =
        |m: &nalgebra::SMatrix<f64, 3, P>| -> Vec<[f64; 3]> { m.column_iter().map(|c| [c.x, c.y, c.z]).collect() };
    serde_json::json!({
        "dimension": 3,
        "scene_hash": hex(&table.scene_hash),
        "tissue": table.tissue.as_str(),
        "units": {"length": table.units.length.as_str(), "stress": table.units.stress.as_str()},
        "paddles": table.paddles.iter().map(|paddle| serde_json::json!({
            "index": paddle.index,
            "extent": [v(&paddle.extent[0]), v(&paddle.extent[1])],
            "max_displacement": paddle.max_displacement,
            "max_rate": paddle.max_rate,
        })).collect::<Vec<_>>(),
        "needle_axis": v(&table.needle_axis),
        "orthogonal": table.orthogonal.column_iter().map(|c| [c.x, c.y, c.z]).collect::<Vec<_>>(),
        "target_position": v(&table.target_position),
        "validity": {
            "depth": [table.validity.depth_start, table.validity.depth_end],
            "paddle_displacement": table.validity.paddle_displacement,
            "needle_speed": table.validity.needle_speed,
        },
        "gains": {
            "loop_gain": table.gains.loop_gain,
            "delay_samples": table.gains.delay_samples,
            "lambda_max": table.gains.lambda_max,
        },
        "knots": table.knots.iter().enumerate().map(|(place, k)| serde_json::json!({
            "depth": k.depth,
            "jacobian": (0..3).map(|r| k.jacobian.iter().flat_map(|j| (0..3).map(move |c| j[(r, c)])).collect::<Vec<_>>())
                .collect::<Vec<_>>(),
            "controllability_measure": measure(table, place),
            "paddle_path": columns(&k.paddle_path),
            "paddle_path_slope": columns(&k.paddle_path_slope),
            "target_displacement": v(&k.target_displacement),
            "target_displacement_slope": v(&k.target_displacement_slope),
            "static_target_displacement": v(&k.static_target_displacement),
        })).collect::<Vec<_>>(),
    })
}
