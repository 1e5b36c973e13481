//! Rigid bodies of one solid or several, and signed distances from them with their gradient.

use std::collections::HashMap;
use std::sync::Arc;

use fft_correlate::Pose;
use glam::DVec3;
use sdf_grid::{Aabb, Bvh, InterferenceQuery, Nearest, TriangleMesh};

/// A rigid body of one solid or several. Several are not joined: each knows its own distances, so
/// walls between solids that touch are never mistaken for outer ones.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    solids: Vec<Arc<Solid>>,
}

impl Body {
    /// A body of one solid or more.
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

    /// Centroid of all solids, weighted by volume, metres.
    pub(crate) fn centroid(&self) -> DVec3 {
        // Flat solids count, too.
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
    pub(crate) fn unsigned_distance(&self, p: DVec3, radius: f64) -> f64 {
        let near = self
            .solids
            .iter()
            .filter_map(|s| s.unsigned_distance(p, radius));
        near.fold(radius, f64::min)
    }

    /// The volume that this body and one at `pose` share, cubic metres.
    pub(crate) fn interference_volume(&self, other: &Self, pose: &Pose) -> f64 {
        let shared = |a, b| {
            let query = InterferenceQuery::new(a, b);
            query.at(pose.rotation, pose.translation).volume
        };
        let with = |a| other.meshes().map(move |b| shared(a, b));
        self.meshes().flat_map(with).sum()
    }
}

/// Nearer to a surface than this share of its largest extent a point counts as on it: the direction
/// to the nearest point is rounding.
const ON_SURFACE: f64 = 1e-8;

/// Faces less wide than this share of their length may be folded over: their normals are not used.
const THIN: f64 = 1e-3;
/// A pseudonormal that has less than this in common with the direction from the surface does not
/// decide.
const UNSURE: f64 = 0.2;

/// A solid with signed distances.
///
/// The pseudonormal of the nearest face, edge or vertex gives the sign (Bærentzen and Aanæs 2005). The
/// winding number decides for meshes with open edges, near thin faces, and for points inside.
#[derive(Debug, Clone)]
pub(crate) struct Solid {
    pub(crate) mesh: Arc<TriangleMesh>,
    bvh: Bvh,
    faces: Vec<DVec3>,
    edges: HashMap<(u32, u32), DVec3>,
    vertices: Vec<DVec3>,
    closed: bool,
    on_surface: f64,
}

/// A point's signed distance from a solid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Probe {
    /// Metres, negative inside.
    pub(crate) distance: f64,
    /// Gradient of the distance: out of the solid.
    pub(crate) normal: DVec3,
}

impl Solid {
    pub(crate) fn new(mesh: Arc<TriangleMesh>) -> Self {
        let on_surface = ON_SURFACE * mesh.bounds().size().max_element();
        let faces: Vec<DVec3> = mesh.faces().map(normal).collect();
        let mut edges: HashMap<(u32, u32), (DVec3, u32)> = HashMap::new();
        let mut vertices = vec![DVec3::ZERO; mesh.vertices().len()];
        for (i, t) in mesh.triangles().iter().enumerate() {
            let corners = mesh.corners(i);
            for k in 0..3 {
                let edge = edges.entry(key(t[k], t[(k + 1) % 3])).or_default();
                edge.0 += faces[i];
                edge.1 += 1;
                let [to, from] = [1, 2].map(|d| corners[(k + d) % 3] - corners[k]);
                vertices[t[k] as usize] += faces[i] * to.angle_between(from);
            }
        }
        Self {
            closed: edges.values().all(|(_, faces)| *faces == 2),
            edges: edges.into_iter().map(|(k, (n, _))| (k, n)).collect(),
            bvh: Bvh::build(&mesh),
            on_surface,
            faces,
            vertices,
            mesh,
        }
    }

    /// Signed distance at a point; none if the surface is farther than `radius` metres.
    pub(crate) fn probe(&self, p: DVec3, radius: f64) -> Option<Probe> {
        let nearest = self.bvh.nearest_within(p, radius)?;
        Some(self.sided(p, &nearest))
    }

    /// Distance of a point from the surface, unsigned; none if it is farther than `radius` metres.
    pub(crate) fn unsigned_distance(&self, p: DVec3, radius: f64) -> Option<f64> {
        Some(self.bvh.nearest_within(p, radius)?.distance)
    }

