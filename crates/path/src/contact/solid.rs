//! Signed distance from a solid, with its gradient.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;
use sdf_grid::{Bvh, Nearest, TriangleMesh};

/// Nearer to a surface than this share of its largest extent a point counts as on it: the direction
/// to the nearest point is rounding.
const ON_SURFACE: f64 = 1e-8;

/// Faces less wide than this share of their length may be folded over: their normals are not used.
const THIN: f64 = 1e-3;
/// A pseudonormal that has less than this in common with the direction from the surface does not
/// decide.
const UNSURE: f64 = 0.2;

/// A closed surface that knows which side of it points are on.
///
/// The sign is that of the angle with the pseudonormal of the face, edge or vertex that is nearest
/// (Bærentzen and Aanæs 2005); of meshes with open edges, and where thin faces leave it open, that of
/// the winding number, which has the last word on points inside.
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

    /// At a point nearer to the surface than `radius`; none elsewhere, inside or outside.
    pub(crate) fn probe(&self, p: DVec3, radius: f64) -> Option<Probe> {
        let nearest = self.bvh.nearest_within(p, radius)?;
        Some(self.sided(p, &nearest))
    }

    /// Distance of a point from the surface, inside or outside, if that is nearer than `radius`.
    pub(crate) fn near(&self, p: DVec3, radius: f64) -> Option<f64> {
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
        // What seems inside is looked at twice: few points are, and surfaces may cross themselves.
        let outside = (self.closed && across > UNSURE) || self.bvh.signed_distance(p) >= 0.0;
        let sign = if outside { 1.0 } else { -1.0 };
        Probe {
            distance: sign * nearest.distance,
            normal: sign * away / nearest.distance,
        }
    }

    /// Of the face, edge or vertex on which the nearest point lies.
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
    use super::*;
    use crate::contact::features::touching_points;
    use pegfit_fixtures as shapes;

    /// Against the winding number, at points near and far of solids with sharp and blunt features.
    #[test]
    fn signs_are_those_of_the_winding_number() {
        let mut solids: Vec<_> = (0..6)
            .map(|s| shapes::random_fit(s).unwrap().fixed)
            .collect();
        solids.push(shapes::bayonet(1e-4).unwrap().0);
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
        let fit = shapes::random_fit(6).unwrap();
        let meshes = [fit.fixed, fit.moving];
        let [fixed, moving] = [0, 1].map(|i| Solid::new(Arc::new(meshes[i].clone())));
        for (solid, other) in [(&fixed, &moving), (&moving, &fixed)] {
            let reference = Bvh::build(&solid.mesh);
            for point in touching_points(&other.mesh, 1e-4) {
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
