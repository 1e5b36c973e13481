//! Mass and inertia of a solid of even density.

use glam::{DMat3, DVec3};
use sdf_grid::TriangleMesh;

/// Density of every part, kilograms per cubic metre: that of water.
pub(super) const DENSITY: f64 = 1000.0;

/// Mass properties of a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MassProperties {
    /// Kilograms.
    pub(super) mass: f64,
    /// Centre of mass, metres.
    pub(super) centre: DVec3,
    /// About the centre, along the axes of the mesh, kg m².
    pub(super) inertia: DMat3,
}

impl MassProperties {
    /// Of a closed mesh; of its bounding box if it encloses no volume, or has no inertia that a body
    /// can have.
    pub(super) fn new(mesh: &TriangleMesh) -> Self {
        Self::of_tetrahedra(mesh)
            .filter(Self::is_possible)
            .unwrap_or_else(|| Self::of_box(mesh))
    }

    /// From signed tetrahedra between the faces and the middle of the mesh.
    fn of_tetrahedra(mesh: &TriangleMesh) -> Option<Self> {
        let bounds = mesh.bounds();
        let middle = bounds.center();
        let (mut volume, mut first, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
        for [a, b, c] in mesh.faces().map(|f| f.map(|p| p - middle)) {
            let v = a.dot(b.cross(c)) / 6.0;
            let sum = a + b + c;
            volume += v;
            first += 0.25 * v * sum;
            // The integral of p pᵀ over a tetrahedron with a corner at the origin.
            second += (outer(a) + outer(b) + outer(c) + outer(sum)) * (v / 20.0);
        }
        if volume <= 1e-9 * mesh.area() * bounds.diagonal() {
            return None;
        }
        let centre = first / volume;
        Some(Self::from_moments(
            volume,
            middle + centre,
            second - outer(centre) * volume,
        ))
    }

    fn of_box(mesh: &TriangleMesh) -> Self {
        let bounds = mesh.bounds();
        let size = bounds.size().max(DVec3::splat(1e-3 * bounds.diagonal()));
        let volume = size.x * size.y * size.z;
        let second = DMat3::from_diagonal(size * size * (volume / 12.0));
        Self::from_moments(volume, bounds.center(), second)
    }

    /// Of volume and second moments about the centre.
    fn from_moments(volume: f64, centre: DVec3, second: DMat3) -> Self {
        let trace = second.x_axis.x + second.y_axis.y + second.z_axis.z;
        Self {
            mass: DENSITY * volume,
            centre,
            inertia: (DMat3::from_diagonal(DVec3::splat(trace)) - second) * DENSITY,
        }
    }

    /// Whether the second moments along all axes are positive: of open meshes they may not be.
    fn is_possible(&self) -> bool {
        let i = self.inertia;
        let half = 0.5 * (i.x_axis.x + i.y_axis.y + i.z_axis.z);
        let second = DMat3::from_diagonal(DVec3::splat(half)) - i;
        let minor = second.x_axis.x * second.y_axis.y - second.x_axis.y * second.x_axis.y;
        second.x_axis.x > 0.0 && minor > 0.0 && second.determinant() > 0.0
    }

    /// The same seen from a frame in which the mesh lies shifted.
    pub(super) fn moved(self, by: DVec3) -> Self {
        Self {
            centre: self.centre + by,
            ..self
        }
    }

    /// Of a link that joints in series need between them: too little to notice, about its origin.
    pub(super) fn negligible(&self) -> Self {
        let i = self.inertia;
        let mean = (i.x_axis.x + i.y_axis.y + i.z_axis.z) / 3.0;
        Self {
            mass: (1e-4 * self.mass).max(1e-9),
            centre: DVec3::ZERO,
            // Programs refuse inertias near the smallest numbers.
            inertia: DMat3::from_diagonal(DVec3::splat((1e-4 * mean).max(1e-12))),
        }
    }

    /// xx, yy, zz, xy, xz, yz.
    pub(super) fn components(&self) -> [f64; 6] {
        let [x, y, z] = [
            self.inertia.x_axis,
            self.inertia.y_axis,
            self.inertia.z_axis,
        ];
        [x.x, y.y, z.z, x.y, x.z, y.z]
    }
}

fn outer(a: DVec3) -> DMat3 {
    DMat3::from_cols(a * a.x, a * a.y, a * a.z)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use sdf_grid::shapes::cuboid;

    use super::*;

    #[test]
    fn a_cuboid_has_its_mass_and_inertia_wherever_it_lies() {
        let (size, mass) = (DVec3::new(0.02, 0.03, 0.05), 0.03);
        let mesh = cuboid(size).unwrap();
        let squares = size * size;
        let across = DVec3::new(
            squares.y + squares.z,
            squares.x + squares.z,
            squares.x + squares.y,
        );
        let own = DMat3::from_diagonal(across * (mass / 12.0));
        for (turn, shift) in [
            (DQuat::IDENTITY, DVec3::ZERO),
            (
                DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7)),
                DVec3::new(3.0, -2.0, 5.0),
            ),
        ] {
            let found = MassProperties::new(&mesh.transformed(turn, shift));
            let turn = DMat3::from_quat(turn);
            let expected = turn * own * turn.transpose();
            assert!((found.mass - mass).abs() < 1e-12);
            assert!(found.centre.distance(shift) < 1e-12);
            let error = (found.inertia - expected).to_cols_array();
            assert!(error.iter().all(|e| e.abs() < 1e-15), "{error:?}");
        }
    }
}
