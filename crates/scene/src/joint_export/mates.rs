//! Mates for CAD: which faces of two docked parts lie on each other, and the joint they leave.

use std::path::Path;

use fft_correlate::Pose;
use fft_correlate::mating::{Joint, MatingContact, Travel};
use glam::DVec3;
use sdf_grid::{PatchAxis, Plane, RoundPatch, SpherePatch, SurfaceFeatures, TriangleMesh, atomic};
use serde::Serialize;

use super::error::ExportError;
use super::files::write_meshes;
use super::overlap::Overlap;
use super::pair::DockedPair;
use super::tree::Model;

/// Normals and axes that turn from each other by less are parallel: 2 degrees.
const PARALLEL_COSINE: f64 = 0.9994;

/// Faces mate if they have this share of the smaller of two planes in common, or of two spans.
const COMMON: f64 = 1e-3;

/// How faces lie on each other.
///
/// See the example of [`DockedPair`](crate::DockedPair).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MateKind {
    /// Planes with opposite normals.
    CoincidentPlanes,
    /// A pin and a hole, or cones, rings and threads about one axis.
    ConcentricCylinders,
    /// A ball and a cup.
    ConcentricSpheres,
}

/// One part's side of a mate, in the part's own frame.
///
/// See the example of [`DockedPair`](crate::DockedPair).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MateSide {
    /// Outward normal of a plane, unit length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 3]>,
    /// Direction of an axis, unit length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// A point where the faces lie on each other, of the axis, or the centre of a sphere, metres.
    pub point: [f64; 3],
    /// Of a cylinder or a sphere, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// The triangles that mate, numbered from 0.
    pub faces: Vec<u32>,
}

/// Faces of both parts that lie on each other.
///
/// See the example of [`DockedPair`](crate::DockedPair).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MateRecord {
    /// How.
    pub kind: MateKind,
    /// Between planes, positive where there is a gap; between axes or centres; metres.
    pub offset: f64,
    /// Radius of the hole less that of the pin, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearance: Option<f64>,
    /// Of the planes' common area, or the smaller patch, square metres.
    pub area: f64,
    /// The fixed part's side.
    pub fixed: MateSide,
    /// The moving part's side.
    pub moving: MateSide,
}

/// A pose as it is written: `position` in metres, `rotation` a unit quaternion `x, y, z, w`.
///
/// See the example of [`DockedPair`](crate::DockedPair).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseRecord {
    /// Metres.
    pub position: [f64; 3],
    /// `x, y, z, w`.
    pub rotation: [f64; 4],
}

/// A part's mesh.
///
/// See the example of [`DockedPair`](crate::DockedPair).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartRecord {
    /// The file beside the mates whose triangles are numbered; empty if none is written.
    pub mesh: String,
    /// How many it has.
    pub triangles: usize,
    /// Axis of the joint in the part's own frame; zero of joints without one.
    pub axis: [f64; 3],
    /// Point of the axis, or centre, in the part's own frame, metres.
    pub point: [f64; 3],
}

/// How far a free motion goes.
///
/// See the example of [`DockedPair`](crate::DockedPair).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TravelRecord {
    /// Metres, or radians.
    pub range: [f64; 2],
    /// Whether the parts block it there.
    pub blocked: [bool; 2],
}

/// The joint between the parts, in the fixed part's own frame.
///
/// See the example of [`DockedPair`](crate::DockedPair).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointRecord {
    /// `prismatic`, `cylindrical`, ...
    pub kind: &'static str,
    /// Free motions.
    pub freedoms: usize,
    /// Unit length; zero of joints without one.
    pub axis: [f64; 3],
    /// A point of the axis, or the centre of a ball, metres.
    pub point: [f64; 3],
    /// Displacement per turn of a screw, metres, positive if right-handed.
    pub pitch: f64,
    /// Along the axis, metres.
    pub slide: Option<TravelRecord>,
    /// About the axis, radians.
    pub turn: Option<TravelRecord>,
    /// The free motions: displacements of the moving part's centre (metres), then turns (radians).
    pub free: Vec<[f64; 6]>,
}

/// The content of a file of mates.
///
/// See the example of [`DockedPair`](crate::DockedPair).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mates {
    /// `pegfit mates 1`.
    pub format: &'static str,
    /// What the pair is called.
    pub name: String,
    /// From the moving part's own frame to the fixed part's own frame.
    pub pose: PoseRecord,
    /// From the fixed part's own frame to the scene.
    pub placed: PoseRecord,
    /// The joint that contact leaves.
    pub joint: JointRecord,
    /// The part that stays.
    pub fixed: PartRecord,
    /// The part that moves.
    pub moving: PartRecord,
    /// Clearance within which faces mate, metres.
    pub clearance: f64,
    /// Faces that lie on each other, the largest area first.
    pub mates: Vec<MateRecord>,
}