    fn sided(&self, p: DVec3, nearest: &Nearest) -> Probe {
        let outward = self.pseudonormal(nearest);
        let away = p - nearest.point;
        if nearest.distance <= self.on_surface {
            let normal = outward.normalize_or_zero();
            let distance = away.dot(normal);
            return Probe { distance, normal };
        }
        let across = away.dot(outward) / nearest.distance;
        // Points that seem inside are checked twice: they are few, and surfaces may cross themselves.
        let outside = (self.closed && across > UNSURE) || self.bvh.signed_distance(p) >= 0.0;
        let sign = if outside { 1.0 } else { -1.0 };
        Probe {
            distance: sign * nearest.distance,
            normal: sign * away / nearest.distance,
        }
    }

    /// Pseudonormal of the face, edge or vertex that holds the nearest point.
    fn pseudonormal(&self, nearest: &Nearest) -> DVec3 {
        let t = self.mesh.triangles()[nearest.triangle];
        let corners = self.mesh.corners(nearest.triangle);
        let p = nearest.point;
        let near = 0.1 * self.on_surface;
        let at = |k: &usize| p.distance(corners[*k]) <= near;
        if let Some(k) = (0..3).find(at) {
            return self.vertices[t[k] as usize];
        }
        let along = |k: &usize| {
            let (from, to) = (corners[*k], corners[(*k + 1) % 3]);
            (p - from).cross((to - from).normalize_or_zero()).length() <= near
        };
        match (0..3).find(along) {
            Some(k) => self.edges[&key(t[k], t[(k + 1) % 3])],
            None => self.faces[nearest.triangle],
        }
    }
}

/// The normal of a face; zero of one that is too thin to be trusted.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    let product = (b - a).cross(c - a);
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    match product.length() > THIN * longest.powi(2) {
        true => product.normalize(),
        false => DVec3::ZERO,
    }
}

fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

#[cfg(test)]
mod tests {
    use sdf_grid::shapes;

    use super::*;
    use crate::collision::contact_points::contact_points;

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
        let volume = both.interference_volume(&block, &pose);
        assert!((volume / 1e-7 - 1.0).abs() < 0.05, "{volume}");
    }

    /// Against the winding number, at points near and far of solids with sharp and blunt features.
    #[test]
    fn signs_are_those_of_the_winding_number() {
        let mut solids: Vec<_> = (0..6)
            .map(|s| pegfit_fixtures::random_fit(s).unwrap().fixed)
            .collect();
        solids.push(pegfit_fixtures::bayonet(1e-4).unwrap().0);
        for mesh in solids {
            let bounds = mesh.bounds().grown(0.001);
            let reference = Bvh::build(&mesh);
            let solid = Solid::new(Arc::new(mesh));
            assert!(solid.closed);
            let distance = |p: DVec3| solid.probe(p, f64::INFINITY).unwrap().distance;
            for i in 0..1500u32 {
                let unit = |k: f64| (f64::from(i) * k).fract();
                let at = DVec3::new(unit(0.618_034), unit(0.754_878), unit(0.569_840));
                let p = bounds.min + at * bounds.size();
                let (expected, found) = (reference.signed_distance(p), distance(p));
                assert!((expected - found).abs() < 1e-12, "{p}: {expected} {found}");
                let near = solid.probe(p, 0.001);
                assert_eq!(near.is_some(), expected.abs() < 0.001);
                if let Some(probe) = near {
                    let ahead = distance(p + 1e-7 * probe.normal);
                    assert!(ahead > probe.distance + 0.9e-7);
                }
            }
        }
    }

    /// Caps of such pegs have faces so thin that they fold over.
    #[test]
    fn thin_faces_do_not_decide_signs() {
        let fit = pegfit_fixtures::random_fit(6).unwrap();
        let meshes = [fit.fixed, fit.moving];
        let [fixed, moving] = [0, 1].map(|i| Solid::new(Arc::new(meshes[i].clone())));
        for (solid, other) in [(&fixed, &moving), (&moving, &fixed)] {
            let reference = Bvh::build(&solid.mesh);
            for point in contact_points(&other.mesh, 1e-4) {
                for lift in [0.02, -0.003] {
                    let sign = if std::ptr::eq(solid, &fixed) {
                        1.0
                    } else {
                        -1.0
                    };
                    let p = point + sign * lift * DVec3::Z;
                    let found = solid.probe(p, f64::INFINITY).unwrap().distance;
                    let expected = reference.signed_distance(p);
                    assert!((found - expected).abs() < 1e-9, "{p}: {found} {expected}");
                }
            }
        }
    }
}
