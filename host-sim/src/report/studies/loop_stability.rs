//! The closed loop's stability as CSV and on one screen.

use std::fmt::Write as _;

use firmware::loop_stability::gain_limit;

use crate::bench::loop_stability::LoopStabilityResult;
use crate::bench::loop_stability::behaviour::Behaviour;
use crate::bench::loop_stability::cells::{Boundary, DELAYS};
use crate::bench::loop_stability::mismatch::Mismatch;
use crate::bench::loop_stability::rate_limit::{self, Cell, Integrator};
use model_offline::output::csv::table;
use model_offline::scene::TissueVariant;

/// Columns of the three parts; those that do not belong to a part are empty.
const COLUMNS: [&str; 22] = [
    "part",
    "delay_samples",
    "gain",
    "lambda_abs",
    "lambda_arg_degrees",
    "theory_gain_limit",
    "theory_stable_cells",
    "simulated_stable_cells",
    "disagreeing_cells",
    "paddle",
    "table_tissue",
    "tissue",
    "depth",
    "lambda_abs_max",
    "lambda_orthogonal",
    "theory_margin",
    "simulated_margin",
    "law",
    "gain_over_limit",
    "error_over_reach",
    "remaining",
    "behaviour",
];

/// One table for the three parts.
pub fn csv(result: &LoopStabilityResult) -> Vec<u8> {
    let boundaries = result.boundaries.iter().map(|boundary| boundary_row(boundary, result.paddle));
    let mismatches = result.mismatches.iter().map(mismatch_row);
    let rows: Vec<_> = boundaries.chain(mismatches).chain(result.cells.iter().map(rate_limit_row)).collect();
    table(COLUMNS, &rows, Clone::clone)
}

fn boundary_row(b: &Boundary, paddle: u32) -> [String; 22] {
    let mut row: [String; 22] = Default::default();
    row[0] = "gain-delay-jacobian".to_owned();
    row[1] = b.delay.to_string();
    row[3] = b.size.to_string();
    row[4] = b.angle.to_string();
    row[5] = format!("{:.6}", b.theory);
    row[6] = b.theory_cells.to_string();
    row[7] = b.simulated_cells.to_string();
    row[8] = b.disagreeing.to_string();
    row[9] = paddle.to_string();
    row
}

fn mismatch_row(m: &Mismatch) -> [String; 22] {
    let mut row: [String; 22] = Default::default();
    row[0] = "table-mismatch".to_owned();
    row[1] = m.gain.1.to_string();
    row[2] = format!("{:.6}", m.gain.0);
    row[3] = format!("{:.6}", m.eigenvalue.0);
    row[4] = format!("{:.4}", m.eigenvalue.1);
    row[5] = format!("{:.6}", m.gain.0 * m.margin);
    row[9] = m.paddle.to_string();
    row[10] = m.table.to_string();
    row[11] = m.tissue.to_string();
    row[12] = format!("{:.6}", m.depth);
    row[13] = format!("{:.6}", m.largest);
    row[14] = format!("{:.6}", m.orthogonal);
    row[15] = format!("{:.4}", m.margin);
    row[16] = format!("{:.4}", m.simulated_margin);
    row[21] = m.behaviour.name().to_owned();
    row
}

fn rate_limit_row(c: &Cell) -> [String; 22] {
    let limit = gain_limit(0.0, c.delay);
    let mut row: [String; 22] = Default::default();
    row[0] = "rate-limit".to_owned();
    row[1] = c.delay.to_string();
    row[2] = format!("{:.6}", c.gain_share * limit);
    row[3] = "1".to_owned();
    row[4] = "0".to_owned();
    row[5] = format!("{limit:.6}");
    row[17] = c.integrator.name().to_owned();
    row[18] = format!("{:.6}", c.gain_share);
    row[19] = format!("{:.6}", c.amplitude);
    row[20] = format!("{:.6e}", c.remaining);
    row[21] = c.behaviour.name().to_owned();
    row
}

