//! What lies in shared memory: the frames of `firmware`, byte for byte, under explicit names.

use core::fmt::Debug;

use firmware::contract::frames::LAYOUT_VERSION;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use iceoryx2::prelude::ZeroCopySend;

/// A frame with its service and its type name in shared memory. Sealed: the list below has been looked at.
pub trait WireFrame: Copy + Debug + sealed::Plain + 'static {
    /// Name of the service that carries it; a second paddle's samples have one of their own.
    const SERVICE: &'static str;
    /// Name of the type with the version of its layout; peers with another one are refused.
    const TYPE_NAME: &'static str;
}

mod sealed {
    /// `repr(C)`, only integers and floats, no padding, no pointer.
    pub trait Plain {}
}

// The names below carry the layout version: a new layout needs new names.
const _: () = assert!(LAYOUT_VERSION == 2);

macro_rules! frames {
    ($($frame:ty: $service:literal, $type_name:literal;)*) => {
        $(
            impl sealed::Plain for $frame {}
            impl WireFrame for $frame {
                const SERVICE: &'static str = $service;
                const TYPE_NAME: &'static str = $type_name;
            }
        )*
    };
}

frames! {
    NeedleSample: "needle", "stillpoint.NeedleSample.v2";
    TargetSample: "target", "stillpoint.TargetSample.v2";
    PaddleSample: "paddle", "stillpoint.PaddleSample.v2";
    PaddleCommand: "command", "stillpoint.PaddleCommand.v2";
    ClockFrame: "clock", "stillpoint.ClockFrame.v2";
}

/// What a clock frame says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum ClockKind {
    /// Lockstep: all samples of this tick are published, answer with one command.
    Step = 1,
    /// Free-run: the plant's tick 0 is due at `time_ns`.
    Start = 2,
    /// The run is over; nothing was published after this.
    Stop = 3,
}

/// Plant to controller: when to act.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockFrame {
    /// [`ClockKind`] as a number.
    pub kind: u32,
    /// Zero; keeps the layout free of padding.
    pub reserved: u32,
    /// Number of the tick.
    pub tick: u64,
    /// Time of the tick, ns.
    pub time_ns: u64,
}

const _: () = assert!(size_of::<ClockFrame>() == 24 && align_of::<ClockFrame>() == 8);

impl ClockFrame {
    /// A frame of this kind.
    pub const fn new(kind: ClockKind, tick: u64, time_ns: u64) -> Self {
        Self { kind: kind as u32, reserved: 0, tick, time_ns }
    }

    /// The kind, if it is a known one: peers are not trusted.
    pub const fn kind(&self) -> Option<ClockKind> {
        match self.kind {
            1 => Some(ClockKind::Step),
            2 => Some(ClockKind::Start),
            3 => Some(ClockKind::Stop),
            _ => None,
        }
    }
}

/// A frame as it lies in shared memory.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Wire<F: WireFrame>(pub F);

// SAFETY: `WireFrame` is sealed; every type that implements it is `repr(C)` and made of integers and floats without
// padding (asserted at compile time here and in `firmware`), so that any bytes are a valid value and no pointer can
// leak. `Wire` is transparent. The type name is unique to the layout version.
#[allow(unsafe_code)]
unsafe impl<F: WireFrame> ZeroCopySend for Wire<F> {
    unsafe fn type_name() -> &'static str {
        F::TYPE_NAME
    }
}
