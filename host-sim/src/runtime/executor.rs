//! What computes the controller's steps: this process, or a board.

use std::time::Duration;

use clap::ValueEnum;
use firmware::contract::{Header, MAX_TABLE_BYTES, PaddleCommand, SpatialTable, Table, TableError, decode, encode};
use firmware::inputs::Ledger;
use firmware::scalar::{Scalar, ScalarKind};
use firmware::serial::Request;
use firmware::{Controller, Inputs, Settings, State};
use model_offline::scene::TableScalar;

use crate::exchange::board::device::scalar_of;
use crate::exchange::board::{BoardError, Control, Device, Image, Processor};
use crate::runtime::error::RuntimeError;

/// What computes the controller's steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, strum::IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Hardware {
    /// The controller's process itself.
    #[default]
    Native,
    /// The bare-metal image on a Cortex-M7 in QEMU, over a serial line; lockstep only.
    Qemu,
}

impl Hardware {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// The table in a number type; `bytes` are `table` in double precision.
///
/// # Errors
/// As [`encode_as`].
pub fn encode_in(scalar: TableScalar, table: &Table<f64, 2>, bytes: Vec<u8>) -> Result<Vec<u8>, TableError> {
    match scalar {
        TableScalar::F64 => Ok(bytes),
        TableScalar::F32 => encode_as(table, ScalarKind::F32),
    }
}

/// A controller at work, wherever its steps are computed.
pub trait StepExecutor {
    /// One tick.
    ///
    /// # Errors
    /// [`RuntimeError::Board`]: the step was not computed, or its command was lost.
    fn step(&mut self, inputs: &Inputs) -> Result<PaddleCommand, RuntimeError>;

    /// Leaves SAFE before the next tick, see [`State::rearm`].
    ///
    /// # Errors
    /// [`RuntimeError::Board`].
    fn rearm(&mut self) -> Result<(), RuntimeError>;

    /// Accounts at the end.
    ///
    /// # Errors
    /// [`RuntimeError::Board`].
    fn ledger(&mut self) -> Result<Ledger, RuntimeError>;
}

/// The controller in this process, in D dimensions with N directions orthogonal to the needle and P paddles.
#[derive(Debug)]
struct OnThisMachine<'t, T: Scalar, const D: usize, const N: usize, const P: usize> {
    controller: Controller<'t, T, D, N, P>,
    state: State<T, D, N, P>,
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize> StepExecutor for OnThisMachine<'_, T, D, N, P> {
    fn step(&mut self, inputs: &Inputs) -> Result<PaddleCommand, RuntimeError> {
        Ok(self.controller.step(&mut self.state, inputs))
    }

    fn rearm(&mut self) -> Result<(), RuntimeError> {
        self.state.rearm();
        Ok(())
    }

    fn ledger(&mut self) -> Result<Ledger, RuntimeError> {
        Ok(*self.state.ledger())
    }
}

/// The controller on a board.
#[derive(Debug)]
struct OnBoard {
    device: Device,
    patience: Duration,
}

impl StepExecutor for OnBoard {
    fn step(&mut self, inputs: &Inputs) -> Result<PaddleCommand, RuntimeError> {
        let silent = BoardError::Silent { to: "a step", silent_s: self.patience.as_secs_f64() };
        let answer = self.device.step(inputs, self.patience)?.ok_or(silent)?;
        Ok(answer.command)
    }

    fn rearm(&mut self) -> Result<(), RuntimeError> {
        Ok(self.device.tell(Request::Rearm)?)
    }

    fn ledger(&mut self) -> Result<Ledger, RuntimeError> {
        Ok(self.device.account()?.ledger)
    }
}

/// A table of whichever shape and scalar its file holds: the controller computes in that one.
#[derive(Clone, Debug)]
pub enum AnyTable {
    /// In the plane, single precision.
    F32(Box<Table<f32, 2>>),
    /// In the plane, double precision.
    F64(Box<Table<f64, 2>>),
    /// One paddle in space, single precision.
    OneF32(Box<SpatialTable<f32, 1>>),
    /// One paddle in space, double precision.
    OneF64(Box<SpatialTable<f64, 1>>),
    /// Two paddles in space, single precision.
    TwoF32(Box<SpatialTable<f32, 2>>),
    /// Two paddles in space, double precision.
    TwoF64(Box<SpatialTable<f64, 2>>),
}