/// Finds the faces by which two docked parts are put together.
pub fn mates(pair: &DockedPair) -> Mates {
    let features = [pair.fixed, pair.moving].map(SurfaceFeatures::new);
    let clearance = pair.clearance.unwrap_or_else(|| {
        MatingContact::new(
            [pair.fixed, pair.moving],
            [&features[0], &features[1]],
            None,
        )
        .clearance()
    });
    let finder = Finder {
        pair,
        features: &features,
        clearance,
    };
    let mut found = finder.planes();
    found.extend(finder.cylinders());
    found.extend(finder.spheres());
    found.sort_by(|a, b| b.area.total_cmp(&a.area));
    let part = |mesh: &TriangleMesh, (axis, point): (DVec3, DVec3)| PartRecord {
        mesh: String::new(),
        triangles: mesh.triangles().len(),
        axis: plain(axis),
        point: plain(point),
    };
    let joint = pair.joint;
    Mates {
        format: "pegfit mates 1",
        name: pair.name.to_owned(),
        pose: PoseRecord::from(&pair.pose),
        placed: PoseRecord::from(&pair.placed),
        fixed: part(pair.fixed, (joint.axis, joint.point)),
        moving: part(pair.moving, joint.in_moving_frame(&pair.pose)),
        joint: JointRecord::from(joint),
        clearance,
        mates: found,
    }
}

/// Writes the mates of a pair as JSON, and its meshes, whose triangles they number, as
/// `STEM-fixed.obj` and `STEM-moving.obj` beside it.
///
/// # Errors
/// If a file cannot be written, or a mesh would replace one that the pair keeps.
pub fn write_mates(pair: &DockedPair, path: &Path) -> Result<(), ExportError> {
    let names = write_meshes(&Model::from(pair), path)?;
    let mut mates = mates(pair);
    for (part, name) in [&mut mates.fixed, &mut mates.moving].into_iter().zip(names) {
        part.mesh = name;
    }
    let text = serde_json::to_vec_pretty(&mates).map_err(|source| ExportError::Text {
        path: path.to_owned(),
        source,
    })?;
    Ok(atomic::write(path, &text)?)
}

impl From<&Pose> for PoseRecord {
    fn from(pose: &Pose) -> Self {
        Self {
            position: plain(pose.translation),
            rotation: pose.rotation.to_array(),
        }
    }
}

impl From<&Joint> for JointRecord {
    fn from(joint: &Joint) -> Self {
        let travel = |t: Travel| TravelRecord {
            range: t.range.map(|r| r + 0.0),
            blocked: t.blocked,
        };
        Self {
            kind: joint.kind.name(),
            freedoms: joint.kind.freedoms(),
            axis: plain(joint.axis),
            point: plain(joint.point),
            pitch: joint.pitch,
            slide: joint.slide.map(travel),
            turn: joint.turn.map(travel),
            free: joint.free.clone(),
        }
    }
}

/// Without minuses before zeros.
fn plain(v: DVec3) -> [f64; 3] {
    v.to_array().map(|x| x + 0.0)
}

struct Finder<'a> {
    pair: &'a DockedPair<'a>,
    /// Of the fixed part and the moving one, each in its own frame.
    features: &'a [SurfaceFeatures; 2],
    clearance: f64,
}

