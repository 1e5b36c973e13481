//! Shapes made from numbers: the analytic parts of examples, scenes and the paper.
//!
//! All are closed, point outwards and share vertices along edges. Lengths are metres; a shape is
//! centred on the origin with its axis, if it has one, along z.

mod peg_in_hole;
mod solids;

pub use peg_in_hole::PegInHole;
pub use solids::{cuboid, cylinder, icosphere, plate, prism, torus};

/// Steps of making a shape, for the unpublished shapes of tests.
#[doc(hidden)]
pub mod construction {
    pub use super::solids::{circle, counted, finish, named_prism, out_of_range, positive};
    pub use crate::mesh::polygon::triangulate;
}

/// A random solid of the unpublished shapes: they are made of this crate as it is without its tests.
#[cfg(test)]
pub(crate) fn random_solid(
    seed: u64,
) -> Result<super::triangle_mesh::TriangleMesh, super::error::MeshError> {
    let solid = pegfit_fixtures::random_solid(seed).expect("a solid");
    let (vertices, triangles) = (solid.vertices().to_vec(), solid.triangles().to_vec());
    solids::finish("random solid", vertices, triangles)
}
