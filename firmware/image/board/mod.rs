//! The board: an Arm MPS2+ with the AN500 image (Cortex-M7 at 25 MHz), which QEMU models as `mps2-an500`.
//!
//! UART0 is the line, SysTick the counter, the CMSDK watchdog the watchdog. Everything unsafe is in [`hardware`].

pub(crate) mod hardware;

use firmware::scalar::Scalar;
use firmware::serial::{Board, Memory, ResetCause};

use hardware::{Counter, Uart, Watchdog};

/// The controller's view of the board.
pub(crate) struct Mps2 {
    uart: Uart,
    counter: Counter,
    watchdog: Watchdog,
}

impl Mps2 {
    /// Starts clock, line and watchdog. `None` if it has been called before.
    pub(crate) fn start() -> Option<Self> {
        let counter = Counter::start()?;
        Some(Self { uart: Uart::start(), counter, watchdog: Watchdog::start() })
    }
}

impl Board for Mps2 {
    const COUNTER_HZ: u32 = hardware::CLOCK_HZ;

    fn read(&mut self) -> Option<u8> {
        self.uart.read()
    }

    fn write(&mut self, byte: u8) {
        self.uart.write(byte);
    }

    fn counter(&mut self) -> u32 {
        self.counter.read()
    }

    fn alive(&mut self) {
        self.watchdog.serve();
    }

    fn hang(&mut self) {
        loop {
            core::hint::spin_loop();
        }
    }

    fn stack_bytes(&self) -> u32 {
        hardware::stack_bytes()
    }
}

/// Runs the device for ever.
pub(crate) fn run<T: Scalar, const D: usize, const N: usize, const P: usize, const BYTES: usize>(
    memory: &mut Memory<T, D, N, P, BYTES>,
) {
    // The control of the proof that no panic can be reached: with this, the image must not link.
    #[cfg(panic_control)]
    core::hint::black_box(None::<u32>).unwrap();
    let reset: ResetCause = hardware::reset_cause();
    hardware::keep_last_word(memory.last_word());
    if let Some(mut board) = Mps2::start() {
        firmware::serial::serve(&mut board, memory, reset);
    }
}

/// The entry point of an image with this memory, whose type says what it computes in, and for which space.
macro_rules! image {
    ($memory:ty) => {
        static MEMORY: static_cell::ConstStaticCell<$memory> = static_cell::ConstStaticCell::new(<$memory>::new());

        #[cortex_m_rt::entry]
        fn main() -> ! {
            if let Some(memory) = MEMORY.try_take() {
                board::run(memory);
            }
            // Never reached: without a board there is nothing to serve, and the watchdog resets.
            loop {
                core::hint::spin_loop();
            }
        }
    };
}
pub(crate) use image;
