//! Rows 26 to 29: damaged, foreign and impossible tables.

use firmware::ScalarKind;
use firmware::contract::{MAX_TABLE_BYTES, Table, TableError, decode, encode};

use super::Trial;
use crate::bench::error::SimError;
use crate::bench::faults::evidence::Evidence;

/// Bytes before the payload, and of the checksum after it.
const HEADER: usize = 52;
const CHECKSUM: usize = 4;

fn encoded<const D: usize, const N: usize, const P: usize>(table: &Table<f64, D, N, P>) -> Result<Vec<u8>, SimError> {
    let mut bytes = vec![0; MAX_TABLE_BYTES];
    let length = encode(table, &mut bytes).map_err(|source| SimError::Table { path: "paper".into(), source })?;
    bytes.truncate(length);
    Ok(bytes)
}

/// CRC-32 (ISO-HDLC), bit by bit: not the implementation under test.
fn crc(bytes: &[u8]) -> u32 {
    let shift = |sum: u32, _| if sum & 1 == 1 { (sum >> 1) ^ 0xedb8_8320 } else { sum >> 1 };
    !bytes.iter().fold(u32::MAX, |sum, byte| (0..8).fold(sum ^ u32::from(*byte), shift))
}

/// The bytes with a checksum that matches again.
fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let covered = bytes.len() - CHECKSUM;
    let sum = crc(&bytes[..covered]).to_le_bytes();
    bytes[covered..].copy_from_slice(&sum);
    bytes
}

fn refusal<const D: usize, const N: usize, const P: usize>(bytes: &[u8]) -> Option<TableError> {
    decode::<f64, D, N, P>(bytes).err()
}

fn demand(evidence: &mut Evidence, refused: Option<TableError>, what: impl Fn() -> String) {
    evidence.injected += 1;
    evidence.detected += u64::from(refused.is_some());
    evidence.require(refused.is_some(), || format!("{}: accepted", what()));
}

/// Row 26: every single-bit flip of a table is refused.
pub(crate) fn bit_flips<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let mut bytes = encoded(trial.table)?;
    evidence.require(refusal::<D, N, P>(&bytes).is_none(), || "the table itself is refused".to_owned());
    for bit in 0..8 * bytes.len() {
        bytes[bit / 8] ^= 1 << (bit % 8);
        demand(evidence, refusal::<D, N, P>(&bytes), || format!("bit {bit}"));
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    Ok(())
}

/// Row 27: every truncation and trailing bytes are refused.
pub(crate) fn truncations<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let bytes = encoded(trial.table)?;
    for length in 0..bytes.len() {
        demand(evidence, refusal::<D, N, P>(&bytes[..length]), || format!("{length} bytes"));
        // Cut off and sealed again: the header says how much there should be.
        if length >= HEADER + CHECKSUM {
            demand(evidence, refusal::<D, N, P>(&resealed(bytes[..length].to_vec())), || {
                format!("{length} bytes, sealed")
            });
        }
    }
    for extra in [1, 2, 4, 100, 100_000] {
        let mut longer = bytes.clone();
        longer.resize(bytes.len() + extra, 0);
        demand(evidence, refusal::<D, N, P>(&longer), || format!("{extra} more"));
        demand(evidence, refusal::<D, N, P>(&resealed(longer)), || format!("{extra} more, sealed"));
    }
    Ok(())
}

