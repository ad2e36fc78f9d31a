//! The controller's table: Jacobians and the feed-forward paddle path along the insertion, from the nonlinear model.

mod along_insertion;
mod amplification;
mod jumps;
pub mod space;

use self::amplification::largest_amplification;
use crate::model::{Body, ModelError, TissueModel};
use crate::needle::NeedleError;
use crate::number::length;
use crate::placement::controllability::best_direction;
use crate::scene::Actuator;
use crate::solver::equilibrium::{Failure, NewtonSettings};
use firmware::contract::{
    CONDITION_LIMIT, Gains, Knot, MAX_KNOTS, MAX_TABLE_BYTES, Paddle, Table, TableError, Units, Validity,
    condition_number,
};
use firmware::loop_stability::default_gain;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// How a table is made.
///
/// # Example
/// ```
/// use model_offline::{Scene, TableOptions, TissueModel, table};
///
/// let model = TissueModel::new(&Scene::bundled("paper").expect("bundled"))?;
/// let few = table::build(&model, 3, &TableOptions { knots: 5, ..TableOptions::default() })?;
/// assert_eq!(few.knots.len(), 5);
/// # Ok::<(), table::TableBuildError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableOptions {
    /// Depth knots, at least 2.
    pub knots: usize,
    /// Delay of the feedback loop that the suggested gain is for, in target samples; none: that of the scene's sensor in a
    /// loop of 1 kHz, in space of the ideal one's.
    pub delay_samples: Option<u32>,
    /// Largest |λ| of J·Ĵ⁻¹ that the gain allows for at least. Where the scene's own tissues (with its inclusions and
    /// without), mistaken for each other, reach more at some depth, the table says so and its gain allows for that. On the
    /// paper's scene they give 0.9 to 1.28 (`host-sim loop-stability`).
    pub lambda_max: f64,
    /// Speed of the insertion that the table is for, length/s: where it is faster than the scene's
    /// `max_needle_speed`, that is raised to it, with a tenth for the drive.
    pub needle_speed: f64,
}

impl Default for TableOptions {
    fn default() -> Self {
        Self { knots: 21, delay_samples: None, lambda_max: 1.3, needle_speed: 0.0 }
    }
}

/// How much faster than asked for a drive may be for a moment.
const SPEED_MARGIN: f64 = 1.1;

/// Why a table could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TableBuildError {
    /// The number of knots is out of range.
    #[error("a table has 2 to {MAX_KNOTS} knots, not {0}")]
    Knots(usize),
    /// A table is of one paddle or two, and in the plane of one.
    #[error("{0} paddles asked for: a table has one or, in space, two")]
    Paddles(usize),
    /// The scene has no such paddle, or the model failed before the second knot.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The tissue cannot be followed to the second knot, without which there is no table.
    #[error(
        "no table of paddle {}: the tissue cannot be taken to depth {depth:.4}, where its second knot is ({source}); where contact and paddle end, nodes may be too close for the law: take a larger --tolerance or --spacing, or another --integration",
        paddles.iter().map(ToString::to_string).collect::<Vec<_>>().join(" and ")
    )]
    Stopped {
        /// Indices of the table's paddles.
        paddles: Vec<u32>,
        /// Needle depth of the knot.
        depth: f64,
        /// Why.
        source: ModelError,
    },
    /// The tissue goes over to another equilibrium.
    #[error(
        "between depth {from:.4} and {to:.4} the tissue goes over to another equilibrium, as where a surface folds: the paddle's path ends {off:.2e} from where its slopes lead; a larger --spacing or more knots may go past it"
    )]
    Jump {
        /// Depth of the knot before.
        from: f64,
        /// Depth of the knot behind.
        to: f64,
        /// How far the path is there outside of where its slopes at both lead, length.
        off: f64,
    },
    /// The paddle would have to go farther than its actuator can.
    #[error(
        "holding the target at depth {depth:.4} takes a paddle displacement of {needed:.4}, the actuator has {available:.4}: raise [actuator] max_displacement or choose another paddle"
    )]
    OutOfReach {
        /// Needle depth.
        depth: f64,
        /// Paddle displacement it takes.
        needed: f64,
        /// Paddle displacement there is.
        available: f64,
    },
    /// The Jacobian is too nearly singular for a controller.
    #[error(
        "paddle {paddle} cannot hold the target: at depth {depth:.4} its actuation Jacobian is ill-conditioned, condition number {condition:.3e}, at most {CONDITION_LIMIT:.0e} is accepted; choose another paddle position, or another needle direction"
    )]
    IllConditioned {
        /// Paddle index.
        paddle: u32,
        /// Needle depth.
        depth: f64,
        /// Condition number ‖J‖·‖J⁻¹‖ in the Frobenius norm.
        condition: f64,
    },
    /// The needle cannot be taken along the insertion.
    #[error(transparent)]
    Needle(#[from] NeedleError),
    /// A label does not fit into the table.
    #[error("label {0:?} is too long for the table")]
    Label(String),
    /// The table breaks one of its own rules.
    #[error("the table is not valid: {0}")]
    Invalid(TableError),
}

