//! The exported functions. What each asks of its caller stands in its documentation, which is the header's.
#![allow(unsafe_code)]

use core::ffi::{CStr, c_char, c_void};
use core::mem::{align_of, size_of};
use core::ptr;

use firmware::{Faults, Inputs, Mode, Settings};

use crate::instance::{Held, Problem, Stillpoint, place};
use crate::memory;
use crate::status::StillpointStatus;
use crate::text;
use crate::types::*;

/// Of the package, with the 0 that C needs.
const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
    Ok(version) => version,
    Err(_) => c"",
};

/// Version of the library as a text, for example "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn stillpoint_version() -> *const c_char {
    VERSION.as_ptr()
}

/// Version of the interface: `STILLPOINT_API_VERSION` of the header that belongs to this library.
#[unsafe(no_mangle)]
pub extern "C" fn stillpoint_api_version() -> u32 {
    STILLPOINT_API_VERSION
}

/// Bytes of memory that a controller needs; at most `STILLPOINT_MEMORY_BYTES`.
#[unsafe(no_mangle)]
pub extern "C" fn stillpoint_memory_bytes() -> usize {
    size_of::<Stillpoint>()
}

/// Alignment of that memory, bytes; at most `STILLPOINT_MEMORY_ALIGNMENT`.
#[unsafe(no_mangle)]
pub extern "C" fn stillpoint_memory_alignment() -> usize {
    align_of::<Stillpoint>()
}

/// What a status means and what to do about it, in English. Never NULL; for a number that is no status, it says so.
#[unsafe(no_mangle)]
pub extern "C" fn stillpoint_status_text(status: u32) -> *const c_char {
    StillpointStatus::from_number(status).map_or(c"a status of another version of the library", |s| s.text()).as_ptr()
}

/// Name of a mode: "HOLD", "RUN" or "SAFE"; "?" for any other number.
#[unsafe(no_mangle)]
pub extern "C" fn stillpoint_mode_name(mode: u32) -> *const c_char {
    let name = match Mode::from_wire(mode) {
        Some(Mode::Hold) => c"HOLD",
        Some(Mode::Run) => c"RUN",
        Some(Mode::Safe) => c"SAFE",
        None => c"?",
    };
    name.as_ptr()
}

/// Writes the names of a set of faults, as "TARGET_LOST | OVERRUN", or "NONE".
///
/// As `snprintf`: writes at most `text_bytes` bytes with a 0 at the end, and returns the length of the whole text without
/// it. `text` may be NULL.
///
/// # Safety
/// `text_bytes` bytes may be written to `text`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_fault_names(faults: u64, text: *mut c_char, text_bytes: usize) -> usize {
    // SAFETY: the caller's promise.
    let room = unsafe { memory::text_room(text.cast(), text_bytes) };
    text::write(room, format_args!("{}", Faults::from_bits(faults)))
}

/// Makes a controller in `memory` and writes its address, which is that of the memory, to `controller`. It has no table yet.
///
/// The memory must be zero before its first use, as static memory is. Until `stillpoint_release` it is the controller's:
/// not to be written, copied or moved. On failure `controller` is set to NULL.
///
/// @param api_version `STILLPOINT_API_VERSION`
///
/// # Safety
/// `memory_bytes` bytes may be read and written at `memory`; nobody else uses them until the release.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_init(
    memory: *mut c_void,
    memory_bytes: usize,
    api_version: u32,
    controller: *mut *mut Stillpoint,
) -> StillpointStatus {
    // SAFETY: the caller's promise, here and below.
    if let Err(status) = unsafe { memory::write(controller, ptr::null_mut()) } {
        return status;
    }
    if api_version != STILLPOINT_API_VERSION {
        return StillpointStatus::ApiVersion;
    }
    // SAFETY: as above.
    match unsafe { place(memory, memory_bytes) }.and_then(|there| unsafe { memory::write(controller, there.as_ptr()) })
    {
        Ok(()) => StillpointStatus::Ok,
        Err(status) => status,
    }
}

/// Ends a controller: its memory is the caller's again, and may be given to `stillpoint_init` as it is.
///
/// # Safety
/// `controller` comes from `stillpoint_init`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_release(controller: *mut Stillpoint) -> StillpointStatus {
    // SAFETY: the caller's promise.
    match unsafe { Held::take(controller) } {
        Ok(held) => {
            held.release();
            StillpointStatus::Ok
        }
        Err(status) => status,
    }
}

/// Does something with a controller, and notes how it ended.
///
/// # Safety
/// `controller` comes from `stillpoint_init`.
unsafe fn with(controller: *mut Stillpoint, act: impl FnOnce(&mut Held) -> Result<(), Problem>) -> StillpointStatus {
    // SAFETY: the caller's promise.
    match unsafe { Held::take(controller) } {
        Ok(mut held) => {
            let problem = act(&mut held).err().unwrap_or(Problem::None);
            held.note(problem)
        }
        Err(status) => status,
    }
}

