//! What a caller may get wrong: every mistake has its status and its text, and none does any damage.
#![allow(unsafe_code)]

mod caller;

use std::ffi::{CStr, c_void};
use std::ptr::{null, null_mut};

use caller::{Caller, Memory, default_settings, table};
use stillpoint::StillpointStatus as Status;
use stillpoint::api::*;
use stillpoint::faults::*;
use stillpoint::types::*;

#[test]
fn memory_is_checked_before_it_is_used() {
    let mut memory = Memory::zeroed();
    let (start, bytes) = (memory.start(), stillpoint_memory_bytes());
    assert!(bytes <= STILLPOINT_MEMORY_BYTES && stillpoint_memory_alignment() <= STILLPOINT_MEMORY_ALIGNMENT);
    let init = |start, bytes| caller::init(start, bytes, STILLPOINT_API_VERSION);
    assert_eq!(init(null_mut(), bytes), Err(Status::NullPointer));
    for offset in 1..stillpoint_memory_alignment() {
        assert_eq!(init(start.wrapping_byte_add(offset), bytes), Err(Status::Misaligned), "{offset}");
    }
    for short in [0, 1, bytes - 1] {
        assert_eq!(init(start, short), Err(Status::MemoryTooSmall), "{short}");
    }
    for version in [0, STILLPOINT_API_VERSION + 1, u32::MAX] {
        assert_eq!(caller::init(start, bytes, version), Err(Status::ApiVersion), "{version}");
    }
    assert!(memory.is_zero(), "what is refused is left as it is");
    // SAFETY: NULL is what is tested.
    assert_eq!(unsafe { stillpoint_init(start, bytes, STILLPOINT_API_VERSION, null_mut()) }, Status::NullPointer);
    assert!(memory.is_zero());
    init(start, bytes).unwrap();
}

#[test]
fn memory_that_is_not_zero_is_refused() {
    let mut memory = Memory::filled(0xa5);
    assert_eq!(caller::init(memory.start(), memory.bytes(), STILLPOINT_API_VERSION), Err(Status::MemoryNotZero));
    assert!(memory.is_filled(0xa5));
}

#[test]
fn nothing_is_initialised_twice_or_used_after_its_release() {
    let mut caller = Caller::configured();
    let again = caller::init(caller.memory.start(), caller.memory.bytes(), STILLPOINT_API_VERSION);
    assert_eq!(again, Err(Status::InUse));
    // The first one has not noticed.
    assert_eq!(caller.step(0), Status::Ok);
    assert_eq!(caller.release(), Status::Ok);
    assert_eq!(caller.step(1), Status::NotInitialised);
    assert_eq!(caller.release(), Status::NotInitialised);
    // As it is, for a new one, which knows nothing of the first.
    caller.controller = caller::init(caller.memory.start(), caller.memory.bytes(), STILLPOINT_API_VERSION).unwrap();
    assert_eq!(caller.step(0), Status::NotConfigured);
    assert_eq!(caller.configure(&default_settings()), Status::NoTable);
}

#[test]
fn a_copy_is_no_controller() {
    let mut caller = Caller::configured();
    let mut copy = Memory::copy_of(&caller.memory);
    caller.controller = copy.start().cast();
    assert_eq!(caller.step(0), Status::Moved);
    assert_eq!(caller::init(copy.start(), copy.bytes(), STILLPOINT_API_VERSION), Err(Status::MemoryNotZero));
    caller.controller = caller.memory.start().cast();
    assert_eq!(caller.step(0), Status::Ok);
}

