//! Files that other tools open: MCAP for Foxglove and Lichtblick, VTU series for ParaView, tables for everything else.

pub mod csv;
pub mod foxglove;
pub mod mcap;
pub mod messages;
pub mod paraview;
