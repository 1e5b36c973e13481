//! Bolts and nuts.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::profiled::Solid;
use super::solids::{circle, counted, finish, positive};
use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Sections per pitch: the chords of a sine of so many stray a two-hundredth of its amplitude.
const SECTIONS: f64 = 24.0;

/// A round thread about z whose radius is `radius + depth / 2 * cos(TAU * z / pitch - angle)`, with
/// `+ angle` if it is left-handed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thread {
    /// Advance per turn, metres.
    pub pitch: f64,
    /// Mean radius, metres.
    pub radius: f64,
    /// From crest to root, metres; less than the radius.
    pub depth: f64,
    /// Whether a turn counter-clockwise, seen from +z, advances along +z.
    pub right_handed: bool,
    /// Segments around, 8 .. 4096.
    pub segments: u32,
}

impl Thread {
    /// A threaded rod from z = 0 to `length` with a round head of `head` = `[radius, height]` below,
    /// metres.
    ///
    /// # Errors
    /// If a length is not positive and finite, the head does not cover the thread, the depth exceeds
    /// the radius, or the segments are out of range.
    pub fn bolt(&self, length: f64, head: [f64; 2]) -> Result<TriangleMesh, MeshError> {
        self.check(length)?;
        positive("bolt", "height of the head", head[1])?;
        positive("bolt", "head beyond the thread", head[0] - self.crest())?;
        let rim = |z: f64| self.ring(|_| head[0], z);
        let mut sections = vec![rim(-head[1]), rim(0.0)];
        sections.extend(self.sections([0.0, length], 0.0));
        let mut solid = Solid::default();
        let rings = solid.skin(&sections);
        solid.cap(rings[rings.len() - 1], None, true)?;
        solid.cap(rings[0], None, false)?;
        finish("bolt", solid.vertices, solid.triangles)
    }

    /// A hexagonal nut from z = `from` to `to`, `across` wide between its flats, whose thread is that
    /// of the bolt wider by `clearance` all round, metres.
    ///
    /// # Errors
    /// If a length is not positive and finite, the thread cuts the flats, or the clearance is
    /// negative.
    pub fn nut(
        &self,
        [from, to]: [f64; 2],
        across: f64,
        clearance: f64,
    ) -> Result<TriangleMesh, MeshError> {
        self.check(to - from)?;
        let wall = 0.5 * across - self.crest() - clearance;
        positive("nut", "wall outside the thread", wall)?;
        positive("nut", "clearance and a picometre", clearance + 1e-12)?;
        let hexagon = circle(across / 3f64.sqrt(), 6);
        let level = |z: f64| hexagon.iter().map(|p| p.extend(z)).collect::<Vec<_>>();
        let mut solid = Solid::default();
        let outside = solid.skin(&[level(from), level(to)]);
        let inner: Vec<_> = self.sections([to, from], clearance).collect();
        let inside = solid.skin(&inner);
        solid.cap(outside[1], Some(inside[0]), true)?;
        solid.cap(outside[0], Some(inside[inside.len() - 1]), false)?;
        finish("nut", solid.vertices, solid.triangles)
    }

    fn check(&self, length: f64) -> Result<(), MeshError> {
        positive("thread", "length", length)?;
        positive("thread", "pitch", self.pitch)?;
        positive("thread", "depth", self.depth)?;
        positive(
            "thread",
            "radius beyond the depth",
            self.radius - self.depth,
        )?;
        counted("thread", "segments", self.segments, 8)
    }

    fn crest(&self) -> f64 {
        self.radius + 0.5 * self.depth
    }

    /// Sections of the thread from one height to another, wider by an offset.
    fn sections(&self, [from, to]: [f64; 2], offset: f64) -> impl Iterator<Item = Vec<DVec3>> {
        let count = (SECTIONS * (to - from).abs() / self.pitch).ceil().max(1.0);
        let height = move |i: usize| from + (to - from) * i as f64 / count;
        let sense = if self.right_handed { -1.0 } else { 1.0 };
        let thread = *self;
        (0..=count as usize).map(move |i| {
            let turn = TAU * height(i) / thread.pitch;
            let radius = |angle: f64| {
                thread.radius + offset + 0.5 * thread.depth * (turn + sense * angle).cos()
            };
            thread.ring(radius, height(i))
        })
    }

    fn ring(&self, radius: impl Fn(f64) -> f64, z: f64) -> Vec<DVec3> {
        let angle = |i: u32| TAU * f64::from(i) / f64::from(self.segments);
        let corner = |a: f64| (radius(a) * DVec2::from_angle(a)).extend(z);
        (0..self.segments).map(|i| corner(angle(i))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::bvh::tree::Bvh;

    #[test]
    fn a_nut_follows_its_bolt_and_no_other() {
        for (pitch, right_handed) in [(0.002, true), (0.0012, false)] {
            let thread = Thread {
                pitch,
                radius: 0.004,
                depth: 0.3 * pitch,
                right_handed,
                segments: 48,
            };
            let clearance = 1e-4;
            let bolt = thread.bolt(0.010, [0.006, 0.002]).unwrap();
            let nut = thread.nut([0.003, 0.008], 0.012, clearance).unwrap();
            let surface = Bvh::build(&bolt);
            let sense = if right_handed { 1.0 } else { -1.0 };
            for (turn, advance) in [(0.0, 0.0), (1.0, sense), (1.0, -sense)] {
                let lift = advance * pitch * turn / TAU;
                let apart = |p: &DVec3| {
                    let p = glam::DQuat::from_rotation_z(turn) * *p + DVec3::Z * lift;
                    surface.signed_distance(p)
                };
                let least = nut
                    .vertices()
                    .iter()
                    .map(apart)
                    .fold(f64::INFINITY, f64::min);
                // The facets of both take a hundredth of a millimetre.
                let follows = least > 0.8 * clearance - 1e-5;
                assert_eq!(follows, advance != -sense, "{pitch} {advance}: {least}");
            }
            assert!(thread.nut([0.003, 0.008], 0.008, clearance).is_err());
            assert!(thread.bolt(f64::NAN, [0.006, 0.002]).is_err());
        }
    }
}
