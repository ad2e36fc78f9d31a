//! How nodes make a field: kernels, what a node can see, moment matrices and shape functions.

pub mod kernel;
pub mod node_cloud;
pub mod shape_functions;
pub mod sight;
