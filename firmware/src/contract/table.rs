//! The controller table: everything that the controller knows about the tissue.
//!
//! Written offline from the nonlinear model, read once at start. `D` is the dimension of space and the number of
//! degrees of freedom of each paddle, `N` = D − 1 the number of directions orthogonal to the needle, `P` the number of
//! paddles. Lengths are in the scene's own unit, times in seconds.

use heapless::{String, Vec};
use nalgebra::{ArrayStorage, SMatrix, SVector};
use serde::{Deserialize, Serialize};

use super::each;
use super::frames::{MAX_DIMENSION, MAX_PADDLES};
use crate::scalar::Scalar;

/// Capacity for knots in depth.
pub const MAX_KNOTS: usize = 256;

/// Labels of the scene's units, for reports only.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Units {
    /// Unit of lengths.
    pub length: String<16>,
    /// Unit of stresses.
    pub stress: String<16>,
}

/// A paddle that the table was computed for, and what it may do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Paddle<T: Scalar, const D: usize = 2> {
    /// Identity, as in the scene file.
    pub index: u32,
    /// Where the paddle touches the undeformed boundary, length: in the plane the ends of its segment, in space opposite
    /// corners of the box around its patch.
    pub extent: [SVector<T, D>; 2],
    /// Largest norm of the displacement, length, > 0.
    pub max_displacement: T,
    /// Largest norm of the rate of displacement, length/s, > 0.
    pub max_rate: T,
}

impl<T: Scalar, const D: usize> Paddle<T, D> {
    /// The place of a paddle in a table that is to be filled.
    const fn none() -> Self {
        let zero = SVector::from_array_storage(ArrayStorage([[T::ZERO; D]; 1]));
        Self { index: 0, extent: [zero; 2], max_displacement: T::ZERO, max_rate: T::ZERO }
    }
}

/// Where the table holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Validity<T: Scalar> {
    /// Smallest depth: that of the first knot, length.
    pub depth_start: T,
    /// Largest depth: that of the last knot, length.
    pub depth_end: T,
    /// Largest norm of paddle displacement for which the model was solved, length, ≥ the paddle's limit.
    pub paddle_displacement: T,
    /// Largest needle speed for which the quasi-static model holds, length/s, > 0.
    pub needle_speed: T,
}

/// Controller settings that the table suggests; see [`crate::loop_stability`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Gains<T: Scalar> {
    /// Loop gain g per target sample, 0 < g < 1.
    pub loop_gain: T,
    /// Delay d of the loop that `loop_gain` was chosen for, target samples.
    pub delay_samples: u32,
    /// Largest |λ| of J·Ĵ⁻¹ over the model errors that the scene admits, ≥ 1.
    pub lambda_max: T,
}

/// The tissue at one needle depth, on the feed-forward path unless stated otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Knot<T: Scalar, const D: usize = 2, const P: usize = 1> {
    /// Needle depth, length.
    pub depth: T,
    /// Actuation Jacobian d(target displacement)/d(paddle displacement) of each paddle; rows target, columns paddle.
    #[serde(with = "each")]
    pub jacobian: [SMatrix<T, D, D>; P],
    /// Paddle displacements that make the orthogonal target displacement 0 (feed-forward), length; a column per paddle.
    pub paddle_path: SMatrix<T, D, P>,
    /// d(paddle path)/d(depth).
    pub paddle_path_slope: SMatrix<T, D, P>,
    /// Target displacement with the paddles on the path: the axial motion that remains, length.
    pub target_displacement: SVector<T, D>,
    /// d(target displacement)/d(depth) along the path.
    pub target_displacement_slope: SVector<T, D>,
    /// Target displacement with the paddles held at zero, length.
    pub static_target_displacement: SVector<T, D>,
}

/// Controller table; see the module documentation.
///
/// ```
/// use firmware::decode;
///
/// let table = decode::<f64, 2, 1, 1>(&std::fs::read("tests/planar.table")?)?;
/// let halfway = table.locate(0.5 * table.validity.depth_end).expect("a table has two knots at least");
/// // The paddle's path leaves the target where it is, orthogonally to the needle.
/// assert!(table.orthogonal.tr_mul(&halfway.target_displacement()).norm() < 1e-9);
/// assert!(table.locate(2.0 * table.validity.depth_end).is_some_and(|beyond| beyond.clamped));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Table<T: Scalar, const D: usize = 2, const N: usize = 1, const P: usize = 1> {
    /// SHA-256 of the scene that the table was computed from. Lives in the header of the file.
    #[serde(skip)]
    pub scene_hash: [u8; 32],
    /// Labels of units.
    pub units: Units,
    /// Which tissue was assumed, e.g. `homogeneous` or `inclusion`.
    pub tissue: String<32>,
    /// Identity and limits of each paddle.
    #[serde(with = "each")]
    pub paddles: [Paddle<T, D>; P],
    /// Unit vector along the insertion.
    pub needle_axis: SVector<T, D>,
    /// Directions orthogonal to the needle axis: orthonormal columns.
    pub orthogonal: SMatrix<T, D, N>,
    /// Rest position of the target, length.
    pub target_position: SVector<T, D>,
    /// Where the table holds.
    pub validity: Validity<T>,
    /// Suggested settings.
    pub gains: Gains<T>,
    /// At least two knots, depth strictly increasing.
    pub knots: Vec<Knot<T, D, P>, MAX_KNOTS>,
}

