//! A controller table as text and JSON, for people and scripts.

use crate::number::{decimals, length};
use firmware::contract::{Header, Table, TableError, decode};
use firmware::scalar::ScalarKind;
use std::fmt::Write as _;

/// Reads and checks a table of either scalar type.
///
/// # Errors
/// [`TableError`] says which check refused it.
pub fn read(bytes: &[u8]) -> Result<Table<f64, 2>, TableError> {
    match Header::read(bytes)?.scalar {
        ScalarKind::F32 => Ok(decode::<f32, 2, 1, 1>(bytes)?.cast()),
        ScalarKind::F64 => decode::<f64, 2, 1, 1>(bytes),
    }
}

/// Bytes in hexadecimal, two digits each.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut s, b| {
        let _ = write!(s, "{b:02x}");
        s
    })
}

/// A screen's worth about a table.
pub fn summary(table: &Table<f64, 2>) -> String {
    let mut out = head(table);
    out.push_str("\n   depth   paddle path            J⁻¹n norm   axial target  static orthogonal\n");
    let depth = table.validity.depth_end;
    let (places, small) = (decimals(depth, 4), decimals(0.01 * depth, 6));
    let wide = small + 3;
    for knot in &table.knots {
        let measure = knot.jacobian[0].try_inverse().map_or(f64::INFINITY, |j| (j * table.orthogonal).norm());
        let _ = writeln!(
            out,
            "{:8.places$}  ({:wide$.small$}, {:wide$.small$})  {:9.4}  {:12.small$}  {:16.small$}",
            knot.depth,
            knot.paddle_path.x,
            knot.paddle_path.y,
            measure,
            knot.target_displacement.dot(&table.needle_axis),
            knot.static_target_displacement.dot(&table.orthogonal),
        );
    }
    out
}

/// What a table is of, and its limits: three lines.
pub(super) fn head<const D: usize, const N: usize, const P: usize>(table: &Table<f64, D, N, P>) -> String {
    let names: Vec<String> = table.paddles.iter().map(|paddle| paddle.index.to_string()).collect();
    let (max_displacement, max_rate) =
        table.paddles.first().map_or((0.0, 0.0), |paddle| (paddle.max_displacement, paddle.max_rate));
    format!(
        "paddle {} · {} tissue · {} knots, depth {} to {}\nscene {}\n\
         limits: displacement {}, rate {} per s, needle speed {} per s; loop gain {:.4} \
         (delay {} samples, model error {:.2})\n",
        names.join(" and "),
        table.tissue,
        table.knots.len(),
        length(table.validity.depth_start),
        length(table.validity.depth_end),
        hex(&table.scene_hash),
        length(max_displacement),
        length(max_rate),
        length(table.validity.needle_speed),
        table.gains.loop_gain,
        table.gains.delay_samples,
        table.gains.lambda_max,
    )
}

/// The whole table as JSON.
pub fn json(table: &Table<f64, 2>) -> serde_json::Value {
    let v = |v: &nalgebra::Vector2<f64>| [v.x, v.y];
    serde_json::json!({
        "scene_hash": hex(&table.scene_hash),
        "tissue": table.tissue.as_str(),
        "units": {"length": table.units.length.as_str(), "stress": table.units.stress.as_str()},
        "paddle": {
            "index": table.paddles[0].index,
            "segment": [v(&table.paddles[0].extent[0]), v(&table.paddles[0].extent[1])],
            "max_displacement": table.paddles[0].max_displacement,
            "max_rate": table.paddles[0].max_rate,
        },
        "needle_axis": v(&table.needle_axis),
        "orthogonal": v(&table.orthogonal),
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
        "knots": table.knots.iter().map(|k| serde_json::json!({
            "depth": k.depth,
            "jacobian": crate::placement::controllability::rows(&k.jacobian[0]),
            "paddle_path": v(&k.paddle_path),
            "paddle_path_slope": v(&k.paddle_path_slope),
            "target_displacement": v(&k.target_displacement),
            "target_displacement_slope": v(&k.target_displacement_slope),
            "static_target_displacement": v(&k.static_target_displacement),
        })).collect::<Vec<_>>(),
    })
}