/// Row 28: another version, another schema, other units are refused, each for its own reason.
pub(crate) fn mismatches<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let bytes = encoded(trial.table)?;
    let with = |offset: usize, value: u8| {
        let mut changed = bytes.clone();
        changed[offset] = value;
        refusal::<D, N, P>(&resealed(changed))
    };
    let cases = [
        (with(0, b'X'), TableError::NotATable),
        (with(8, 1), TableError::FormatVersion { found: 1 }),
        (with(8, 0), TableError::FormatVersion { found: 0 }),
        (with(10, 4), TableError::ScalarKind { found: ScalarKind::F32, expected: ScalarKind::F64 }),
        (with(10, 7), TableError::UnknownScalar { found: 7 }),
        (with(11, 5 - D as u8), TableError::Dimension { found: 5 - D, expected: D }),
        (with(12, 3 * (D * P) as u8), TableError::PaddleDof { found: 3 * D * P, expected: D * P }),
        (with(14, 1), TableError::Reserved),
    ];
    for (found, expected) in cases {
        demand(evidence, found, || format!("{expected}"));
        evidence.require(found == Some(expected), || format!("{found:?} instead of {expected:?}"));
    }
    for units in [["mm", "1"], ["1", "kPa"]] {
        let found = crate::bench::comparison::check_units(trial.table, "paper".as_ref(), &units.map(str::to_owned));
        evidence.injected += 1;
        evidence.detected += u64::from(found.is_err());
        evidence.require(matches!(found, Err(SimError::TableUnits { .. })), || format!("units {units:?}: {found:?}"));
    }
    let same = [trial.table.units.length.as_str(), trial.table.units.stress.as_str()].map(str::to_owned);
    evidence.require(crate::bench::comparison::check_units(trial.table, "paper".as_ref(), &same).is_ok(), || {
        "the right units are refused".to_owned()
    });
    Ok(())
}

/// Bytes of a table that the writer would refuse: only the payload's own numbers are wrong.
fn forged<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    change: impl FnOnce(&mut Table<f64, D, N, P>),
) -> Result<Vec<u8>, SimError> {
    let mut table = trial.table.clone();
    change(&mut table);
    let payload = postcard::to_stdvec(&table)
        .map_err(|_| SimError::Table { path: "paper".into(), source: TableError::Payload })?;
    let mut bytes = encoded(trial.table)?[..HEADER].to_vec();
    bytes[48..52].copy_from_slice(&(payload.len() as u32).to_le_bytes());
    bytes.extend(payload);
    bytes.extend([0; CHECKSUM]);
    Ok(resealed(bytes))
}

/// What is made of a table.
type Change<const D: usize, const N: usize, const P: usize> = fn(&mut Table<f64, D, N, P>);

