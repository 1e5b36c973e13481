//! Solids along z whose section widens and narrows: chamfers, fillets, steps.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use super::solids::{finish, out_of_range};
use crate::mesh::error::MeshError;
use crate::mesh::polygon;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Chords of a fillet's quarter arc.
const CHORDS: u32 = 4;

/// Walls along z: an outline that is widened by other amounts at other heights, straight between.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// The outline at offset 0, metres, counter-clockwise.
    pub outline: Vec<DVec2>,
    /// Height along z and offset of every side outwards there, metres, from one end to the other.
    /// Two of one height make a step.
    pub levels: Vec<[f64; 2]>,
}

/// How an edge all round a profile is broken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EdgeBreak {
    /// At 45 degrees, this far along both faces, metres.
    Chamfer(f64),
    /// By a quarter arc of this radius, metres, cut into four chords.
    Fillet(f64),
}

impl EdgeBreak {
    /// From the face across the axis to the wall: how far it lies within the wall and how far
    /// behind the face, metres.
    fn steps(self) -> Vec<[f64; 2]> {
        match self {
            Self::Chamfer(c) => vec![[c, 0.0], [0.0, c]],
            Self::Fillet(r) => (0..=CHORDS)
                .map(|i| {
                    let angle = FRAC_PI_2 * f64::from(i) / f64::from(CHORDS);
                    [r * (1.0 - angle.sin()), r * (1.0 - angle.cos())]
                })
                .collect(),
        }
    }

    /// Levels of the lower end of a solid at height `z` whose walls have `offset`.
    pub fn at_foot(self, z: f64, offset: f64) -> Vec<[f64; 2]> {
        let level = |[inset, rise]: [f64; 2]| [z + rise, offset - inset];
        self.steps().into_iter().map(level).collect()
    }

    /// Levels of its upper end.
    pub fn at_head(self, z: f64, offset: f64) -> Vec<[f64; 2]> {
        let level = |[inset, rise]: [f64; 2]| [z - rise, offset - inset];
        self.steps().into_iter().rev().map(level).collect()
    }

    /// Levels of the mouth of a hole, downwards, at height `z`.
    pub fn at_mouth(self, z: f64, offset: f64) -> Vec<[f64; 2]> {
        let level = |[inset, rise]: [f64; 2]| [z - rise, offset + inset];
        self.steps().into_iter().map(level).collect()
    }
}

/// A solid between the lowest and the highest level of `outside`, with a hole from its upper face
/// down to the last level of `hole`: through if that is the lowest of `outside`, else with a floor.
///
/// # Errors
/// If a number is not finite, a profile has fewer than three corners or two levels, the levels of
/// `outside` do not rise, those of `hole` do not fall from its upper face to between its ends, or an
/// offset makes a section cross itself or leaves nothing around the hole at an end.
pub fn profiled(outside: &Profile, hole: Option<&Profile>) -> Result<TriangleMesh, MeshError> {
    let [bottom, top] = ends(outside, 1.0)?;
    let depths = hole.map(|h| ends(h, -1.0)).transpose()?;
    if let Some([mouth, floor]) = depths {
        if mouth != top {
            return Err(refused("mouth of the hole", "at the upper face", mouth));
        }
        if floor < bottom {
            return Err(refused("floor of the hole", "above the lower face", floor));
        }
    }
    let mut solid = Solid::default();
    let walls = solid.walls(outside);
    let inner = hole.map_or(Vec::new(), |h| solid.walls(h));
    let through = depths.is_some_and(|[_, floor]| floor == bottom);
    let (mouth, end) = (inner.first().copied(), inner.last().copied());
    solid.cap(walls[walls.len() - 1], mouth, true)?;
    solid.cap(walls[0], end.filter(|_| through), false)?;
    if let Some(floor) = end.filter(|_| !through) {
        solid.cap(floor, None, true)?;
    }
    finish("profiled solid", solid.vertices, solid.triangles)
}

