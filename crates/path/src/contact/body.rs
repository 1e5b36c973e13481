//! Bodies that move or stay as one: one solid, or several that may touch.

use std::sync::Arc;

use fft_correlate::Pose;
use glam::DVec3;
use sdf_grid::{Aabb, InterferenceQuery, TriangleMesh};

use crate::contact::solid::{Probe, Solid};

/// A rigid body of one solid or several. Several are not joined: each knows its own distances, so
/// walls between solids that touch are never mistaken for outer ones.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    solids: Vec<Arc<Solid>>,
}

impl Body {
    /// The first solid is what it has at least.
    pub(crate) fn new(first: Arc<Solid>, more: impl IntoIterator<Item = Arc<Solid>>) -> Self {
        Self {
            solids: std::iter::once(first).chain(more).collect(),
        }
    }

    pub(crate) fn of_mesh(mesh: Arc<TriangleMesh>) -> Self {
        Self::new(Arc::new(Solid::new(mesh)), [])
    }

    pub(crate) fn meshes(&self) -> impl Iterator<Item = &TriangleMesh> {
        self.solids.iter().map(|s| &*s.mesh)
    }

    pub(crate) fn vertices(&self) -> impl Iterator<Item = &DVec3> {
        self.meshes().flat_map(TriangleMesh::vertices)
    }

    pub(crate) fn bounds(&self) -> Aabb {
        let boxes = self.meshes().map(TriangleMesh::bounds);
        boxes.fold(Aabb::EMPTY, |all, one| all.union(&one))
    }

    /// Of all solids, each counted by its volume, metres.
    pub(crate) fn centroid(&self) -> DVec3 {
        // Flat solids have a say, too.
        let weighed = |mesh: &TriangleMesh| {
            let weight = mesh
                .volume()
                .abs()
                .max(1e-6 * mesh.bounds().diagonal().powi(3));
            (weight, mesh.centroid())
        };
        let all: Vec<(f64, DVec3)> = self.meshes().map(weighed).collect();
        match &all[..] {
            [(_, centre)] => *centre,
            _ => {
                let weight: f64 = all.iter().map(|a| a.0).sum();
                all.iter().map(|a| a.0 * a.1).sum::<DVec3>() / weight
            }
        }
    }

    /// Largest distance of a vertex from `centre`, metres.
    pub(crate) fn radius_about(&self, centre: DVec3) -> f64 {
        let radii = self.meshes().map(|m| m.radius_about(centre));
        radii.fold(0.0, f64::max)
    }

    /// For each solid whose surface is nearer to a point than `radius`, the distance from it.
    pub(crate) fn probes(&self, p: DVec3, radius: f64) -> impl Iterator<Item = Probe> {
        let probe = move |s: &Arc<Solid>| s.probe(p, radius);
        self.solids.iter().filter_map(probe)
    }

    /// Distance of a point from the nearest surface, inside or outside; `radius` if none is nearer.
    pub(crate) fn near(&self, p: DVec3, radius: f64) -> f64 {
        let near = self.solids.iter().filter_map(|s| s.near(p, radius));
        near.fold(radius, f64::min)
    }

    /// The volume that this body and one at `pose` share, cubic metres.
    pub(crate) fn shared_with(&self, other: &Self, pose: &Pose) -> f64 {
        let shared = |a, b| {
            let query = InterferenceQuery::new(a, b);
            query.at(pose.rotation, pose.translation).volume
        };
        let with = |a| other.meshes().map(move |b| shared(a, b));
        self.meshes().flat_map(with).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sdf_grid::shapes;

    /// Two cubes side by side are one box: distances inside are never those of the wall between.
    #[test]
    fn solids_that_touch_have_no_way_in_between() {
        let cube = |x: f64| {
            let mesh = shapes::cuboid(DVec3::splat(0.01)).unwrap();
            Arc::new(Solid::new(Arc::new(
                mesh.transformed(glam::DQuat::IDENTITY, DVec3::X * x),
            )))
        };
        let both = Body::new(cube(-0.005), [cube(0.005)]);
        assert!(both.centroid().length() < 1e-12);
        assert!((both.bounds().size() - DVec3::new(0.02, 0.01, 0.01)).length() < 1e-12);
        for x in [-1e-4, -1e-6, 1e-6, 1e-4] {
            let probes = both.probes(DVec3::new(x, 0.0, 0.0045), 1e-3);
            let least = probes.map(|p| p.distance).fold(f64::INFINITY, f64::min);
            assert!(least < -x.abs() * 0.99, "{x}: {least}");
        }
        let block = Body::of_mesh(Arc::new(shapes::cuboid(DVec3::splat(0.01)).unwrap()));
        let pose = Pose::from_translation(DVec3::Z * 0.009);
        // 10 mm x 10 mm, half over each cube, 1 mm deep.
        let volume = both.shared_with(&block, &pose);
        assert!((volume / 1e-7 - 1.0).abs() < 0.05, "{volume}");
    }
}
