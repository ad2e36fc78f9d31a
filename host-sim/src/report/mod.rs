//! What a person sees of results: the report's page and pictures, figures of studies, words on a terminal.

mod below_noise;
pub mod board_chart;
pub mod cyclictest;
pub mod directory;
pub mod faults_chart;
pub mod page;
pub mod paper;
pub mod studies;
pub mod terminal;

use firmware::detection::DEPTH_MARGIN;

pub use self::page::{Attachments, pictures, render, render_with, timing_histograms};

/// What a controller does where its table ends before the needle does.
const PAST_ITS_TABLE: &str =
    "past the end of its table the controller goes on with the last knot, to twice that depth at most";

/// An error that is so many times another one is held against nothing: the other is what rounding leaves of 0.
const AGAINST_NOTHING: f64 = 1.0 / model_offline::placement::verdict::AGAINST_NOTHING;

// Needles further past the table's end are refused by the controller: as far as the table is long is "twice".
const _: () = assert!(DEPTH_MARGIN == 1.0);