/// The same with every shape and scalar of a table.
macro_rules! with_table {
    ($any:expr, $table:ident => $what:expr) => {
        match $any {
            AnyTable::F32($table) => $what,
            AnyTable::F64($table) => $what,
            AnyTable::OneF32($table) => $what,
            AnyTable::OneF64($table) => $what,
            AnyTable::TwoF32($table) => $what,
            AnyTable::TwoF64($table) => $what,
        }
    };
}

impl AnyTable {
    /// Decodes and validates.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn decode(bytes: &[u8]) -> Result<Self, TableError> {
        // What has no header that can be read is refused as a table in the plane.
        let shape = Header::read(bytes).map_or((2, 2), |header| (header.dimension, header.paddle_dof));
        Ok(match (shape, scalar_of(bytes)) {
            ((3, 3), Some(ScalarKind::F32)) => Self::OneF32(Box::new(decode(bytes)?)),
            ((3, 3), _) => Self::OneF64(Box::new(decode(bytes)?)),
            ((3, _), Some(ScalarKind::F32)) => Self::TwoF32(Box::new(decode(bytes)?)),
            ((3, _), _) => Self::TwoF64(Box::new(decode(bytes)?)),
            (_, Some(ScalarKind::F32)) => Self::F32(Box::new(decode(bytes)?)),
            (_, _) => Self::F64(Box::new(decode(bytes)?)),
        })
    }

    /// Deepest needle position that it covers, length.
    pub fn depth_end(&self) -> f64 {
        with_table!(self, table => table.validity.depth_end.to_f64())
    }

    /// SHA-256 of the scene that it was computed from.
    pub fn scene_hash(&self) -> [u8; 32] {
        with_table!(self, table => table.scene_hash)
    }

    /// Labels of its units of length and stress.
    pub fn units(&self) -> [String; 2] {
        with_table!(self, table => [table.units.length.as_str().to_owned(), table.units.stress.as_str().to_owned()])
    }

    /// Indices of its paddles.
    pub fn paddles(&self) -> Vec<u32> {
        with_table!(self, table => table.paddles.iter().map(|paddle| paddle.index).collect())
    }

    /// The controller in this process.
    ///
    /// # Errors
    /// [`RuntimeError::Settings`].
    pub fn on_this_machine(&self, settings: &Settings) -> Result<Box<dyn StepExecutor + '_>, RuntimeError> {
        with_table!(self, table => executor(table, settings))
    }
}

fn executor<'t, T: Scalar, const D: usize, const N: usize, const P: usize>(
    table: &'t Table<T, D, N, P>,
    settings: &Settings,
) -> Result<Box<dyn StepExecutor + 't>, RuntimeError> {
    Ok(Box::new(OnThisMachine { controller: Controller::new(table, settings)?, state: State::new() }))
}

/// The controller on a Cortex-M7 in QEMU, with this encoded table.
///
/// # Errors
/// [`RuntimeError::Board`].
pub fn on_emulated_board(
    table: &[u8],
    settings: &Settings,
    patience: Duration,
) -> Result<Box<dyn StepExecutor>, RuntimeError> {
    let mut device = Device::emulate(&image_for(table)?)?;
    device.begin(table, settings)?;
    Ok(Box::new(OnBoard { device, patience }))
}

/// The image that this encoded table is for, built for the board that is emulated; one for the plane where it is no table:
/// the board refuses it.
///
/// # Errors
/// [`BoardError`].
fn image_for(table: &[u8]) -> Result<Image, BoardError> {
    let (control, scalar) = match Header::read(table) {
        Ok(header) => (Control::of_table(&header)?, header.scalar),
        Err(_) => (Control::Plane, ScalarKind::F64),
    };
    Image::build_for(control, scalar, Processor::Double)
}

/// The table as another scalar, encoded.
///
/// # Errors
/// As [`encode`]: knots that fall together in the other scalar.
pub fn encode_as(table: &Table<f64, 2>, scalar: ScalarKind) -> Result<Vec<u8>, TableError> {
    let mut bytes = vec![0; MAX_TABLE_BYTES];
    let length = match scalar {
        ScalarKind::F32 => encode(&table.cast::<f32>(), &mut bytes),
        ScalarKind::F64 => encode(table, &mut bytes),
    };
    bytes.truncate(length?);
    Ok(bytes)
}
