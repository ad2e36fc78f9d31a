//! The controller of two paddles in space in `f64`, as a bare-metal image for a Cortex-M7. Everything is in `board.rs`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board;

#[cfg(target_os = "none")]
board::image!(firmware::serial::Memory<f64, 3, 2, 2, { firmware::serial::device::SPATIAL_TABLE_BYTES }>);

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is an image for a microcontroller: build it with --target thumbv7em-none-eabihf");
}
