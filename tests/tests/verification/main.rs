//! What the methods promise, held against outside sources: published benchmarks, closed forms, an independent solver's limits. One
//! program of tests: what they share is compiled and linked once.

mod bad_input;
mod benchmarks;
mod continuum;
mod default_rule;
mod equilibrium;
mod fit;
mod materials;
mod nitsche;
mod patch;
mod slab;
mod space;
mod space_closed_forms;
mod unseen_scenes;
