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

pub use self::page::{Attachments, pictures, render, render_with, timing_histograms};
