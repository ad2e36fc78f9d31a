//! What the images cost on the board.

pub mod measure;
pub mod scenarios;
pub mod space;
