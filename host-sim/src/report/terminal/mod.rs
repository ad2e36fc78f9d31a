//! What commands say on one screen.

pub mod space_summary;
pub mod summary;
pub mod timing_summary;
