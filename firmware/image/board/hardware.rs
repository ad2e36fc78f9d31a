//! Registers, exceptions and memory of the board: the only unsafe code of the image.
//!
//! What makes it sound: every register access is a volatile read or write of one aligned word of a peripheral that the
//! memory map of the AN500 puts there (Arm DAI 0500, CMSDK TRM DDI 0479); a peripheral is driven by one owner, except
//! for the UART's transmitter, which the last word before a reset takes over for good; what exceptions share with the
//! main loop is atomic.
#![allow(unsafe_code)]

use core::panic::PanicInfo;
use core::ptr;
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{Peripherals, SCB, SYST};
use cortex_m_rt::{ExceptionFrame, exception};
use firmware::serial::ResetCause;

/// Clock of core, SysTick, UART and watchdog, Hz.
pub(crate) const CLOCK_HZ: u32 = 25_000_000;

/// A memory-mapped word.
#[derive(Clone, Copy)]
struct Register(*mut u32);

impl Register {
    const fn at(address: usize) -> Self {
        Self(address as *mut u32)
    }

    fn read(self) -> u32 {
        // SAFETY: constructed only from the addresses below, each an aligned word of a peripheral without side effects
        // on memory.
        unsafe { ptr::read_volatile(self.0) }
    }

    fn write(self, value: u32) {
        // SAFETY: as for `read`; no peripheral here writes memory (none does DMA).
        unsafe { ptr::write_volatile(self.0, value) }
    }
}

const UART_DATA: Register = Register::at(0x4000_4000);
const UART_STATE: Register = Register::at(0x4000_4004);
const UART_CTRL: Register = Register::at(0x4000_4008);
const UART_BAUDDIV: Register = Register::at(0x4000_4010);
const TX_FULL: u32 = 1 << 0;
const RX_FULL: u32 = 1 << 1;
const TX_AND_RX_ENABLE: u32 = 0b11;
/// 25 MHz / 16: the fastest rate that the CMSDK UART allows, 1.5625 Mbaud.
const FASTEST_DIVIDER: u32 = 16;

const WDOG_LOAD: Register = Register::at(0x4000_8000);
const WDOG_CTRL: Register = Register::at(0x4000_8008);
const WDOG_INTCLR: Register = Register::at(0x4000_800c);
const WDOG_LOCK: Register = Register::at(0x4000_8c00);
const WDOG_UNLOCK: u32 = 0x1acc_e551;
const WDOG_INTERRUPT_AND_RESET: u32 = 0b11;
/// A pass of the main loop is a step at most, or the check of a whole table: 1 s is long for both.
const WDOG_TIMEOUT: u32 = CLOCK_HZ;

/// UART0, the line to the host.
pub(crate) struct Uart(());

impl Uart {
    /// Enables both directions.
    pub(crate) fn start() -> Self {
        UART_BAUDDIV.write(FASTEST_DIVIDER);
        UART_CTRL.write(TX_AND_RX_ENABLE);
        Self(())
    }

    /// A byte, if one has arrived.
    pub(crate) fn read(&mut self) -> Option<u8> {
        // The upper bits of the data register are reserved.
        (UART_STATE.read() & RX_FULL != 0).then(|| UART_DATA.read() as u8)
    }

    /// Sends a byte once there is room.
    pub(crate) fn write(&mut self, byte: u8) {
        send(byte);
    }
}

fn send(byte: u8) {
    while UART_STATE.read() & TX_FULL != 0 {
        core::hint::spin_loop();
    }
    UART_DATA.write(u32::from(byte));
}

/// SysTick, running freely on the core's clock without interrupt.
pub(crate) struct Counter(());

impl Counter {
    /// Starts it; `None` if somebody owns the core's peripherals already.
    pub(crate) fn start() -> Option<Self> {
        const LONGEST: u32 = 0x00ff_ffff;
        let mut systick = Peripherals::take()?.SYST;
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(LONGEST);
        systick.clear_current();
        systick.enable_counter();
        Some(Self(()))
    }