impl TableBuildError {
    /// That a knot was not reached which no table can do without.
    fn at_knot(paddles: &[u32], depth: f64, error: ModelError) -> Self {
        match error {
            source @ ModelError::Solve(_) if depth > 0.0 => Self::Stopped { paddles: paddles.to_vec(), depth, source },
            other => Self::Model(other),
        }
    }
}

/// A table ends before the insertion of its scene does.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the table ends at depth {}, of {} that the scene's needle goes: {source}", length(*reached), length(*wanted))]
pub struct EndedEarly {
    /// Depth of the last knot.
    pub reached: f64,
    /// Depth of the insertion.
    pub wanted: f64,
    /// Why there is no further one.
    pub source: TableBuildError,
}

/// A table, and why it ends early where it does.
#[derive(Debug, Clone, PartialEq)]
pub struct BuiltTable<T> {
    /// The table.
    pub table: T,
    /// Why it is not as deep as the insertion.
    pub ended: Option<EndedEarly>,
}

/// Knots, and why there are no further ones where the insertion goes on.
struct Followed<const D: usize, const P: usize> {
    knots: heapless::Vec<Knot<f64, D, P>, MAX_KNOTS>,
    ended: Option<TableBuildError>,
}

impl<const D: usize, const P: usize> Followed<D, P> {
    /// These knots, before something; no table has fewer than two.
    fn up_to(
        knots: heapless::Vec<Knot<f64, D, P>, MAX_KNOTS>,
        ended: TableBuildError,
    ) -> Result<Self, TableBuildError> {
        if knots.len() < 2 { Err(ended) } else { Ok(Self { knots, ended: Some(ended) }) }
    }

    /// That they end early in an insertion so deep.
    fn ended(&mut self, wanted: f64) -> Option<EndedEarly> {
        let reached = self.knots.last().map_or(0.0, |knot| knot.depth);
        self.ended.take().map(|source| EndedEarly { reached, wanted, source })
    }
}

/// Builds the table of one paddle. When the tissue loses stability on the way, the table ends at the last knot reached
/// (its validity range says so).
///
/// # Errors
/// [`TableBuildError`].
pub fn build(model: &TissueModel, paddle_index: u32, options: &TableOptions) -> Result<Table<f64, 2>, TableBuildError> {
    build_as_deep_as_it_goes(model, paddle_index, options).map(|built| built.table)
}

/// The same, with why the table ends where it ends early.
///
/// # Errors
/// [`TableBuildError`].
pub fn build_as_deep_as_it_goes(
    model: &TissueModel,
    paddle_index: u32,
    options: &TableOptions,
) -> Result<BuiltTable<Table<f64, 2>>, TableBuildError> {
    if !(2..=MAX_KNOTS).contains(&options.knots) {
        return Err(TableBuildError::Knots(options.knots));
    }
    let scene = model.scene();
    let position = scene.paddle_position(paddle_index).map_err(ModelError::from)?;
    let slips_or_relaxes = scene.needle.shaft.is_some() || scene.relaxes();
    let mut followed = match slips_or_relaxes {
        true => along_insertion::knots(model, position, options.knots)?,
        false => knots_of_states(model, position, options.knots)?,
    };
    let ended = followed.ended(scene.needle.depth);
    let knots = followed.knots;
    let amplification = match slips_or_relaxes {
        true => 1.0,
        false => largest_amplification(model, position, &knots).map_err(ModelError::from)?,
    };
    let lambda_max = options.lambda_max.max(amplification);
    let paddle = (paddle_index, scene.paddles[position].segment);
    let of = Described {
        scene_hash: scene.hash(),
        units: [&scene.length_unit, &scene.stress_unit],
        tissue: scene.tissue().name(),
        actuator: &scene.actuator,
        axis: scene.needle.axis,
        orthogonal: scene.needle.orthogonal(),
        target: scene.target,
        delay_samples: scene.sensor.delay_samples(),
    };
    Ok(BuiltTable { table: of.table([paddle], knots, lambda_max, options)?, ended })
}

