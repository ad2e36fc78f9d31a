//! What commands say on one screen.

pub mod summary;
pub mod timing_summary;
