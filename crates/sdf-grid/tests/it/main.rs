//! Tests of the whole crate from outside, in one binary: its kernels are compiled once for all of
//! them.

mod bvh;
mod common;
mod contact_stress;
mod density_field;
mod density_reference;
mod density_smoothed;
mod density_solids;
mod field_cache;
mod fixtures;
mod hygiene;
mod hygiene_invariance;
mod kernel;
mod mesh_content;
mod mesh_formats;
mod mesh_instances;
mod mesh_io;
mod mesh_parts;
mod mesh_slicers;
mod shapes;
mod shells;
mod signed_distance;
mod step;
mod stitching;
mod stress;
mod symmetry;
