//! Shapes of links and bodies in robots' descriptions, and poses as these write them.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use fft_correlate::Pose;
use glam::{DMat3, DQuat, DVec3};
use sdf_grid::mesh_io::{MeshFile, ReadOptions};
use sdf_grid::{Ledger, LengthUnit, MeshError, RepairOptions, TriangleMesh, shapes};

/// Edges around a full turn of cylinders and capsules.
pub(crate) const SEGMENTS: u32 = 64;

/// Cuts of each face of the icosahedron that a sphere is made of.
const SUBDIVISIONS: u32 = 16;

/// A shape of a robot's description.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shape {
    /// Of its link or body.
    pub(crate) name: String,
    /// Number of its link or body.
    pub(crate) group: usize,
    pub(crate) pose: Pose,
    pub(crate) geometry: Geometry,
}

/// What it is.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Geometry {
    /// A mesh file whose coordinates times `scale` are metres.
    Mesh { path: PathBuf, scale: DVec3 },
    /// Triangles that are here already.
    Triangles(Arc<Triangles>),
    /// Edges, metres.
    Box(DVec3),
    /// About z, metres.
    Cylinder { radius: f64, height: f64 },
    /// A cylinder about z with a half sphere on either end, metres; `height` is the cylinder's.
    Capsule { radius: f64, height: f64 },
    /// Metres.
    Sphere(f64),
    /// Half axes, metres.
    Ellipsoid(DVec3),
}

/// A surface in metres.
#[derive(Debug, PartialEq)]
pub(crate) struct Triangles {
    /// For errors.
    pub(crate) name: String,
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Geometry {
    /// Its surface in metres; what was read of a file of its own goes into the ledger.
    pub(crate) fn mesh(&self, ledger: &mut Ledger) -> Result<TriangleMesh, MeshError> {
        match self {
            Self::Mesh { path, scale } => scaled(path, *scale, ledger),
            Self::Triangles(found) => {
                let (vertices, triangles) = (found.vertices.clone(), found.triangles.clone());
                clean(&found.name, vertices, triangles)
            }
            Self::Box(size) => shapes::cuboid(*size),
            Self::Cylinder { radius, height } => shapes::cylinder(*radius, *height, SEGMENTS),
            Self::Capsule { radius, height } => capsule(*radius, *height),
            Self::Sphere(radius) => shapes::icosphere(*radius, SUBDIVISIONS),
            Self::Ellipsoid(axes) => {
                for axis in axes.to_array() {
                    positive("ellipsoid", "half axis", axis)?;
                }
                let ball = shapes::icosphere(1.0, SUBDIVISIONS)?;
                let vertices = ball.vertices().iter().map(|v| *v * *axes).collect();
                clean("ellipsoid", vertices, ball.triangles().to_vec())
            }
        }
    }

    /// Its kind, in the words of robots' descriptions.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Mesh { .. } | Self::Triangles(_) => "mesh",
            Self::Box(_) => "box",
            Self::Cylinder { .. } => "cylinder",
            Self::Capsule { .. } => "capsule",
            Self::Sphere(_) => "sphere",
            Self::Ellipsoid(_) => "ellipsoid",
        }
    }

    /// Whether facets take the place of a curved surface.
    pub(crate) fn is_faceted(&self) -> bool {
        !matches!(self, Self::Mesh { .. } | Self::Triangles(_) | Self::Box(_))
    }
}

