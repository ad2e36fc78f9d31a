//! What is kept: recordings of every tick, their replay, and files for other tools.

pub mod difference;
pub mod error;
pub mod export;
pub mod files;
pub mod recording;
pub mod replay;