/// Impossible numbers of the last paddle, and directions: in the plane, which has one of each, others stand for them.
fn of_the_last_paddle<const D: usize, const N: usize, const P: usize>() -> [(&'static str, Change<D, N, P>); 6] {
    [
        ("NaN in the last Jacobian", |table| table.knots[1].jacobian[P - 1][(D - 1, D - 1)] = f64::NAN),
        ("NaN in the last path", |table| table.knots[1].paddle_path[(D - 1, P - 1)] = f64::NAN),
        ("path beyond the last limit", |table| {
            table.knots[1].paddle_path[(D - 1, P - 1)] = 1.1 * table.paddles[P - 1].max_displacement;
        }),
        ("negative rate of the last paddle", |table| table.paddles[P - 1].max_rate = -1.0),
        ("last paddle far away", |table| table.paddles[P - 1].extent[0][D - 1] = 1e300),
        ("directions that are not orthogonal", |table| {
            let axis = table.needle_axis;
            table.orthogonal.set_column(N - 1, &axis);
        }),
    ]
}

/// Row 29: a valid checksum over numbers that cannot be: NaN, unsorted, huge sizes, and every single-bit flip sealed
/// again. What is accepted has all invariants.
pub(crate) fn impossible<const D: usize, const N: usize, const P: usize>(
    trial: &Trial<'_, D, N, P>,
    evidence: &mut Evidence,
) -> Result<(), SimError> {
    let cases: [(&str, Change<D, N, P>); 22] = [
        ("NaN in a Jacobian", |table| table.knots[1].jacobian[0][(0, 1)] = f64::NAN),
        ("infinite path", |table| table.knots[2].paddle_path[0] = f64::INFINITY),
        ("NaN as a limit", |table| table.paddles[0].max_rate = f64::NAN),
        ("negative limit", |table| table.paddles[0].max_displacement = -1.0),
        ("unsorted depths", |table| table.knots.swap(1, 2)),
        ("equal depths", |table| table.knots[1].depth = table.knots[0].depth),
        ("one knot", |table| table.knots.truncate(1)),
        ("no unit vector", |table| table.orthogonal *= 2.0),
        ("singular Jacobian", |table| table.knots[3].jacobian.iter_mut().for_each(|jacobian| jacobian.fill(0.0))),
        ("gain of 5", |table| table.gains.loop_gain = 5.0),
        // Finite, but out of all proportion: with these the monitors that follow from them would never trip.
        ("huge rate", |table| table.paddles[0].max_rate = 1e300),
        ("huge needle speed", |table| table.validity.needle_speed = 1e300),
        ("huge paddle range", |table| {
            (table.paddles[0].max_displacement, table.validity.paddle_displacement) = (1e300, 1e300);
        }),
        ("huge valid range", |table| table.validity.paddle_displacement = 1e300),
        ("huge path slope", |table| table.knots[1].paddle_path_slope[0] = 1e300),
        ("huge target slope", |table| table.knots[1].target_displacement_slope[1] = -1e300),
        ("huge target displacement", |table| table.knots[1].target_displacement[0] = 1e300),
        ("huge static displacement", |table| table.knots[1].static_target_displacement[1] = 1e300),
        ("huge Jacobian", |table| table.knots[1].jacobian[0] *= 1e300),
        ("target far away", |table| table.target_position[0] = 1e300),
        ("paddle far away", |table| table.paddles[0].extent[1][1] = 1e300),
        ("rate of 200 ranges per second", |table| {
            table.paddles[0].max_rate = 200.0 * table.paddles[0].max_displacement
        }),
    ];
    let of_the_last = of_the_last_paddle().into_iter().filter(|_| D > 2);
    for (name, change) in cases.into_iter().chain(of_the_last) {
        let bytes = forged(trial, change)?;
        demand(evidence, refusal::<D, N, P>(&bytes), || name.to_owned());
        let damaged = matches!(refusal::<D, N, P>(&bytes), Some(TableError::Checksum { .. } | TableError::Payload));
        evidence.require(!damaged, || format!("{name}: refused for the wrong reason"));
    }
    // Sizes: a payload that says it has 2³² knots, a header that says it has 2³² bytes.
    let bytes = encoded(trial.table)?;
    let mut huge = bytes.clone();
    huge[48..52].copy_from_slice(&u32::MAX.to_le_bytes());
    demand(evidence, refusal::<D, N, P>(&resealed(huge)), || "payload of 2³² bytes".to_owned());
    let empty = forged(trial, |table| table.knots.clear())?;
    let mut many = empty[..empty.len() - CHECKSUM - 1].to_vec();
    many.extend([0xff, 0xff, 0xff, 0xff, 0x0f]);
    let payload = (many.len() - HEADER) as u32;
    many[48..52].copy_from_slice(&payload.to_le_bytes());
    many.extend([0; CHECKSUM]);
    demand(evidence, refusal::<D, N, P>(&resealed(many)), || "2³² knots".to_owned());
    // Bits that are flipped before the checksum was made: a good table or a refusal, never a bad table.
    let (mut sealed, mut refused) = (0, 0);
    for bit in 8 * HEADER..8 * (bytes.len() - CHECKSUM) {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        sealed += 1;
        match decode::<f64, D, N, P>(&resealed(flipped)) {
            Err(_) => refused += 1,
            Ok(table) => {
                evidence.require(table.validate().is_ok(), || format!("bit {bit}: a bad table was accepted"));
            }
        }
    }
    evidence
        .notes
        .push(format!("{sealed} flips sealed again: {refused} refused, the others are tables like any other"));
    Ok(())
}
