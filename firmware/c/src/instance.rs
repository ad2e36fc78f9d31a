//! A controller in memory of the caller.
//!
//! It is only ever reached by a raw pointer, and only by whoever holds it: [`Held::take`] marks it as busy, so that a call
//! from an interrupt or another thread is refused instead of sharing what must not be shared.
#![allow(unsafe_code)]

use core::ffi::c_void;
use core::fmt;
use core::mem::{align_of, size_of};
use core::ptr::NonNull;
use core::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

use firmware::contract::decode_labelled_into;
use firmware::{Controller, Inputs, Mode, PaddleCommand, Settings, SettingsError, State, Table, TableError};

use crate::memory;
use crate::status::StillpointStatus;
use crate::types::{STILLPOINT_MEMORY_ALIGNMENT, STILLPOINT_MEMORY_BYTES};

/// A controller; it lives in memory of the caller, who never looks inside, and never moves or copies it.
#[derive(Debug)]
pub struct Stillpoint {
    /// [`EMPTY`], [`IDLE`] or [`BUSY`].
    phase: AtomicU32,
    /// Its own address: what has been copied elsewhere is no controller.
    home: AtomicUsize,
    problem: Problem,
    state: State<f64>,
    /// Borrows `table`: while there is one, nobody writes the table.
    controller: Option<Controller<'static, f64>>,
    table: Table<f64, 2>,
}

/// Memory of the caller before its first use, and after its release.
const EMPTY: u32 = 0;
/// Numbers that memory seldom holds by chance.
const IDLE: u32 = 0x5717_1d1e;
const BUSY: u32 = 0x5717_b059;

// The header's promise, on every target that this is built for.
const _: () = assert!(size_of::<Stillpoint>() <= STILLPOINT_MEMORY_BYTES, "STILLPOINT_MEMORY_BYTES is too small");
const _: () = assert!(align_of::<Stillpoint>() <= STILLPOINT_MEMORY_ALIGNMENT, "the alignment is too small");

/// Why the last call failed.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Problem {
    /// It did not fail.
    None,
    /// What the status says.
    Status(StillpointStatus),
    Table(TableError),
    Settings(SettingsError),
}

/// What to do about it.
impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => Ok(()),
            Self::Status(status) => f.write_str(status.text().to_str().unwrap_or_default()),
            Self::Table(error) => error.fmt(f),
            Self::Settings(error) => error.fmt(f),
        }
    }
}

/// Makes a controller without a table.
///
/// # Errors
/// [`StillpointStatus::NullPointer`], [`Misaligned`](StillpointStatus::Misaligned),
/// [`MemoryTooSmall`](StillpointStatus::MemoryTooSmall), [`InUse`](StillpointStatus::InUse),
/// [`MemoryNotZero`](StillpointStatus::MemoryNotZero).
///
/// # Safety
/// `place` leads to `bytes` initialised bytes, which nobody else uses until the release.
pub(crate) unsafe fn place(place: *mut c_void, bytes: usize) -> Result<NonNull<Stillpoint>, StillpointStatus> {
    let place: *mut Stillpoint = place.cast();
    memory::check(place)?;
    if bytes < size_of::<Stillpoint>() {
        return Err(StillpointStatus::MemoryTooSmall);
    }
    let there = NonNull::new(place).ok_or(StillpointStatus::NullPointer)?;
    // SAFETY: aligned memory of sufficient size, initialised by the caller; both fields take any bits.
    let (phase, home) = unsafe { (&(*place).phase, &(*place).home) };
    if let Err(found) = phase.compare_exchange(EMPTY, BUSY, Ordering::Acquire, Ordering::Relaxed) {
        let lives = matches!(found, IDLE | BUSY) && home.load(Ordering::Relaxed) == place.addr();
        return Err(if lives { StillpointStatus::InUse } else { StillpointStatus::MemoryNotZero });
    }
    // Field by field: a whole one would stand on the stack first.
    // SAFETY: aligned memory of sufficient size, which the exchange above has made this call's own. Nothing that is
    // overwritten needs to be dropped.
    unsafe {
        (&raw mut (*place).problem).write(Problem::None);
        (&raw mut (*place).state).write(State::new());
        (&raw mut (*place).controller).write(None);
        (&raw mut (*place).table).write(Table::empty());
    }
    home.store(place.addr(), Ordering::Relaxed);
    phase.store(IDLE, Ordering::Release);
    Ok(there)
}

/// The sole use of a controller, until it is dropped.
pub(crate) struct Held(NonNull<Stillpoint>);