fn refused(item: &'static str, expected: &'static str, found: f64) -> MeshError {
    out_of_range("profiled solid", item, expected, found)
}

/// The first and the last height of a profile, if it is fit for use and its levels go upwards (1) or
/// downwards (-1).
fn ends(profile: &Profile, sense: f64) -> Result<[f64; 2], MeshError> {
    let corners = profile.outline.len();
    if corners < 3 {
        return Err(refused("corners of a profile", "3 or more", corners as f64));
    }
    let levels = profile.levels.len();
    if levels < 2 {
        return Err(refused("levels of a profile", "2 or more", levels as f64));
    }
    let numbers = profile.outline.iter().flat_map(|p| p.to_array());
    let mut numbers = numbers.chain(profile.levels.iter().flatten().copied());
    if let Some(found) = numbers.find(|v| !v.is_finite()) {
        return Err(refused("number of a profile", "finite", found));
    }
    let steps = profile
        .levels
        .windows(2)
        .map(|w| sense * (w[1][0] - w[0][0]));
    match steps.into_iter().find(|s| *s < 0.0) {
        Some(step) => Err(refused("step between levels", "along the profile", step)),
        None => Ok([0, levels - 1].map(|i| profile.levels[i][0])),
    }
}

/// The outline with every side moved outwards by `offset`; corners stay corners.
pub(super) fn widened(outline: &[DVec2], offset: f64) -> Vec<DVec2> {
    let n = outline.len();
    let normal = |i: usize| {
        -(outline[(i + 1) % n] - outline[i])
            .normalize_or_zero()
            .perp()
    };
    let corner = |i: usize| {
        let (a, b) = (normal((i + n - 1) % n), normal(i));
        outline[i] + offset * (a + b) / (1.0 + a.dot(b))
    };
    (0..n).map(corner).collect()
}

/// First vertex and number of corners of a section.
pub(super) type Ring = (u32, u32);