/// A capsule of as many edges around every full turn as a cylinder has.
fn capsule(radius: f64, height: f64) -> Result<TriangleMesh, MeshError> {
    positive("capsule", "radius", radius)?;
    positive("capsule", "height", height)?;
    let quarter = SEGMENTS / 4;
    let mut vertices = Vec::new();
    // Rings from the lower pole to the upper one; the poles are rings of one point, welded later.
    let rings = (0..=quarter)
        .map(|i| (i, -0.5))
        .chain((quarter..=2 * quarter).map(|i| (i, 0.5)));
    for (i, end) in rings.clone() {
        let latitude = TAU * (f64::from(i) / f64::from(SEGMENTS) - 0.25);
        for j in 0..SEGMENTS {
            let longitude = TAU * f64::from(j) / f64::from(SEGMENTS);
            let (sin, cos) = latitude.sin_cos();
            let around = DVec3::new(longitude.cos(), longitude.sin(), 0.0);
            vertices.push(radius * (cos * around + sin * DVec3::Z) + end * height * DVec3::Z);
        }
    }
    let mut triangles = Vec::new();
    for ring in 1..rings.count() as u32 {
        for j in 0..SEGMENTS {
            let next = (j + 1) % SEGMENTS;
            let [a, b] = [j, next].map(|j| (ring - 1) * SEGMENTS + j);
            let [c, d] = [a, b].map(|i| i + SEGMENTS);
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    clean("capsule", vertices, triangles)
}

fn positive(part: &str, item: &'static str, found: f64) -> Result<(), MeshError> {
    if found > 0.0 && found.is_finite() {
        return Ok(());
    }
    Err(MeshError::OutOfRange {
        part: part.to_owned(),
        item,
        expected: "positive and finite",
        found,
    })
}

fn clean(
    name: &str,
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
) -> Result<TriangleMesh, MeshError> {
    Ok(TriangleMesh::clean(name, vertices, triangles, &RepairOptions::default())?.0)
}

/// A mesh file whose coordinates are stretched along its axes; a mirrored one is turned inside out
/// again by cleaning.
fn scaled(path: &Path, scale: DVec3, ledger: &mut Ledger) -> Result<TriangleMesh, MeshError> {
    let options = ReadOptions {
        unit: LengthUnit::M,
        ..ReadOptions::default()
    };
    let file = MeshFile::open(path, &options.step)?;
    ledger.extend(&file.ledger(&options));
    let (mesh, _) = file.clean(&options)?;
    if scale == DVec3::ONE {
        return Ok(mesh);
    }
    let vertices = mesh.vertices().iter().map(|v| *v * scale).collect();
    clean(
        &path.display().to_string(),
        vertices,
        mesh.triangles().to_vec(),
    )
}

/// Fixed-axis roll, pitch and yaw, radians, of URDF.
pub(crate) fn roll_pitch_yaw([roll, pitch, yaw]: [f64; 3]) -> DQuat {
    DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(pitch) * DQuat::from_rotation_x(roll)
}

/// Three turns, radians, about the axes that `sequence` names: small letters turn with the body,
/// capitals stay. `None` if a letter is no axis.
pub(crate) fn euler(sequence: &str, angles: [f64; 3]) -> Option<DQuat> {
    let mut rotation = DQuat::IDENTITY;
    let letters: Vec<char> = sequence.chars().collect();
    let [a, b, c] = letters[..] else { return None };
    for (letter, angle) in [a, b, c].into_iter().zip(angles) {
        let axis = match letter.to_ascii_lowercase() {
            'x' => DVec3::X,
            'y' => DVec3::Y,
            'z' => DVec3::Z,
            _ => return None,
        };
        let turn = DQuat::from_axis_angle(axis, angle);
        rotation = match letter.is_ascii_lowercase() {
            true => rotation * turn,
            false => turn * rotation,
        };
    }
    Some(rotation)
}

/// The frame with these x and y axes, the second made perpendicular to the first; `None` if they are
/// parallel.
pub(crate) fn from_axes([a, b, c, d, e, f]: [f64; 6]) -> Option<DQuat> {
    let x = DVec3::new(a, b, c).try_normalize()?;
    let y = DVec3::new(d, e, f);
    let y = (y - x * x.dot(y)).try_normalize()?;
    Some(DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))))
}

/// The least turn of z onto an axis; onto -z, the one about x, as MuJoCo has it. `None` if the axis is
/// zero.
pub(crate) fn from_z_axis(axis: [f64; 3]) -> Option<DQuat> {
    let axis = DVec3::from(axis).try_normalize()?;
    let about = DVec3::Z.cross(axis);
    let angle = about.length().atan2(axis.z);
    let about = if about.length() < 1e-10 {
        DVec3::X
    } else {
        about.normalize()
    };
    Some(DQuat::from_axis_angle(about, angle))
}