/// A table in the plane, where one paddle removes the one orthogonal direction.
pub type PlanarTable<T> = Table<T, 2, 1, 1>;

/// A table in space, where two directions are orthogonal to the needle.
pub type SpatialTable<T, const P: usize> = Table<T, 3, 2, P>;

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Table<T, D, N, P> {
    /// Refuses other numbers at compile time than those that frames have room for, and that make sense together.
    pub(crate) const SHAPE: () = {
        assert!(D >= 2 && D <= MAX_DIMENSION, "space has two or three dimensions");
        assert!(N + 1 == D, "there is one direction along the needle");
        assert!(P >= 1 && P <= MAX_PADDLES, "one paddle or two");
    };

    /// A table of zeros without knots, which validation refuses: the place for [`super::decode_into`] to fill.
    ///
    /// Constant, so that a microcontroller can keep it in a `static` and never on its stack (it is up to 31 KB in the plane, and 82 KB for
    /// two paddles in space).
    pub const fn empty() -> Self {
        let () = Self::SHAPE;
        let zero = SVector::from_array_storage(ArrayStorage([[T::ZERO; D]; 1]));
        let orthogonal = SMatrix::from_array_storage(ArrayStorage([[T::ZERO; D]; N]));
        Self {
            scene_hash: [0; 32],
            units: Units { length: String::new(), stress: String::new() },
            tissue: String::new(),
            paddles: [const { Paddle::none() }; P],
            needle_axis: zero,
            orthogonal,
            target_position: zero,
            validity: Validity {
                depth_start: T::ZERO,
                depth_end: T::ZERO,
                paddle_displacement: T::ZERO,
                needle_speed: T::ZERO,
            },
            gains: Gains { loop_gain: T::ZERO, delay_samples: 0, lambda_max: T::ZERO },
            knots: Vec::new(),
        }
    }

    /// The same table in another scalar type, every number rounded to nearest.
    ///
    /// The result is not validated: knots closer than the resolution of `U` fall together.
    pub fn cast<U: Scalar>(&self) -> Table<U, D, N, P> {
        let scalar = |x: T| U::of(x.to_f64());
        let vector = |v: &SVector<T, D>| v.map(scalar);
        Table {
            scene_hash: self.scene_hash,
            units: self.units.clone(),
            tissue: self.tissue.clone(),
            paddles: self.paddles.each_ref().map(|paddle| Paddle {
                index: paddle.index,
                extent: paddle.extent.map(|end| vector(&end)),
                max_displacement: scalar(paddle.max_displacement),
                max_rate: scalar(paddle.max_rate),
            }),
            needle_axis: vector(&self.needle_axis),
            orthogonal: self.orthogonal.map(scalar),
            target_position: vector(&self.target_position),
            validity: Validity {
                depth_start: scalar(self.validity.depth_start),
                depth_end: scalar(self.validity.depth_end),
                paddle_displacement: scalar(self.validity.paddle_displacement),
                needle_speed: scalar(self.validity.needle_speed),
            },
            gains: Gains {
                loop_gain: scalar(self.gains.loop_gain),
                delay_samples: self.gains.delay_samples,
                lambda_max: scalar(self.gains.lambda_max),
            },
            knots: self
                .knots
                .iter()
                .map(|knot| Knot {
                    depth: scalar(knot.depth),
                    jacobian: knot.jacobian.each_ref().map(|jacobian| jacobian.map(scalar)),
                    paddle_path: knot.paddle_path.map(scalar),
                    paddle_path_slope: knot.paddle_path_slope.map(scalar),
                    target_displacement: vector(&knot.target_displacement),
                    target_displacement_slope: vector(&knot.target_displacement_slope),
                    static_target_displacement: vector(&knot.static_target_displacement),
                })
                .collect(),
        }
    }
}