/// Checks and decodes a table: the bytes of a file as `model-offline table` writes it, which are not needed afterwards.
///
/// A table that is refused leaves the controller without one. Not after `stillpoint_configure`.
///
/// # Safety
/// `controller` comes from `stillpoint_init`; `table_bytes` bytes may be read at `table`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_load_table(
    controller: *mut Stillpoint,
    table: *const u8,
    table_bytes: usize,
) -> StillpointStatus {
    // SAFETY: the caller's promise.
    unsafe { with(controller, |held| held.load(memory::table_bytes(table, table_bytes).map_err(Problem::Status)?)) }
}

/// Tells what the loaded table is for. Compare it with what is attached before anything moves: the unit of length most of
/// all, which no check can know.
///
/// # Safety
/// `controller` comes from `stillpoint_init`; a struct may be written to `table`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_table(
    controller: *mut Stillpoint,
    table: *mut StillpointTable,
) -> StillpointStatus {
    // SAFETY: the caller's promise.
    unsafe { with(controller, |held| memory::write(table, held.table()?.into()).map_err(Problem::Status)) }
}

/// Fills in the settings for a loop and a target sensor with these periods and this latency; everything else has its
/// default, and may be changed afterwards.
///
/// @param loop_period_ns period of the loop, ns
/// @param target_period_ns period of the target sensor, ns
/// @param target_latency_ns longest time from the measurement of the target to its arrival, ns
///
/// # Safety
/// A struct may be written to `settings`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_default_settings(
    loop_period_ns: u64,
    target_period_ns: u64,
    target_latency_ns: u64,
    settings: *mut StillpointSettings,
) -> StillpointStatus {
    let defaults = Settings::new(loop_period_ns, target_period_ns, target_latency_ns);
    // SAFETY: the caller's promise.
    match unsafe { memory::write(settings, (&defaults).into()) } {
        Ok(()) => StillpointStatus::Ok,
        Err(status) => status,
    }
}

/// Checks the settings, and makes the controller ready for its first step. Once per controller.
///
/// # Safety
/// `controller` comes from `stillpoint_init`; `settings` leads to a struct.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_configure(
    controller: *mut Stillpoint,
    settings: *const StillpointSettings,
) -> StillpointStatus {
    let configure = |held: &mut Held| {
        // SAFETY: the caller's promise, here and below.
        let settings = unsafe { memory::read(settings) }.and_then(|settings| Settings::try_from(&settings));
        held.configure(&settings.map_err(Problem::Status)?)
    };
    // SAFETY: as above.
    unsafe { with(controller, configure) }
}

/// One tick: checks the inputs, decides the mode, and gives the command for the paddle. Once per period of the loop, also
/// when nothing has arrived.
///
/// If it fails, `command` (unless it is NULL or misaligned) says SAFE and has nothing to execute.
///
/// # Safety
/// `controller` comes from `stillpoint_init`; `inputs` leads to a struct, and a struct may be written to `command`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_step(
    controller: *mut Stillpoint,
    inputs: *const StillpointInputs,
    command: *mut StillpointCommand,
) -> StillpointStatus {
    // The control of the proof that no panic can be reached: with this, the test that looks for one must find it.
    #[cfg(panic_control)]
    core::hint::black_box(None::<u32>).unwrap();
    let step = |held: &mut Held| {
        // Before the step: what it gave could not be told otherwise.
        memory::check(command).map_err(Problem::Status)?;
        // SAFETY: the caller's promise, here and below.
        let inputs = unsafe { memory::read(inputs) }.and_then(|inputs| Inputs::try_from(&inputs));
        let given = held.step(&inputs.map_err(Problem::Status)?)?;
        // SAFETY: as above.
        unsafe { memory::write(command, (&given).into()) }.map_err(Problem::Status)
    };
    // SAFETY: as above.
    let status = unsafe { with(controller, step) };
    if status != StillpointStatus::Ok {
        // What cannot be written was refused above, and its reason is the status.
        // SAFETY: as above.
        let _ = unsafe { memory::write(command, StillpointCommand::NONE) };
    }
    status
}

/// Leaves SAFE, after somebody has looked: the paddle's measured position is adopted once more.
///
/// # Safety
/// `controller` comes from `stillpoint_init`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_rearm(controller: *mut Stillpoint) -> StillpointStatus {
    // SAFETY: the caller's promise.
    unsafe { with(controller, Held::rearm) }
}

/// Writes why the last call for this controller failed and what to do, with the numbers that `stillpoint_status_text` does
/// not know; nothing if it did not fail.
///
/// As `snprintf`: writes at most `text_bytes` bytes with a 0 at the end, and returns the length of the whole text without
/// it. `text` may be NULL. Of a pointer that is no controller it tells that.
///
/// # Safety
/// `controller` is NULL or comes from `stillpoint_init`; `text_bytes` bytes may be written to `text`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stillpoint_last_error(
    controller: *mut Stillpoint,
    text: *mut c_char,
    text_bytes: usize,
) -> usize {
    // SAFETY: the caller's promise, here and below.
    let problem = match unsafe { Held::take(controller) } {
        Ok(held) => held.problem(),
        Err(status) => Problem::Status(status),
    };
    // SAFETY: as above.
    let room = unsafe { memory::text_room(text.cast(), text_bytes) };
    text::write(room, format_args!("{problem}"))
}