/// What a table says of its scene.
struct Described<'a, const D: usize, const N: usize> {
    scene_hash: [u8; 32],
    /// Of length and stress.
    units: [&'a str; 2],
    tissue: &'a str,
    actuator: &'a Actuator,
    axis: SVector<f64, D>,
    orthogonal: SMatrix<f64, D, N>,
    target: SVector<f64, D>,
    /// Of a loop with the scene's sensor, in its samples.
    delay_samples: u32,
}

impl<const D: usize, const N: usize> Described<'_, D, N> {
    /// The table of paddles, by index and extent, with these knots and a gain for this |λ|.
    fn table<const P: usize>(
        self,
        paddles: [(u32, [SVector<f64, D>; 2]); P],
        knots: heapless::Vec<Knot<f64, D, P>, MAX_KNOTS>,
        lambda_max: f64,
        options: &TableOptions,
    ) -> Result<Table<f64, D, N, P>, TableBuildError> {
        let Actuator { max_displacement, max_rate, max_needle_speed } = *self.actuator;
        let delay_samples = options.delay_samples.unwrap_or(self.delay_samples);
        let depths = [knots.first(), knots.last()].map(|knot| knot.map_or(0.0, |knot| knot.depth));
        let table = Table {
            scene_hash: self.scene_hash,
            units: Units { length: label(self.units[0])?, stress: label(self.units[1])? },
            tissue: label(self.tissue)?,
            paddles: paddles.map(|(index, extent)| Paddle { index, extent, max_displacement, max_rate }),
            needle_axis: self.axis,
            orthogonal: self.orthogonal,
            target_position: self.target,
            validity: Validity {
                depth_start: depths[0],
                depth_end: depths[1],
                paddle_displacement: max_displacement,
                needle_speed: max_needle_speed.max(SPEED_MARGIN * options.needle_speed),
            },
            gains: Gains { loop_gain: default_gain(delay_samples, lambda_max), delay_samples, lambda_max },
            knots,
        };
        table.validate().map_err(TableBuildError::Invalid)?;
        Ok(table)
    }
}

/// Where a table's path is steepest: depth at which that begins, and how far a paddle has to go for each of the needle's depth.
pub fn steepest_path<const D: usize, const N: usize, const P: usize>(table: &Table<f64, D, N, P>) -> (f64, f64) {
    let slopes = table.knots.windows(2).map(|pair| {
        let gone = pair[1].paddle_path - pair[0].paddle_path;
        let farthest = gone.column_iter().map(|paddle| paddle.norm()).fold(0.0, f64::max);
        (pair[0].depth, farthest / (pair[1].depth - pair[0].depth))
    });
    slopes.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
}

/// Refuses a knot that no controller can work with.
fn check(knot: &Knot<f64, 2>, paddle: u32, available: f64) -> Result<(), TableBuildError> {
    let Knot { depth, jacobian: [jacobian], paddle_path, .. } = knot;
    let condition = condition_number(jacobian);
    if condition > CONDITION_LIMIT {
        return Err(TableBuildError::IllConditioned { paddle, depth: *depth, condition });
    }
    let needed = paddle_path.norm();
    if needed > available {
        return Err(TableBuildError::OutOfReach { depth: *depth, needed, available });
    }
    Ok(())
}

/// Knots of tissue whose state is that of needle and paddle, down to where it is stable.
fn knots_of_states(model: &TissueModel, position: usize, count: usize) -> Result<Followed<2, 1>, TableBuildError> {
    let scene = model.scene();
    let (paddle, available) = (scene.paddles[position].index, scene.actuator.max_displacement);
    let settings = NewtonSettings::default();
    let mut still = model.body(Some(position), settings).map_err(ModelError::from)?;
    let mut steered = model.body(Some(position), settings).map_err(ModelError::from)?;
    let mut knots = heapless::Vec::new();
    for k in 0..count {
        let depth = scene.needle.depth * k as f64 / (count - 1) as f64;
        match knot(&mut still, &mut steered, depth, paddle, scene.needle.orthogonal()) {
            Ok(knot) => {
                // Before the next one, which may fail because of it.
                check(&knot, paddle, available)?;
                if let Some(Err(jump)) = knots.last().map(|last| jumps::refuse(last, &knot)) {
                    return Followed::up_to(knots, jump);
                }
                // Capacity was checked before.
                let _ = knots.push(knot);
            }
            Err(error) if knots.len() < 2 => return Err(TableBuildError::at_knot(&[paddle], depth, error)),
            Err(error) => return Ok(Followed { knots, ended: Some(error.into()) }),
        }
    }
    Ok(Followed { knots, ended: None })
}

