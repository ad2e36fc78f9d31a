//! Guides: precompute tables, choose a method, where methods fail, what the numbers were held against, how it works, and a
//! worked example.
//!
//! For whoever runs simulations, checks timing, injects faults or has a board, the guides are in the crate `host-sim`. Every
//! command line on these pages is run by `cargo test -p host-sim --test commands documentation`, but for those marked in their source.
//! Their pictures show when the pages are read as files, and in the documentation after
//! `cp -r model-offline/pictures target/doc/model_offline/`.

#[doc = include_str!("precompute.md")]
pub mod precompute {}

#[doc = include_str!("choose_a_method.md")]
pub mod choose_a_method {}

#[doc = include_str!("where_methods_fail.md")]
pub mod where_methods_fail {}

#[doc = include_str!("trust_the_numbers.md")]
pub mod trust_the_numbers {}

#[doc = include_str!("how_it_works.md")]
pub mod how_it_works {}

#[doc = include_str!("three_dimensions.md")]
pub mod three_dimensions {}

#[doc = include_str!("change_a_material.md")]
pub mod change_a_material {}