impl Held {
    /// # Errors
    /// [`StillpointStatus::NullPointer`], [`Misaligned`](StillpointStatus::Misaligned),
    /// [`NotInitialised`](StillpointStatus::NotInitialised), [`Busy`](StillpointStatus::Busy),
    /// [`Moved`](StillpointStatus::Moved).
    ///
    /// # Safety
    /// `pointer`, if neither null nor misaligned, leads to memory that [`place`] has been given, or that is zero.
    pub(crate) unsafe fn take(pointer: *mut Stillpoint) -> Result<Self, StillpointStatus> {
        memory::check(pointer)?;
        let there = NonNull::new(pointer).ok_or(StillpointStatus::NullPointer)?;
        // SAFETY: aligned, initialised memory; both fields take any bits, and are only ever used as atomics.
        let (phase, home) = unsafe { (&(*pointer).phase, &(*pointer).home) };
        if home.load(Ordering::Relaxed) != pointer.addr() {
            let moved = matches!(phase.load(Ordering::Relaxed), IDLE | BUSY);
            return Err(if moved { StillpointStatus::Moved } else { StillpointStatus::NotInitialised });
        }
        match phase.compare_exchange(IDLE, BUSY, Ordering::Acquire, Ordering::Relaxed) {
            Ok(_) => Ok(Self(there)),
            Err(BUSY) => Err(StillpointStatus::Busy),
            Err(_) => Err(StillpointStatus::NotInitialised),
        }
    }

    /// Takes a table, as long as nothing is configured.
    pub(crate) fn load(&mut self, bytes: &[u8]) -> Result<(), Problem> {
        if self.controller().is_some() {
            return Err(Problem::Status(StillpointStatus::AlreadyConfigured));
        }
        // SAFETY: initialised by `place`; this is the only hold, and without a controller nothing borrows the table.
        let table = unsafe { &mut (*self.0.as_ptr()).table };
        decode_labelled_into(bytes, table).map_err(Problem::Table)
    }

    /// The table, if one is loaded.
    pub(crate) fn table(&self) -> Result<&Table<f64, 2>, Problem> {
        // SAFETY: initialised by `place`; only `load` writes it, which needs this hold for itself.
        let table = unsafe { &(*self.0.as_ptr()).table };
        // What is refused leaves a table without knots.
        if table.knots.is_empty() { Err(Problem::Status(StillpointStatus::NoTable)) } else { Ok(table) }
    }

    fn controller(&self) -> Option<&Controller<'static, f64>> {
        // SAFETY: initialised by `place`; only `configure` writes it, which needs this hold for itself.
        unsafe { &(*self.0.as_ptr()).controller }.as_ref()
    }

    /// Builds the controller.
    pub(crate) fn configure(&mut self, settings: &Settings) -> Result<(), Problem> {
        if self.controller().is_some() {
            return Err(Problem::Status(StillpointStatus::AlreadyConfigured));
        }
        self.table()?;
        // SAFETY: initialised by `place`. Lives as long as the controller that borrows it: both end with the release, they
        // do not move (`home`), and as long as there is a controller, `load` does not write.
        let table: &'static Table<f64, 2> = unsafe { &(*self.0.as_ptr()).table };
        let controller = Controller::new(table, settings).map_err(Problem::Settings)?;
        // SAFETY: this is the only hold; nothing that is overwritten needs to be dropped.
        unsafe { (&raw mut (*self.0.as_ptr()).controller).write(Some(controller)) };
        Ok(())
    }

    fn state(&mut self) -> &mut State<f64> {
        // SAFETY: initialised by `place`; this is the only hold, and no other reference leads to this field.
        unsafe { &mut (*self.0.as_ptr()).state }
    }

    /// One tick.
    pub(crate) fn step(&mut self, inputs: &Inputs) -> Result<PaddleCommand, Problem> {
        // SAFETY: initialised by `place`; only `configure` writes it. Another field than the state.
        let controller = unsafe { &(*self.0.as_ptr()).controller };
        let controller = controller.as_ref().ok_or(Problem::Status(StillpointStatus::NotConfigured))?;
        Ok(controller.step(self.state(), inputs))
    }

    /// Leaves SAFE.
    pub(crate) fn rearm(&mut self) -> Result<(), Problem> {
        let state = self.state();
        if state.mode() != Mode::Safe {
            return Err(Problem::Status(StillpointStatus::NotSafe));
        }
        state.rearm();
        Ok(())
    }

    /// Why the last call failed.
    pub(crate) fn problem(&self) -> Problem {
        // SAFETY: initialised by `place`; this is the only hold.
        unsafe { (*self.0.as_ptr()).problem }
    }

    /// Keeps how this call ended.
    pub(crate) fn note(&mut self, problem: Problem) -> StillpointStatus {
        // SAFETY: initialised by `place`; this is the only hold, and no other reference leads to this field.
        unsafe { (*self.0.as_ptr()).problem = problem };
        match problem {
            Problem::None => StillpointStatus::Ok,
            Problem::Status(status) => status,
            Problem::Table(error) => error.into(),
            Problem::Settings(error) => error.into(),
        }
    }

    /// The end of the controller: the memory is as before its first use.
    pub(crate) fn release(self) {
        // SAFETY: initialised by `place`; only ever used as an atomic.
        unsafe { &(*self.0.as_ptr()).home }.store(0, Ordering::Relaxed);
        self.set_phase(EMPTY);
        core::mem::forget(self);
    }

    fn set_phase(&self, phase: u32) {
        // SAFETY: initialised by `place`; only ever used as an atomic.
        unsafe { &(*self.0.as_ptr()).phase }.store(phase, Ordering::Release);
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.set_phase(IDLE);
    }
}