    /// Counts up (SysTick counts down), 24 bits.
    pub(crate) fn read(&mut self) -> u32 {
        !SYST::get_current() & 0x00ff_ffff
    }
}

/// The watchdog: unserved, it first raises the NMI, which says a last word and resets.
pub(crate) struct Watchdog(());

impl Watchdog {
    /// Starts it.
    pub(crate) fn start() -> Self {
        WDOG_LOCK.write(WDOG_UNLOCK);
        WDOG_LOAD.write(WDOG_TIMEOUT);
        WDOG_CTRL.write(WDOG_INTERRUPT_AND_RESET);
        Self(())
    }

    /// Starts its time anew.
    pub(crate) fn serve(&mut self) {
        WDOG_INTCLR.write(1);
    }
}

/// The cause of the next reset, in memory that a reset does not touch. Any other value means power-on.
#[unsafe(link_section = ".uninit.reset_cause")]
static RESET_CAUSE: AtomicU32 = AtomicU32::new(0);
/// Tells a written cause from what memory holds after power-on.
const CAUSE_MAGIC: u32 = 0x5717_0000;

/// Why the board has started; asked once.
pub(crate) fn reset_cause() -> ResetCause {
    let number = RESET_CAUSE.swap(0, Ordering::Relaxed) ^ CAUSE_MAGIC;
    ResetCause::from_number(number).unwrap_or_default()
}

/// The last word before a reset: a SAFE command that moves nothing, framed beforehand.
static LAST_WORD: [AtomicU8; 96] = [const { AtomicU8::new(0) }; 96];

/// Keeps the frame that is to be sent before a reset.
pub(crate) fn keep_last_word(frame: &[u8]) {
    for (place, byte) in LAST_WORD.iter().zip(frame) {
        place.store(*byte, Ordering::Relaxed);
    }
}

/// Says SAFE, notes the cause, resets. The frame starts with a delimiter: what the main loop was sending is one
/// damaged frame, not two. Zeros behind its end are empty frames.
fn end_in_safety(cause: ResetCause) -> ! {
    for byte in &LAST_WORD {
        send(byte.load(Ordering::Relaxed));
    }
    RESET_CAUSE.store(CAUSE_MAGIC ^ cause as u32, Ordering::Relaxed);
    SCB::sys_reset()
}

// SAFETY: runs once, and never returns to what it interrupted; shares only atomics with it.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    end_in_safety(ResetCause::Watchdog)
}

// SAFETY: never returns; shares only atomics.
#[exception]
unsafe fn HardFault(_frame: &ExceptionFrame) -> ! {
    end_in_safety(ResetCause::HardFault)
}

unsafe extern "C" {
    /// Exists nowhere: an image in which a panic can be reached does not link.
    safe fn a_panic_can_be_reached() -> !;
    /// Of cortex-m-rt: stops, until the watchdog notices.
    fn DefaultHandler();
    /// Set by the linker: the lowest word of the stack.
    static _stack_end: u32;
    /// Set by the linker: the word above the stack.
    static _stack_start: u32;
}

/// Vectors of the interrupts, none of which is ever enabled. Left to itself, cortex-m-rt keeps a kilobyte for 240.
// SAFETY: function pointers where the hardware looks for them, which is what the section is for.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [unsafe extern "C" fn(); 1] = [DefaultHandler];

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    a_panic_can_be_reached()
}

/// Deepest use of the stack so far: everything above the lowest word that has lost its paint.
pub(crate) fn stack_bytes() -> u32 {
    /// What cortex-m-rt's `paint-stack` writes before `main`.
    const PAINT: u32 = 0xcccc_cccc;
    let (low, high) = (&raw const _stack_end, &raw const _stack_start);
    let words = (high as usize - low as usize) / 4;
    // SAFETY: the linker reserves all words between the two symbols for the stack; volatile, because the compiler does
    // not know of them.
    let untouched = (0..words).take_while(|&i| unsafe { ptr::read_volatile(low.add(i)) } == PAINT).count();
    ((words - untouched) * 4) as u32
}
