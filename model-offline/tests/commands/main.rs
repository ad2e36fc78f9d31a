//! The program as a user runs it, and scenes as it reads them. One program of tests: what they share is compiled and linked once.

mod check;
mod command_line;
mod draw;
#[cfg(target_os = "linux")]
mod limits;
mod scenes;
mod segmentations;
mod slipping_needles;
mod space_awkward;
mod space_commands;
mod space_files;
mod space_study;
