//! What a bare-metal program does if it panics. It cannot, as `tests/bare_metal.rs` proves.

use core::panic::PanicInfo;

/// Stops, until the watchdog notices.
#[cfg(not(panic_proof))]
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}

/// In the proof: a program in which a panic can be reached does not link.
#[cfg(panic_proof)]
#[panic_handler]
#[allow(unsafe_code)]
fn panic(_: &PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        /// Exists nowhere.
        safe fn a_panic_can_be_reached() -> !;
    }
    a_panic_can_be_reached()
}
