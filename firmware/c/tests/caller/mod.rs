//! A program in C, written in Rust.

#![allow(dead_code)] // Each test uses some of it.

use std::ffi::c_void;

use firmware::contract::MAX_TABLE_BYTES;
use firmware::{Table, encode};
use stillpoint::api::*;
use stillpoint::types::*;
use stillpoint::{Stillpoint, StillpointStatus as Status};

/// A table that `firmware` itself is tested with.
pub(crate) fn table() -> &'static [u8] {
    include_bytes!("../../../tests/planar.table")
}

fn encoded<T: firmware::Scalar>(table: &Table<T, 2>) -> Vec<u8> {
    let mut bytes = vec![0; MAX_TABLE_BYTES];
    let length = encode(table, &mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

/// The same in single precision.
pub(crate) fn table_in_f32() -> Vec<u8> {
    encoded(&firmware::decode::<f64, 2, 1, 1>(table()).unwrap().cast::<f32>())
}

/// Intact, with a Jacobian of zeros: no writer of tables would let it pass.
pub(crate) fn singular_table() -> Vec<u8> {
    let good = firmware::decode::<f64, 2, 1, 1>(table()).unwrap();
    let mut bytes = encoded(&good);
    let first: Vec<u8> = good.knots[0].jacobian[0].iter().flat_map(|number| number.to_le_bytes()).collect();
    let place = bytes.windows(first.len()).position(|window| window == first).unwrap();
    bytes[place..place + first.len()].fill(0);
    let content = bytes.len() - 4;
    let checksum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes[..content]);
    bytes[content..].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

/// Memory for a controller; as large as the header says.
pub(crate) struct Memory(Box<[u64]>);

impl Memory {
    pub(crate) fn zeroed() -> Self {
        Self(vec![0; STILLPOINT_MEMORY_BYTES / 8].into())
    }

    pub(crate) fn filled(byte: u8) -> Self {
        Self(vec![u64::from_ne_bytes([byte; 8]); STILLPOINT_MEMORY_BYTES / 8].into())
    }

    pub(crate) fn copy_of(other: &Self) -> Self {
        let copy = Self::zeroed();
        // SAFETY: both of the same size. Bytes, whether initialised or not.
        unsafe {
            let (from, to) = (other.0.as_ptr().cast::<std::mem::MaybeUninit<u8>>(), copy.0.as_ptr().cast_mut().cast());
            std::ptr::copy_nonoverlapping(from, to, STILLPOINT_MEMORY_BYTES);
        }
        copy
    }

    pub(crate) fn start(&mut self) -> *mut c_void {
        self.0.as_mut_ptr().cast()
    }

    pub(crate) fn bytes(&self) -> usize {
        STILLPOINT_MEMORY_BYTES
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.is_filled(0)
    }

    pub(crate) fn is_filled(&self, byte: u8) -> bool {
        self.0.iter().all(|word| *word == u64::from_ne_bytes([byte; 8]))
    }
}

/// [`stillpoint_init`] as its caller sees it: on failure, the pointer is NULL.
pub(crate) fn init(start: *mut c_void, bytes: usize, version: u32) -> Result<*mut Stillpoint, Status> {
    let mut controller = std::ptr::without_provenance_mut(8);
    // SAFETY: memory of a `Memory`, or what is refused.
    let status = unsafe { stillpoint_init(start, bytes, version, &mut controller) };
    if status == Status::Ok {
        assert_eq!(controller.cast(), start);
        Ok(controller)
    } else {
        assert!(controller.is_null());
        Err(status)
    }
}

pub(crate) fn default_settings() -> StillpointSettings {
    let mut settings = StillpointSettings::default();
    // SAFETY: leads to a struct.
    let status = unsafe { stillpoint_default_settings(1_000_000, 20_000_000, 20_000_000, &mut settings) };
    assert_eq!(status, Status::Ok);
    settings
}

/// A program with one controller.
pub(crate) struct Caller {
    pub(crate) memory: Memory,
    pub(crate) controller: *mut Stillpoint,
    /// What the last step gave.
    pub(crate) command: StillpointCommand,
}

impl Caller {
    pub(crate) fn new() -> Self {
        let mut memory = Memory::zeroed();
        let controller = init(memory.start(), memory.bytes(), STILLPOINT_API_VERSION).unwrap();
        Self { memory, controller, command: StillpointCommand::default() }
    }

    pub(crate) fn configured() -> Self {
        let mut caller = Self::new();
        assert_eq!(caller.load(table()), Status::Ok);
        assert_eq!(caller.configure(&default_settings()), Status::Ok);
        caller
    }

    pub(crate) fn load(&mut self, bytes: &[u8]) -> Status {
        // SAFETY: a controller, or what is refused; the bytes of a slice.
        unsafe { stillpoint_load_table(self.controller, bytes.as_ptr(), bytes.len()) }
    }

    pub(crate) fn configure(&mut self, settings: &StillpointSettings) -> Status {
        // SAFETY: a controller, or what is refused; a struct.
        unsafe { stillpoint_configure(self.controller, settings) }
    }

    /// A step without samples, whose command is not the one before.
    pub(crate) fn step(&mut self, tick: u64) -> Status {
        let inputs = StillpointInputs { tick, time_ns: tick * 1_000_000, ..StillpointInputs::default() };
        self.command = StillpointCommand { mode: 99, flags: 99, ..StillpointCommand::default() };
        // SAFETY: a controller, or what is refused; structs.
        unsafe { stillpoint_step(self.controller, &inputs, &mut self.command) }
    }

    pub(crate) fn rearm(&mut self) -> Status {
        // SAFETY: a controller, or what is refused.
        unsafe { stillpoint_rearm(self.controller) }
    }

    pub(crate) fn release(&mut self) -> Status {
        // SAFETY: a controller, or what is refused.
        unsafe { stillpoint_release(self.controller) }
    }

    pub(crate) fn facts(&self) -> Result<StillpointTable, Status> {
        let mut facts = std::mem::MaybeUninit::uninit();
        // SAFETY: a controller, or what is refused; room for a struct.
        let status = unsafe { stillpoint_table(self.controller, facts.as_mut_ptr()) };
        // SAFETY: written, as the status says.
        if status == Status::Ok { Ok(unsafe { facts.assume_init() }) } else { Err(status) }
    }

    pub(crate) fn last_error(&self) -> String {
        let mut text = [0u8; 300];
        // SAFETY: a controller, or what is refused; room for that many bytes.
        let length = unsafe { stillpoint_last_error(self.controller, text.as_mut_ptr().cast(), text.len()) };
        assert!(length < text.len(), "texts fit");
        assert_eq!(text[length], 0);
        String::from_utf8(text[..length].to_vec()).unwrap()
    }
}
