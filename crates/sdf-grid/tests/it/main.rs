//! Tests of the whole crate from outside, in one binary: its kernels are compiled once for all of
//! them.

mod common;
mod contact_stress;
mod density_field;
mod density_reference;
mod density_solids;
mod distance;
mod field_cache;
mod kernel;
mod mesh_content;
mod mesh_formats;
mod mesh_instances;
mod mesh_io;
mod mesh_slicers;
mod repair;
mod shapes;
mod step;
mod stress;
mod symmetry;
