//! Tables in space: one paddle or two that hold the target together.

use super::{BuiltTable, Described, Followed, TableBuildError, TableOptions, jumps, to_bytes};
use crate::geometry::Implicit as _;
use crate::model::space::SpaceBody;
use crate::model::{ModelError, control_derivatives};
use crate::placement::space::controllability::least_displacements;
use crate::placement::space::holding::{Hold, hold};
use crate::placement::space::insertion::InsertionModel;
use crate::solver::equilibrium::NewtonSettings;
use firmware::contract::{Header, Knot, MAX_KNOTS, SpatialTable, TableError, Validity, decode};
use firmware::scalar::ScalarKind;
use nalgebra::{DMatrix, Matrix2xX, SMatrix, Vector3};

/// A table of one paddle or of two.
#[derive(Debug, Clone, PartialEq)]
pub enum SpaceTable {
    /// One paddle.
    One(Box<SpatialTable<f64, 1>>),
    /// Two paddles.
    Two(Box<SpatialTable<f64, 2>>),
}

impl SpaceTable {
    /// Builds the table of the paddles of these indices, one or two. When the tissue loses stability on the way, the table ends at
    /// the last knot reached.
    ///
    /// # Errors
    /// [`TableBuildError`].
    pub fn build(model: &InsertionModel, paddles: &[u32], options: &TableOptions) -> Result<Self, TableBuildError> {
        Self::build_as_deep_as_it_goes(model, paddles, options).map(|built| built.table)
    }

    /// The same, with why the table ends where it ends early.
    ///
    /// # Errors
    /// [`TableBuildError`].
    pub fn build_as_deep_as_it_goes(
        model: &InsertionModel,
        paddles: &[u32],
        options: &TableOptions,
    ) -> Result<BuiltTable<Self>, TableBuildError> {
        let (table, ended) = match *paddles {
            [one] => {
                let BuiltTable { table, ended } = build(model, [one], options)?;
                (Self::One(Box::new(table)), ended)
            }
            [one, other] => {
                let BuiltTable { table, ended } = build(model, [one, other], options)?;
                (Self::Two(Box::new(table)), ended)
            }
            _ => return Err(TableBuildError::Paddles(paddles.len())),
        };
        Ok(BuiltTable { table, ended })
    }

    /// Reads and checks a table file of either scalar type.
    ///
    /// # Errors
    /// [`TableError`] says which check refused it.
    pub fn read(bytes: &[u8]) -> Result<Self, TableError> {
        let header = Header::read(bytes)?;
        match (header.paddle_dof, header.scalar) {
            (3, ScalarKind::F64) => Ok(Self::One(Box::new(decode::<f64, 3, 2, 1>(bytes)?))),
            (3, ScalarKind::F32) => Ok(Self::One(Box::new(decode::<f32, 3, 2, 1>(bytes)?.cast()))),
            (_, ScalarKind::F64) => Ok(Self::Two(Box::new(decode::<f64, 3, 2, 2>(bytes)?))),
            (_, ScalarKind::F32) => Ok(Self::Two(Box::new(decode::<f32, 3, 2, 2>(bytes)?.cast()))),
        }
    }

    /// Indices of its paddles.
    pub fn paddles(&self) -> Vec<u32> {
        match self {
            Self::One(table) => table.paddles.iter().map(|p| p.index).collect(),
            Self::Two(table) => table.paddles.iter().map(|p| p.index).collect(),
        }
    }

    /// Where it holds.
    pub fn validity(&self) -> &Validity<f64> {
        match self {
            Self::One(table) => &table.validity,
            Self::Two(table) => &table.validity,
        }
    }

    /// The bytes of a table file.
    ///
    /// # Errors
    /// [`TableBuildError::Invalid`] when the table breaks one of its own rules.
    pub fn to_bytes(&self) -> Result<Vec<u8>, TableBuildError> {
        match self {
            Self::One(table) => to_bytes(table),
            Self::Two(table) => to_bytes(table),
        }
    }
}

/// Delay of a loop of 1 kHz with the ideal sensor, 50 Hz and 20 ms late: scenes in space name none.
const IDEAL_DELAY_SAMPLES: u32 = firmware::Settings::new(1_000_000, 20_000_000, 20_000_000).delay_samples();