/// The middle between the last cell that settles and the first that does not.
pub(super) fn simulated_limit(result: &LoopStabilityResult, boundary: &Boundary) -> f64 {
    let gains = result.gains();
    let last = gains[boundary.simulated_cells - 1];
    gains.get(boundary.simulated_cells).map_or(last, |next| (last * next).sqrt())
}

/// One screen.
pub fn summary(result: &LoopStabilityResult) -> String {
    let mut out = format!("{} · closed loop around paddle {}\n\n", result.scene, result.paddle);
    let cells = result.boundaries.len() * result.gains().len();
    let disagreeing: usize = result.boundaries.iter().map(|b| b.disagreeing).sum();
    let worst = result.boundaries.iter().map(|b| b.theory_cells.abs_diff(b.simulated_cells)).max().unwrap_or(0);
    let _ = writeln!(
        out,
        "gain × delay × Jacobian error: {cells} cells simulated, {disagreeing} differ from theory; no boundary is off by \
         more than {worst} cell{}",
        if worst == 1 { "" } else { "s" }
    );
    let _ = writeln!(out, "largest stable g·|λ|, simulated (theory):");
    for angle in [0.0, 30.0, 60.0] {
        let _ = write!(out, "  arg λ {angle:>2.0}°");
        for delay in DELAYS {
            let found = result.boundaries.iter().find(|b| (b.delay, b.size, b.angle) == (delay, 1.0, angle));
            let simulated = found.filter(|b| b.simulated_cells > 0).map_or(0.0, |b| simulated_limit(result, b));
            let _ = write!(out, "   d={delay} {simulated:.3} ({:.3})", gain_limit(angle.to_radians(), delay));
        }
        out.push('\n');
    }
    for (table, what) in [
        (TissueVariant::Homogeneous, "table without the inclusion on tissue with it"),
        (TissueVariant::Inclusion, "table with the inclusion on tissue without it"),
    ] {
        let rows: Vec<&Mismatch> = result.mismatches.iter().filter(|m| m.table == table).collect();
        let Some(first) = rows.first() else { continue };
        let least = rows.iter().map(|m| m.margin).fold(f64::INFINITY, f64::min);
        let simulated = rows.iter().map(|m| m.simulated_margin).fold(f64::INFINITY, f64::min);
        let largest = rows.iter().map(|m| m.largest).fold(0.0, f64::max);
        let angle = rows.iter().map(|m| m.eigenvalue.1.abs()).fold(0.0, f64::max);
        let settled = rows.iter().filter(|m| m.behaviour == Behaviour::Settles).count();
        let _ = writeln!(
            out,
            "\n{what}: {settled} of {} loops settle (gain {:.3}, delay {})\n  |λ| up to {largest:.3} (the gain allows for \
             {}), angle up to {angle:.1}°, gain could grow {least:.2} times (simulated {simulated:.2})",
            rows.len(),
            first.gain.0,
            first.gain.1,
            result.lambda_max
        );
    }
    for (paddle, reason) in &result.refused {
        let _ = writeln!(out, "paddle {paddle} has no table: {reason}");
    }
    out.push_str("\nrate limit with delay, gains below the linear limit, errors up to 100 times what a sample's motion can undo:\n");
    for delay in rate_limit::DELAYS {
        for integrator in [Integrator::Plain, Integrator::AntiWindup] {
            let below: Vec<_> = result
                .cells
                .iter()
                .filter(|c| c.integrator == integrator && c.delay == delay && c.gain_share < 0.99)
                .collect();
            let bad: Vec<_> = below.iter().filter(|c| c.behaviour != Behaviour::Settles).collect();
            let lowest = bad.iter().map(|c| c.gain_share).fold(f64::INFINITY, f64::min);
            let from = if bad.is_empty() { String::new() } else { format!(", from {lowest:.2} of the limit up") };
            let _ = writeln!(
                out,
                "  delay {delay}, {:<15} {} of {} cells do not settle{from}",
                integrator.name(),
                bad.len(),
                below.len()
            );
        }
    }
    out
}
