//! What belongs to a node: the triangulation of the body, and cells that stop at its outline.

mod cell_loops;
pub mod nodal_cells;
pub mod triangulation;
