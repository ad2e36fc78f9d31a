//! What is kept: recordings of every tick, their replay, and other tools' formats.

pub mod export;
pub mod recording;
pub mod replay;