impl Finder<'_> {
    /// Planes that lie on each other.
    fn planes(&self) -> Vec<MateRecord> {
        let [fixed, moving] = self.features;
        let mut found = Vec::new();
        for a in &fixed.planes {
            for b in &moving.planes {
                found.extend(self.coincident(a, b));
            }
        }
        found
    }

    fn coincident(&self, a: &Plane, b: &Plane) -> Option<MateRecord> {
        let pose = &self.pair.pose;
        let normal = pose.rotation * b.normal;
        let apart = pose.apply(b.middle) - a.middle;
        let beside = apart - apart.dot(a.normal) * a.normal;
        if a.normal.dot(normal) > -PARALLEL_COSINE || beside.length() > a.radius + b.radius {
            return None;
        }
        let corners = |mesh: &TriangleMesh, plane: &Plane, at: &Pose| {
            let one = |f: &u32| (*f, mesh.corners(*f as usize).map(|p| at.apply(p)));
            plane.faces.iter().map(one).collect::<Vec<_>>()
        };
        let offset = |at: DVec3| at.dot(a.normal) - a.offset;
        // Before triangles are compared: some point of the plane is near enough.
        let tilt = b.radius * (1.0 - PARALLEL_COSINE * PARALLEL_COSINE).sqrt();
        if offset(pose.apply(b.middle)).abs() > self.clearance + tilt {
            return None;
        }
        let sets = [
            corners(self.pair.fixed, a, &Pose::IDENTITY),
            corners(self.pair.moving, b, pose),
        ];
        let least = 1e-9 * a.area.min(b.area);
        let overlap = Overlap::new(a.normal, [&sets[0], &sets[1]], least);
        // On the fixed plane; straight above on the moving one.
        let on_fixed = overlap.centre + a.offset * a.normal;
        let on_moving = {
            let height = (pose.apply(b.middle) - on_fixed).dot(normal) / a.normal.dot(normal);
            on_fixed + height * a.normal
        };
        if overlap.area < COMMON * a.area.min(b.area) || offset(on_moving).abs() > self.clearance {
            return None;
        }
        let side = |normal, point, faces| MateSide {
            normal: Some(plain(normal)),
            axis: None,
            point: plain(point),
            radius: None,
            faces,
        };
        let [of_fixed, of_moving] = overlap.faces;
        Some(MateRecord {
            kind: MateKind::CoincidentPlanes,
            offset: offset(on_moving),
            clearance: None,
            area: overlap.area,
            fixed: side(a.normal, on_fixed, of_fixed),
            moving: side(b.normal, pose.inverse().apply(on_moving), of_moving),
        })
    }

    /// Pins in holes.
    fn cylinders(&self) -> Vec<MateRecord> {
        let [fixed, moving] = self.features;
        let mut found = Vec::new();
        for a in &fixed.axes {
            for b in &moving.axes {
                for p in &a.patches {
                    for q in b.patches.iter().filter(|q| q.convex != p.convex) {
                        found.extend(self.concentric((a, p), (b, q)));
                    }
                }
            }
        }
        found
    }

    fn concentric(
        &self,
        (a, p): (&PatchAxis, &RoundPatch),
        (b, q): (&PatchAxis, &RoundPatch),
    ) -> Option<MateRecord> {
        let pose = &self.pair.pose;
        let (point, direction) = (pose.apply(b.point), pose.rotation * b.direction);
        let cosine = direction.dot(a.direction);
        let along = |at: DVec3| (at - a.point).dot(a.direction);
        let ends = q.span.map(|s| along(point + s * direction));
        let [low, high] = [
            p.span[0].max(ends[0].min(ends[1])),
            p.span[1].min(ends[0].max(ends[1])),
        ];
        let least = COMMON * (p.span[1] - p.span[0]).min(q.span[1] - q.span[0]);
        let play = if p.convex {
            q.radius - p.radius
        } else {
            p.radius - q.radius
        };
        if cosine.abs() < PARALLEL_COSINE || high - low <= least || play.abs() > self.clearance {
            return None;
        }
        // Both axes where the patches lie on each other.
        let on_fixed = a.point + 0.5 * (low + high) * a.direction;
        let on_moving = point + (on_fixed - point).dot(direction) * direction;
        let offset = on_fixed.distance(on_moving);
        if offset > self.clearance {
            return None;
        }
        let within = |mesh: &TriangleMesh, faces: &[u32], at: &Pose| -> Vec<u32> {
            let kept = |f: &&u32| {
                let heights = mesh.corners(**f as usize).map(|c| along(at.apply(c)));
                heights.iter().any(|h| *h > low) && heights.iter().any(|h| *h < high)
            };
            let mut kept: Vec<u32> = faces.iter().filter(kept).copied().collect();
            kept.sort_unstable();
            kept
        };
        let side = |axis, point, radius, faces| MateSide {
            normal: None,
            axis: Some(plain(axis)),
            point: plain(point),
            radius: Some(radius),
            faces,
        };
        let of_fixed = within(self.pair.fixed, &p.faces, &Pose::IDENTITY);
        let of_moving = within(self.pair.moving, &q.faces, pose);
        // Both axes lead the same way.
        let own = cosine.signum() * b.direction;
        Some(MateRecord {
            kind: MateKind::ConcentricCylinders,
            offset,
            clearance: Some(play),
            area: p.area.min(q.area),
            fixed: side(a.direction, on_fixed, p.radius, of_fixed),
            moving: side(own, pose.inverse().apply(on_moving), q.radius, of_moving),
        })
    }

    /// Balls in cups.
    fn spheres(&self) -> Vec<MateRecord> {
        let [fixed, moving] = self.features;
        let mut found = Vec::new();
        for p in &fixed.spheres {
            for q in moving.spheres.iter().filter(|q| q.convex != p.convex) {
                found.extend(self.ball(p, q));
            }
        }
        found
    }

    fn ball(&self, p: &SpherePatch, q: &SpherePatch) -> Option<MateRecord> {
        let offset = p.centre.distance(self.pair.pose.apply(q.centre));
        let play = if p.convex {
            q.radius - p.radius
        } else {
            p.radius - q.radius
        };
        if offset > self.clearance || play.abs() > self.clearance {
            return None;
        }
        let side = |patch: &SpherePatch| MateSide {
            normal: None,
            axis: None,
            point: plain(patch.centre),
            radius: Some(patch.radius),
            faces: {
                let mut faces = patch.faces.clone();
                faces.sort_unstable();
                faces
            },
        };
        Some(MateRecord {
            kind: MateKind::ConcentricSpheres,
            offset,
            clearance: Some(play),
            area: p.area.min(q.area),
            fixed: side(p),
            moving: side(q),
        })
    }
}
