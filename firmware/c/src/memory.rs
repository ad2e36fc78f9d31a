//! Pointers of the caller: null and alignment are checked before anything is read or written.
//!
//! That a pointer leads to memory of the right size, which nobody else uses meanwhile, cannot be checked: it is what every
//! function here, and everything exported, asks of its caller.
#![allow(unsafe_code)]

use core::mem::MaybeUninit;

use crate::status::StillpointStatus;

/// Whether `pointer` may point to a `T`.
///
/// # Errors
/// [`StillpointStatus::NullPointer`], [`StillpointStatus::Misaligned`].
pub fn check<T>(pointer: *const T) -> Result<(), StillpointStatus> {
    if pointer.is_null() {
        Err(StillpointStatus::NullPointer)
    } else if !pointer.is_aligned() {
        Err(StillpointStatus::Misaligned)
    } else {
        Ok(())
    }
}

/// What `pointer` points to.
///
/// # Errors
/// As [`check`].
///
/// # Safety
/// If it is neither null nor misaligned, it points to an initialised `T` that nobody writes meanwhile.
pub unsafe fn read<T: Copy>(pointer: *const T) -> Result<T, StillpointStatus> {
    check(pointer)?;
    // SAFETY: not null, aligned; the rest is what the caller promises.
    Ok(unsafe { pointer.read() })
}

/// Writes `value` to where `pointer` points.
///
/// # Errors
/// As [`check`].
///
/// # Safety
/// If it is neither null nor misaligned, it points to memory for a `T` that nobody else uses meanwhile.
pub unsafe fn write<T: Copy>(pointer: *mut T, value: T) -> Result<(), StillpointStatus> {
    check(pointer)?;
    // SAFETY: not null, aligned; the rest is what the caller promises.
    unsafe { pointer.write(value) };
    Ok(())
}

/// Bytes of the caller.
///
/// # Errors
/// [`StillpointStatus::NullPointer`]; [`StillpointStatus::TableDamaged`] for a length that no table has.
///
/// # Safety
/// If `start` is not null, `length` initialised bytes are there, which nobody writes during `'a`.
pub unsafe fn table_bytes<'a>(start: *const u8, length: usize) -> Result<&'a [u8], StillpointStatus> {
    check(start)?;
    if length > firmware::contract::MAX_TABLE_BYTES {
        return Err(StillpointStatus::TableDamaged);
    }
    // SAFETY: not null, any address is aligned for bytes, far shorter than half of the address space; the rest is what the
    // caller promises.
    Ok(unsafe { core::slice::from_raw_parts(start, length) })
}

/// Room of the caller for a text; none if `start` is null.
///
/// # Safety
/// If `start` is not null, `length` bytes are there, which nobody else uses during `'a`.
pub unsafe fn text_room<'a>(start: *mut u8, length: usize) -> &'a mut [MaybeUninit<u8>] {
    if start.is_null() || length > isize::MAX as usize {
        return &mut [];
    }
    // SAFETY: not null, any address is aligned for bytes, bytes need not be initialised; the rest is what the caller
    // promises.
    unsafe { core::slice::from_raw_parts_mut(start.cast(), length) }
}