/// Vertices and triangles of a solid between sections across z.
#[derive(Default)]
pub(super) struct Solid {
    pub(super) vertices: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Solid {
    /// Adds the sections of a profile and the walls between them, which face outwards where the
    /// levels go up.
    fn walls(&mut self, profile: &Profile) -> Vec<Ring> {
        let section = |[z, offset]: &[f64; 2]| -> Vec<DVec3> {
            let section = widened(&profile.outline, *offset);
            section.iter().map(|p| p.extend(*z)).collect()
        };
        let sections: Vec<_> = profile.levels.iter().map(section).collect();
        self.skin(&sections)
    }

    /// Adds sections with equally many corners and the walls between them, which face outwards where
    /// the sections go up.
    pub(super) fn skin(&mut self, sections: &[Vec<DVec3>]) -> Vec<Ring> {
        let n = sections.first().map_or(0, Vec::len) as u32;
        let mut rings: Vec<Ring> = Vec::with_capacity(sections.len());
        for section in sections {
            rings.push((self.vertices.len() as u32, n));
            self.vertices.extend(section);
        }
        for pair in rings.windows(2) {
            let [(low, _), (high, _)] = [pair[0], pair[1]];
            for i in 0..n {
                let j = (i + 1) % n;
                self.triangles
                    .extend([[low + i, low + j, high + j], [low + i, high + j, high + i]]);
            }
        }
        rings
    }

    /// Adds a face across the axis, within a section and outside a hole.
    pub(super) fn cap(
        &mut self,
        ring: Ring,
        hole: Option<Ring>,
        up: bool,
    ) -> Result<(), MeshError> {
        let indices = |(first, n): Ring| first..first + n;
        let section = |ring: Ring| -> Vec<DVec2> {
            indices(ring)
                .map(|i| self.vertices[i as usize].truncate())
                .collect()
        };
        let holes: Vec<_> = hole.iter().map(|h| section(*h)).collect();
        let places: Vec<u32> = indices(ring)
            .chain(hole.into_iter().flat_map(indices))
            .collect();
        let found = polygon::triangulate(&section(ring), &holes);
        let faces = found.ok_or_else(|| MeshError::Polygon {
            part: "solid between sections".into(),
            polygon: 0,
            found: "one that crosses itself or its hole, or has no area".into(),
        })?;
        let placed = faces.into_iter().map(|[a, b, c]| match up {
            true => [a, b, c],
            false => [a, c, b],
        });
        self.triangles
            .extend(placed.map(|t| t.map(|i| places[i as usize])));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(half: f64) -> Vec<DVec2> {
        [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(DVec2::from)
            .to_vec()
    }

    #[test]
    fn volumes_of_a_chamfered_rod_and_of_blocks_with_holes() {
        let chamfer = EdgeBreak::Chamfer(1.0);
        let levels = [chamfer.at_foot(0.0, 0.0), chamfer.at_head(10.0, 0.0)].concat();
        let rod = Profile {
            outline: square(2.0),
            levels,
        };
        // The frustum between squares of edge 2 and 4, twice, and 8 of the full section.
        let frustum = (4.0 + 16.0 + 8.0) / 3.0;
        let solid = profiled(&rod, None).unwrap();
        assert!((solid.volume() - (8.0 * 16.0 + 2.0 * frustum)).abs() < 1e-9);
        let block = Profile {
            outline: square(5.0),
            levels: vec![[0.0, 0.0], [10.0, 0.0]],
        };
        for (floor, depth) in [(0.0, 10.0), (3.0, 7.0)] {
            let hole = Profile {
                outline: square(1.5),
                levels: [chamfer.at_mouth(10.0, 0.5), vec![[floor, 0.5]]].concat(),
            };
            let solid = profiled(&block, Some(&hole)).unwrap();
            let mouth = (16.0 + 36.0 + 24.0) / 3.0;
            let expected = 1000.0 - 16.0 * (depth - 1.0) - mouth;
            assert!(
                (solid.volume() - expected).abs() < 1e-9,
                "{}",
                solid.volume()
            );
        }
    }

    #[test]
    fn a_fillet_lies_between_its_chamfer_and_the_corner() {
        let volume = |edge: EdgeBreak| {
            let levels = [edge.at_foot(0.0, 0.0), vec![[5.0, 0.0]]].concat();
            profiled(
                &Profile {
                    outline: square(2.0),
                    levels,
                },
                None,
            )
            .unwrap()
            .volume()
        };
        let (fillet, chamfer) = (
            volume(EdgeBreak::Fillet(1.0)),
            volume(EdgeBreak::Chamfer(1.0)),
        );
        assert!(chamfer < fillet && fillet < 80.0, "{chamfer} {fillet}");
    }

    #[test]
    fn profiles_that_make_no_solid_are_refused() {
        let block = Profile {
            outline: square(5.0),
            levels: vec![[0.0, 0.0], [10.0, 0.0]],
        };
        let hole = |levels: &[[f64; 2]]| Profile {
            outline: square(1.0),
            levels: levels.to_vec(),
        };
        for wrong in [
            hole(&[[9.0, 0.0], [2.0, 0.0]]),
            hole(&[[10.0, 0.0], [-2.0, 0.0]]),
            hole(&[[10.0, 0.0], [4.0, 0.0], [5.0, 0.0]]),
            hole(&[[10.0, 0.0]]),
            hole(&[[10.0, f64::NAN], [2.0, 0.0]]),
            hole(&[[10.0, 5.0], [2.0, 5.0]]),
            Profile {
                outline: Vec::new(),
                levels: vec![[10.0, 0.0], [2.0, 0.0]],
            },
        ] {
            assert!(profiled(&block, Some(&wrong)).is_err(), "{wrong:?}");
        }
        let fallen = Profile {
            levels: vec![[1.0, 0.0], [0.0, 0.0]],
            ..block
        };
        assert!(profiled(&fallen, None).is_err());
    }
}