#[test]
fn zeros_and_null_are_no_controllers() {
    let mut zeros = Memory::zeroed();
    for (controller, status) in [
        (null_mut(), Status::NullPointer),
        (zeros.start(), Status::NotInitialised),
        (zeros.start().wrapping_byte_add(4), Status::Misaligned),
    ] {
        let mut caller = Caller::configured();
        caller.controller = controller.cast();
        assert_eq!(caller.step(0), status);
        assert_eq!(caller.command.mode, STILLPOINT_MODE_SAFE, "a command of nobody moves nothing");
        assert_eq!(caller.command.flags, 0);
        assert_eq!(caller.load(table()), status);
        assert_eq!(caller.configure(&default_settings()), status);
        assert_eq!(caller.rearm(), status);
        assert_eq!(caller.facts().err(), Some(status));
        assert_eq!(caller.release(), status);
        // SAFETY: a text that lives for ever.
        let text = unsafe { CStr::from_ptr(stillpoint_status_text(status as u32)) };
        assert_eq!(caller.last_error(), text.to_str().unwrap());
    }
}

#[test]
fn pointers_to_structs_are_checked() {
    let mut caller = Caller::configured();
    let controller = caller.controller;
    let (mut room, mut inputs) = ([0u64; 32], StillpointInputs::default());
    let aside = room.as_mut_ptr().wrapping_byte_add(1);
    // SAFETY: NULL and misaligned pointers are what is tested; the others lead to structs.
    unsafe {
        let mut command = StillpointCommand::default();
        assert_eq!(stillpoint_step(controller, null(), &mut command), Status::NullPointer);
        assert_eq!((command.mode, command.flags), (STILLPOINT_MODE_SAFE, 0));
        assert_eq!(stillpoint_step(controller, aside.cast(), &mut command), Status::Misaligned);
        assert_eq!(stillpoint_step(controller, &inputs, null_mut()), Status::NullPointer);
        assert_eq!(stillpoint_step(controller, &inputs, aside.cast()), Status::Misaligned);
        assert_eq!(stillpoint_default_settings(1, 1, 1, null_mut()), Status::NullPointer);
        assert_eq!(stillpoint_default_settings(1, 1, 1, aside.cast()), Status::Misaligned);
        assert_eq!(stillpoint_table(controller, null_mut()), Status::NullPointer);
        assert_eq!(stillpoint_table(controller, aside.cast()), Status::Misaligned);
    }
    assert_eq!(room, [0; 32], "nothing is written where a pointer is refused");
    for (arrived, reserved) in [(8, 0), (u32::MAX, 0), (0, 1)] {
        (inputs.arrived, inputs.reserved) = (arrived, reserved);
        let mut command = StillpointCommand::default();
        // SAFETY: both lead to structs.
        assert_eq!(unsafe { stillpoint_step(controller, &inputs, &mut command) }, Status::UnknownOption);
        assert_eq!((command.mode, command.flags), (STILLPOINT_MODE_SAFE, 0));
    }
    // None of them was a tick: there would be a command that nobody has seen.
    assert_eq!((caller.step(0), caller.command.sequence), (Status::Ok, 0));
    let mut fresh = Caller::new();
    // SAFETY: NULL and misaligned pointers are what is tested.
    unsafe {
        assert_eq!(stillpoint_load_table(fresh.controller, null(), 10), Status::NullPointer);
        assert_eq!(stillpoint_load_table(fresh.controller, table().as_ptr(), usize::MAX), Status::TableDamaged);
        assert_eq!(stillpoint_load_table(fresh.controller, table().as_ptr(), 0), Status::TableDamaged);
    }
    assert_eq!(fresh.load(table()), Status::Ok);
    // SAFETY: as above.
    unsafe {
        assert_eq!(stillpoint_configure(fresh.controller, null()), Status::NullPointer);
        assert_eq!(stillpoint_configure(fresh.controller, aside.cast()), Status::Misaligned);
    }
    assert_eq!(fresh.configure(&default_settings()), Status::Ok);
}

