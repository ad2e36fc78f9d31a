//! Where the controller's steps are computed: in this process, or on a board.

use std::time::Duration;

use clap::ValueEnum;
use firmware::contract::{PaddleCommand, Table, decode, encode};
use firmware::inputs::Ledger;
use firmware::scalar::{Scalar, ScalarKind};
use firmware::{Controller, Inputs, Settings, State};

use crate::error::SimError;
use crate::exchange::board::{BoardError, Device, Image, Processor, device::scalar_of};

/// What computes the controller's steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Hardware {
    /// The controller's process itself.
    #[default]
    Native,
    /// The bare-metal image on a Cortex-M7 in QEMU, over a serial line; lockstep only.
    Qemu,
}

impl Hardware {
    /// As on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Native => "native",
            Self::Qemu => "qemu",
        }
    }
}

/// The number type of the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ScalarChoice {
    /// Double precision.
    #[default]
    F64,
    /// Single precision.
    F32,
}

impl ScalarChoice {
    /// As tables name it.
    pub const fn kind(self) -> ScalarKind {
        match self {
            Self::F64 => ScalarKind::F64,
            Self::F32 => ScalarKind::F32,
        }
    }

    /// The table in this number type; `bytes` are `table` in double precision.
    ///
    /// # Errors
    /// As [`encode_as`].
    pub fn encode(self, table: &Table<f64, 2>, bytes: Vec<u8>) -> Result<Vec<u8>, SimError> {
        match self {
            Self::F64 => Ok(bytes),
            Self::F32 => encode_as(table, ScalarKind::F32),
        }
    }
}

/// A controller at work, wherever it is.
pub trait Core {
    /// One tick.
    ///
    /// # Errors
    /// [`SimError::Board`]: the step was not computed, or its command was lost.
    fn step(&mut self, inputs: &Inputs) -> Result<PaddleCommand, SimError>;

    /// Accounts at the end.
    ///
    /// # Errors
    /// [`SimError::Board`].
    fn ledger(&mut self) -> Result<Ledger, SimError>;
}

/// The controller in this process.
#[derive(Debug)]
struct Native<'t, T: Scalar> {
    controller: Controller<'t, T>,
    state: State<T>,
}

impl<T: Scalar> Core for Native<'_, T> {
    fn step(&mut self, inputs: &Inputs) -> Result<PaddleCommand, SimError> {
        Ok(self.controller.step(&mut self.state, inputs))
    }

    fn ledger(&mut self) -> Result<Ledger, SimError> {
        Ok(*self.state.ledger())
    }
}

/// The controller on a board.
#[derive(Debug)]
struct OnBoard {
    device: Device,
    patience: Duration,
}

impl Core for OnBoard {
    fn step(&mut self, inputs: &Inputs) -> Result<PaddleCommand, SimError> {
        let silent = BoardError::Silent { to: "a step", silent_s: self.patience.as_secs_f64() };
        let answer = self.device.step(inputs, self.patience)?.ok_or(silent)?;
        Ok(answer.command)
    }

    fn ledger(&mut self) -> Result<Ledger, SimError> {
        Ok(self.device.account()?.ledger)
    }
}

/// A table in whichever scalar its file holds: the controller computes in that one.
#[derive(Clone, Debug)]
pub enum AnyTable {
    /// Single precision.
    F32(Box<Table<f32, 2>>),
    /// Double precision.
    F64(Box<Table<f64, 2>>),
}

impl AnyTable {
    /// Decodes and validates.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn decode(bytes: &[u8]) -> Result<Self, firmware::contract::TableError> {
        Ok(match scalar_of(bytes) {
            Some(ScalarKind::F32) => Self::F32(Box::new(decode(bytes)?)),
            _ => Self::F64(Box::new(decode(bytes)?)),
        })
    }

    /// Deepest needle position that it covers, length.
    pub fn depth_end(&self) -> f64 {
        match self {
            Self::F32(table) => table.validity.depth_end.to_f64(),
            Self::F64(table) => table.validity.depth_end,
        }
    }

    /// SHA-256 of the scene that it was computed from.
    pub fn scene_hash(&self) -> [u8; 32] {
        match self {
            Self::F32(table) => table.scene_hash,
            Self::F64(table) => table.scene_hash,
        }
    }

    /// The controller in this process.
    ///
    /// # Errors
    /// [`SimError::Settings`].
    pub fn native(&self, settings: &Settings) -> Result<Box<dyn Core + '_>, SimError> {
        fn core<'t, T: Scalar>(table: &'t Table<T, 2>, settings: &Settings) -> Result<Box<dyn Core + 't>, SimError> {
            Ok(Box::new(Native { controller: Controller::new(table, settings)?, state: State::new() }))
        }
        match self {
            Self::F32(table) => core(table, settings),
            Self::F64(table) => core(table, settings),
        }
    }
}

/// The controller on a Cortex-M7 in QEMU, with this encoded table.
///
/// # Errors
/// [`SimError::Board`].
pub fn emulated(table: &[u8], settings: &Settings, patience: Duration) -> Result<Box<dyn Core>, SimError> {
    let scalar = scalar_of(table).unwrap_or(ScalarKind::F64);
    let mut device = Device::emulate(&Image::build(scalar, Processor::Double)?)?;
    device.begin(table, settings)?;
    Ok(Box::new(OnBoard { device, patience }))
}

/// The table as another scalar, encoded.
///
/// # Errors
/// [`SimError::Table`] for knots that fall together in the other scalar.
pub fn encode_as(table: &Table<f64, 2>, scalar: ScalarKind) -> Result<Vec<u8>, SimError> {
    let mut bytes = vec![0; firmware::contract::MAX_TABLE_BYTES];
    let length = match scalar {
        ScalarKind::F32 => encode(&table.cast::<f32>(), &mut bytes),
        ScalarKind::F64 => encode(table, &mut bytes),
    };
    bytes.truncate(length.map_err(|source| SimError::Table { path: "as another scalar".into(), source })?);
    Ok(bytes)
}