fn build<const P: usize>(
    model: &InsertionModel,
    indices: [u32; P],
    options: &TableOptions,
) -> Result<BuiltTable<SpatialTable<f64, P>>, TableBuildError> {
    if !(2..=MAX_KNOTS).contains(&options.knots) {
        return Err(TableBuildError::Knots(options.knots));
    }
    let scene = model.scene();
    let mut attached = [0; P];
    for (place, index) in attached.iter_mut().zip(indices) {
        *place = scene.paddle_position(index).map_err(ModelError::from)?;
    }
    let mut followed = knots(model, attached, options.knots)?;
    let ended = followed.ended(scene.needle.depth);
    let knots = followed.knots;
    let lambda_max = options.lambda_max.max(mistaken(model, &attached, &knots[0])?);
    let extents = indices.map(|index| {
        let region = scene.paddles.iter().find(|paddle| paddle.index == index).map(|paddle| &paddle.region);
        let (low, high) = region.and_then(|region| region.bounds()).unwrap_or_default();
        (index, [low, high])
    });
    let of = Described {
        scene_hash: scene.hash(),
        units: [&scene.length_unit, &scene.stress_unit],
        tissue: scene.tissue().name(),
        actuator: &scene.actuator,
        axis: scene.needle.axis,
        orthogonal: scene.needle.orthogonal(),
        target: scene.target,
        delay_samples: IDEAL_DELAY_SAMPLES,
    };
    Ok(BuiltTable { table: of.table(extents, knots, lambda_max, options)?, ended })
}

fn knots<const P: usize>(
    model: &InsertionModel,
    attached: [usize; P],
    count: usize,
) -> Result<Followed<3, P>, TableBuildError> {
    let scene = model.scene();
    let settings = NewtonSettings::default();
    let mut still = model.body(&attached, settings)?;
    let mut steered = still.clone();
    let mut knots = heapless::Vec::new();
    for k in 0..count {
        let depth = scene.needle.depth * k as f64 / (count - 1) as f64;
        match knot::<P>(&mut still, &mut steered, depth) {
            Ok(knot) => {
                let needed = knot.paddle_path.column_iter().map(|p| p.norm()).fold(0.0, f64::max);
                let available = scene.actuator.max_displacement;
                if needed > available {
                    return Err(TableBuildError::OutOfReach { depth, needed, available });
                }
                if let Some(Err(jump)) = knots.last().map(|last| jumps::refuse(last, &knot)) {
                    return Followed::up_to(knots, jump);
                }
                // Capacity was checked before.
                let _ = knots.push(knot);
            }
            Err(error) if knots.len() < 2 => return Err(error.into()),
            Err(error) => return Ok(Followed { knots, ended: Some(error.into()) }),
        }
    }
    Ok(Followed { knots, ended: None })
}

/// One knot: takes both bodies to the depth, the one with its paddles where they hold the target.
fn knot<const P: usize>(
    still: &mut SpaceBody<'_>,
    steered: &mut SpaceBody<'_>,
    depth: f64,
) -> Result<Knot<f64, 3, P>, ModelError> {
    still.drive(depth, &[Vector3::zeros(); P])?;
    hold(steered, depth)?;
    let held = Hold::of(steered)?;
    let slope = held.way(steered);
    Ok(Knot {
        depth,
        jacobian: std::array::from_fn(|p| held.jacobian.fixed_view::<3, 3>(0, 3 * p).into_owned()),
        paddle_path: SMatrix::from_columns(&std::array::from_fn::<_, P, _>(|p| steered.paddles()[p])),
        paddle_path_slope: SMatrix::from_column_slice(slope.as_slice()),
        target_displacement: steered.target_displacement(),
        target_displacement_slope: held.per_depth + &held.jacobian * &slope,
        static_target_displacement: still.target_displacement(),
    })
}

/// Largest |λ| of (NᵀJ)(NᵀĴ)⁺ where the scene's tissues, with its inclusions and without, are mistaken for each other, at rest.
fn mistaken<const P: usize>(
    model: &InsertionModel,
    attached: &[usize; P],
    own: &Knot<f64, 3, P>,
) -> Result<f64, ModelError> {
    if model.scene().inclusions.is_empty() {
        return Ok(1.0);
    }
    let (n, own_depth) = (model.scene().needle.orthogonal(), own.depth);
    let across = |jacobian: &DMatrix<f64>| n.transpose() * jacobian;
    let own = across(&DMatrix::from_fn(3, 3 * P, |r, c| own.jacobian[c / 3][(r, c % 3)]));
    let other = model.without_inclusions()?;
    let mut body = other.body(attached, NewtonSettings::default())?;
    let other = across(&control_derivatives::<3, _>(&mut body)?.slope.columns(1, 3 * P).into_owned());
    let largest = |of: &Matrix2xX<f64>, taken_for: &Matrix2xX<f64>| {
        let gain = of * least_displacements(taken_for).ok_or(ModelError::NotHeld { depth: own_depth })?;
        let eigenvalues = gain.fixed_resize::<2, 2>(0.0).complex_eigenvalues();
        Ok::<_, ModelError>(eigenvalues.iter().map(|l| l.norm()).fold(1.0, f64::max))
    };
    Ok(largest(&own, &other)?.max(largest(&other, &own)?))
}