/// A pose of a quaternion that need not be of unit length.
pub(crate) fn pose(rotation: DQuat, position: [f64; 3]) -> Pose {
    Pose::new(rotation, DVec3::from(position))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Facets on the surface take away less than their sagitta would all around.
    #[test]
    fn round_solids_have_nearly_their_volumes_and_all_of_their_size() {
        let (r, h) = (2e-3, 7e-3);
        let ball = 4.0 / 3.0 * PI;
        let axes = DVec3::new(4e-3, 1e-3, 6e-3);
        for (geometry, volume, size) in [
            (
                Geometry::Capsule {
                    radius: r,
                    height: h,
                },
                ball * r * r * r + PI * r * r * h,
                DVec3::new(2.0 * r, 2.0 * r, h + 2.0 * r),
            ),
            (
                Geometry::Ellipsoid(axes),
                ball * axes.x * axes.y * axes.z,
                2.0 * axes,
            ),
        ] {
            let mesh = geometry.mesh(&mut Ledger::default()).unwrap();
            let lacking = 1.0 - mesh.volume() / volume;
            assert!((0.0..6e-3).contains(&lacking), "{geometry:?}: {lacking}");
            let bounds = mesh.bounds();
            let off = bounds.size() / size - DVec3::ONE;
            assert!(off.abs().max_element() < 4e-3, "{geometry:?}: {off}");
            let centre = 0.5 * (bounds.min + bounds.max);
            assert!(centre.length() < 1e-5, "{geometry:?}: {centre}");
        }
        let flat = Geometry::Ellipsoid(DVec3::new(1.0, 0.0, 1.0));
        assert!(flat.mesh(&mut Ledger::default()).is_err());
    }

    /// Turns about axes that stay, in one order, are turns about axes that turn along, in the other.
    #[test]
    fn sequences_of_turns_agree() {
        let [a, b, c] = [0.3, -0.7, 1.1];
        let fixed = roll_pitch_yaw([a, b, c]);
        let same = |found: Option<DQuat>| (found.unwrap().dot(fixed).abs() - 1.0).abs() < 1e-12;
        assert!(same(euler("XYZ", [a, b, c])));
        assert!(same(euler("zyx", [c, b, a])));
        assert!(!same(euler("xyz", [a, b, c])));
        assert!(euler("xy", [a, b, c]).is_none() && euler("xyw", [a, b, c]).is_none());
    }

    #[test]
    fn axes_become_a_frame() {
        let turn = roll_pitch_yaw([0.4, 0.2, -0.9]);
        let (x, y) = (turn * DVec3::X, turn * (DVec3::Y + 0.3 * DVec3::X));
        let found = from_axes([2.0 * x.x, 2.0 * x.y, 2.0 * x.z, y.x, y.y, y.z]).unwrap();
        assert!((found.dot(turn).abs() - 1.0).abs() < 1e-12);
        assert!(from_axes([1.0, 0.0, 0.0, -2.0, 0.0, 0.0]).is_none());
    }

    #[test]
    fn the_z_axis_turns_the_least_way_and_about_x_onto_its_opposite() {
        for axis in [[0.3, -0.4, 0.2], [0.0, 2.0, 0.0], [1e-13, 0.0, 3.0]] {
            let turn = from_z_axis(axis).unwrap();
            let expected = DVec3::from(axis).normalize();
            assert!((turn * DVec3::Z - expected).length() < 1e-12, "{axis:?}");
            assert!(turn.z.abs() < 1e-15, "{axis:?}: {turn}");
        }
        let turn = from_z_axis([0.0, 0.0, -2.0]).unwrap();
        assert!((turn * DVec3::X - DVec3::X).length() < 1e-15);
        assert!((turn * DVec3::Y + DVec3::Y).length() < 1e-15);
        assert!(from_z_axis([0.0; 3]).is_none());
    }
}