/// The bytes of a table file.
///
/// # Errors
/// [`TableBuildError::Invalid`] when the table breaks one of its own rules.
pub fn to_bytes<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
) -> Result<Vec<u8>, TableBuildError> {
    let mut bytes = vec![0; MAX_TABLE_BYTES];
    let length = firmware::contract::encode(table, &mut bytes).map_err(TableBuildError::Invalid)?;
    bytes.truncate(length);
    Ok(bytes)
}

fn label<const N: usize>(text: &str) -> Result<heapless::String<N>, TableBuildError> {
    heapless::String::try_from(text).map_err(|_| TableBuildError::Label(text.to_owned()))
}

/// One knot: takes both bodies to the depth, and steers the paddle so that the target is back on the needle's line.
fn knot(
    still: &mut Body<'_>,
    steered: &mut Body<'_>,
    depth: f64,
    paddle: u32,
    normal: Vector2<f64>,
) -> Result<Knot<f64, 2>, ModelError> {
    still.drive(depth, Vector2::zeros())?;
    // Start where the last knot's slope points to.
    let (_, direction, sensitivity) = linearise(steered, paddle, normal)?;
    let ahead = path_slope(direction, sensitivity, normal) * (depth - steered.depth());
    steered.drive(depth, steered.paddle() + ahead)?;
    steer(steered, paddle, normal)?;
    let (jacobian, direction, sensitivity) = linearise(steered, paddle, normal)?;
    let slope = path_slope(direction, sensitivity, normal);
    Ok(Knot {
        depth,
        jacobian: [jacobian],
        paddle_path: steered.paddle(),
        paddle_path_slope: slope,
        target_displacement: steered.target_displacement(),
        target_displacement_slope: sensitivity + jacobian * slope,
        static_target_displacement: still.target_displacement(),
    })
}

/// d(paddle)/d(depth) that keeps n·(target displacement) at zero, moving the paddle along J⁻¹n.
fn path_slope(direction: Vector2<f64>, sensitivity: Vector2<f64>, normal: Vector2<f64>) -> Vector2<f64> {
    -direction * normal.dot(&sensitivity)
}

/// Actuation Jacobian, J⁻¹n, and d(target)/d(depth).
type Linearisation = (Matrix2<f64>, Vector2<f64>, Vector2<f64>);

fn linearise(body: &mut Body<'_>, paddle: u32, normal: Vector2<f64>) -> Result<Linearisation, ModelError> {
    let jacobian = body.actuation_jacobian()?;
    let direction = best_direction(&jacobian, normal)
        .map_err(|singular| ModelError::Uncontrollable { paddle, condition: singular.condition })?;
    Ok((jacobian, direction, body.depth_sensitivity()?))
}

/// Orthogonal error that a knot of the path may keep where rounding ends Newton's method early, over the body's size.
const MAX_PATH_ERROR: f64 = 1e-9;

/// Newton's method on the paddle displacement: n·(target displacement) = 0 at the present depth.
fn steer(body: &mut Body<'_>, paddle: u32, normal: Vector2<f64>) -> Result<(), ModelError> {
    let tolerance = 1e-12 * body.scale();
    let mut error = normal.dot(&body.target_displacement());
    for _ in 0..12 {
        if error.abs() <= tolerance {
            return Ok(());
        }
        let (_, direction, _) = linearise(body, paddle, normal)?;
        body.drive(body.depth(), body.paddle() - direction * error)?;
        error = normal.dot(&body.target_displacement());
    }
    if error.abs() <= MAX_PATH_ERROR * body.scale() {
        return Ok(());
    }
    Err(ModelError::Solve(Failure {
        reason: crate::solver::equilibrium::FailureReason::NotConverged,
        reached: 0.0,
        detail: format!("the paddle path at depth {:.4} leaves {error:.1e} of orthogonal error", body.depth()),
    }))
}
