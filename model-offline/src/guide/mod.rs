//! Guides: precompute tables, how it works, and a worked example.
//!
//! For whoever runs simulations or checks timing, the guides are in the crate `host-sim`. Every command line on these pages is run by
//! `cargo test -p host-sim --test documentation`.

#[doc = include_str!("precompute.md")]
pub mod precompute {}

#[doc = include_str!("how_it_works.md")]
pub mod how_it_works {}

#[doc = include_str!("change_a_material.md")]
pub mod change_a_material {}
