//! The model against closed forms, independent numbers and itself: bodies, needles, tissue in time, tables, what a scene needs. One
//! program of tests: what they share is compiled and linked once.

mod fit_world;
mod followed;
mod linear_solvers;
mod material_in_space;
mod named_materials;
mod nodes;
mod relaxation;
mod rows;
mod slice;
mod slipping_needle;
mod space_tables;
mod stability;
mod table_path;
mod world;
