//! Densities and distances of a part, at points and on lattices.
//!
//! The crate's two densities are the reference, a plain sum over all triangles in f64
//! ([`point::reference`]), and the fast one, of which fields consist. From the bottom up:
//!
//! - [`kernel`], [`quadrature`], [`lattice`]: the kernel of a density, rules of integration, and
//!   the places of values;
//! - [`point`]: densities at single points in f64;
//! - [`packet`]: the tree code on packets of sixteen points in f32;
//! - [`sampling`]: from points to lattice values: blocks, halo, boundary and cell averages;
//! - [`density_field`], [`cache`]: whole fields, and where they are kept.

pub(crate) mod cache;
pub(crate) mod density_field;
pub(crate) mod kernel;
pub(crate) mod lattice;
pub(crate) mod options;
mod packet;
pub(crate) mod point;
pub(crate) mod provenance;
mod quadrature;
pub(crate) mod sampling;
