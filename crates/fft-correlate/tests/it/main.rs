//! The crate's integration tests, one binary: its kernels are linked once.

mod common;
#[path = "../counting/mod.rs"]
mod counting;
mod direct_support;
mod physics_support;
mod store_support;

mod allocations;
mod condition;
mod contact_slope;
mod direct;
mod direct_correlator;
mod half_turns;
mod held_out;
mod mating;
mod mould;
mod physics;
mod physics_well;
mod provenance;
mod store;
mod store_damage;
mod store_memory;
mod store_seal;
mod stress;
mod table;
mod table_edges;
mod table_parts;
mod table_queries;
mod tolerance;