#[test]
fn damaged_tables_are_refused_by_what_is_wrong_with_them() {
    let mut caller = Caller::new();
    let changed = |place: usize, to: u8| {
        let mut bytes = table().to_vec();
        bytes[place] = to;
        bytes
    };
    for (bytes, status, says) in [
        (changed(0, b'X'), Status::NotATable, "not a controller table"),
        (changed(8, 1), Status::TableVersion, "version 1"),
        (table()[..table().len() - 1].to_vec(), Status::TableDamaged, "missing"),
        ([table(), b"x"].concat(), Status::TableDamaged, "follow the table"),
        (changed(200, 0xff), Status::TableDamaged, "checksum"),
        (changed(14, 1), Status::TableDamaged, "reserved"),
        (b"short".to_vec(), Status::TableDamaged, "5 bytes cannot hold"),
        (caller::table_in_f32(), Status::TableScalar, "write it as f64"),
        (caller::singular_table(), Status::TableInvalid, "singular"),
    ] {
        // A good table before does not stay behind a bad one.
        assert_eq!(caller.load(table()), Status::Ok);
        assert_eq!(caller.last_error(), "");
        assert_eq!(caller.load(&bytes), status, "{says}");
        let text = caller.last_error();
        assert!(text.contains(says), "{text}");
        assert_eq!(caller.facts().err(), Some(Status::NoTable));
        assert_eq!(caller.configure(&default_settings()), Status::NoTable);
    }
    for bit in 0..8 * table().len() {
        let mut bytes = table().to_vec();
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert_ne!(caller.load(&bytes), Status::Ok, "bit {bit}");
    }
}

#[test]
fn calls_in_another_order_are_refused() {
    let mut caller = Caller::new();
    assert_eq!(caller.configure(&default_settings()), Status::NoTable);
    assert_eq!(caller.load(table()), Status::Ok);
    assert_eq!(caller.step(0), Status::NotConfigured);
    assert_eq!(caller.rearm(), Status::NotSafe);
    assert_eq!(caller.configure(&default_settings()), Status::Ok);
    assert_eq!(caller.load(table()), Status::AlreadyConfigured);
    assert_eq!(caller.configure(&default_settings()), Status::AlreadyConfigured);
    assert_eq!(caller.step(0), Status::Ok);
    assert_eq!(caller.rearm(), Status::NotSafe);
}

#[test]
fn settings_are_refused_and_may_be_corrected() {
    let mut caller = Caller::new();
    assert_eq!(caller.load(table()), Status::Ok);
    let good = default_settings();
    for (settings, status, says) in [
        (StillpointSettings { loop_period_ns: 0, ..good }, Status::InvalidSettings, "loop period must be above 0"),
        (StillpointSettings { target_period_ns: 1, ..good }, Status::InvalidSettings, "raise the loop rate"),
        (StillpointSettings { loop_gain: f64::NAN, ..good }, Status::InvalidSettings, "loop gain"),
        (StillpointSettings { loop_gain: -1.0, ..good }, Status::InvalidSettings, "loop gain"),
        (StillpointSettings { lambda_max: 0.5, ..good }, Status::InvalidSettings, "lambda_max"),
        (StillpointSettings { following_error_lu: -1.0, ..good }, Status::InvalidSettings, "following error"),
        (StillpointSettings { target_noise_lu: f64::INFINITY, ..good }, Status::InvalidSettings, "target noise"),
        (StillpointSettings { feedback: 3, ..good }, Status::UnknownOption, "stillpoint_default_settings"),
        (StillpointSettings { direction: 2, ..good }, Status::UnknownOption, "constants"),
        (StillpointSettings { position_limit: u32::MAX, ..good }, Status::UnknownOption, "constants"),
        (StillpointSettings { reserved: 1, ..good }, Status::UnknownOption, "reserved"),
    ] {
        assert_eq!(caller.configure(&settings), status, "{says}");
        let text = caller.last_error();
        assert!(text.contains(says), "{text}");
        assert_eq!(caller.step(0), Status::NotConfigured);
    }
    assert_eq!(caller.configure(&good), Status::Ok);
}

