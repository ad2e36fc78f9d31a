//! The program as a user runs it, one command or file format after another. One program of tests: what they share is compiled and
//! linked once.

mod causes;
mod documentation;
mod files;
#[cfg(feature = "foxglove")]
mod foxglove;
mod fuzz;
#[path = "../missing/mod.rs"]
mod missing;
mod mistakes;
mod needle_signals;
mod off_the_planned_way;
mod options;
mod other_scene;
#[path = "../scenes/mod.rs"]
mod scenes;
mod sensors;
mod space;
mod space_seen;
mod stability;
mod tables;