#[test]
fn the_table_says_what_it_is_for() {
    let caller = Caller::configured();
    let facts = caller.facts().unwrap();
    let known = firmware::decode::<f64, 2, 1, 1>(table()).unwrap();
    // SAFETY: ends with 0, as the header says.
    let unit = unsafe { CStr::from_ptr(facts.length_unit.as_ptr()) };
    assert_eq!(unit.to_str().unwrap(), known.units.length.as_str());
    assert_eq!((facts.scene_hash, facts.paddle_index, facts.knots), (known.scene_hash, 3, 11));
    assert_eq!((facts.max_displacement_lu, facts.max_rate_lu_per_s), (0.05, 0.1));
    assert_eq!((facts.depth_start_lu, facts.depth_end_lu), (0.0, known.validity.depth_end));
    assert_eq!((facts.needle_axis, facts.target_position_lu), ([0.0, -1.0], [0.5, 0.5]));
    assert_eq!(facts.needle_speed_lu_per_s, known.validity.needle_speed);
}

#[test]
fn every_status_has_its_own_text_and_unknown_numbers_have_one() {
    let text = |status: u32| {
        // SAFETY: a text that lives for ever.
        unsafe { CStr::from_ptr(stillpoint_status_text(status)) }.to_str().unwrap()
    };
    let texts: std::collections::BTreeSet<&str> = Status::ALL.iter().map(|status| text(*status as u32)).collect();
    assert_eq!(texts.len(), Status::ALL.len());
    for unknown in [16, 99, u32::MAX] {
        assert!(text(unknown).contains("another version"), "{unknown}");
    }
    // SAFETY: as above.
    let names = [0, 1, 2, 3, 4].map(|mode| unsafe { CStr::from_ptr(stillpoint_mode_name(mode)) }.to_str().unwrap());
    assert_eq!(names, ["?", "HOLD", "RUN", "SAFE", "?"]);
    // SAFETY: as above.
    let version = unsafe { CStr::from_ptr(stillpoint_version()) };
    assert_eq!(version.to_str().unwrap(), env!("CARGO_PKG_VERSION"));
    assert_eq!(stillpoint_api_version(), STILLPOINT_API_VERSION);
}

#[test]
fn texts_fit_the_room_that_they_are_given() {
    let names = |text: *mut i8, bytes| {
        // SAFETY: room for that many bytes, or NULL.
        unsafe { stillpoint_fault_names(STILLPOINT_FAULT_TARGET_LOST | STILLPOINT_FAULT_OVERRUN, text.cast(), bytes) }
    };
    let whole = "TARGET_LOST | OVERRUN".len();
    assert_eq!(names(null_mut(), 100), whole);
    let mut room = [7i8; 12];
    assert_eq!(names(room.as_mut_ptr(), 0), whole);
    assert_eq!(room, [7; 12]);
    assert_eq!(names(room.as_mut_ptr(), 7), whole);
    assert_eq!(room.map(|byte| byte as u8), *b"TARGET\0\x07\x07\x07\x07\x07");
}

/// A call that comes between: an interrupt, or another thread.
#[test]
fn a_call_during_another_is_refused() {
    let mut caller = Caller::configured();
    let controller = caller.controller.addr();
    let stop = std::sync::atomic::AtomicBool::new(false);
    let refused = std::thread::scope(|scope| {
        let other = scope.spawn(|| {
            let mut refused = 0u64;
            while !stop.load(std::sync::atomic::Ordering::Relaxed) {
                // SAFETY: the address of a controller, which refuses what comes between.
                let status =
                    unsafe { stillpoint_rearm(std::ptr::with_exposed_provenance_mut::<c_void>(controller).cast()) };
                assert!(matches!(status, Status::Busy | Status::NotSafe), "{status:?}");
                refused += u64::from(status == Status::Busy);
            }
            refused
        });
        let mut tick = 0;
        let start = std::time::Instant::now();
        // Until one has come between from either side; on a machine with one processor, for some seconds at most.
        let mut busy = 0;
        while busy < 10 && start.elapsed().as_secs() < 5 {
            match caller.step(tick) {
                Status::Ok => tick += 1,
                Status::Busy => {
                    assert_eq!((caller.command.mode, caller.command.flags), (STILLPOINT_MODE_SAFE, 0));
                    busy += 1;
                }
                status => panic!("{status:?}"),
            }
        }
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
        other.join().unwrap() + busy
    });
    assert!(refused > 0);
}
