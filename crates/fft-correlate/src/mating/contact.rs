//! Contact of two parts at a pose: which samples mate, how well they hold the part, how far the parts
//! lie in one another.

use std::collections::HashMap;

use glam::DVec3;
use sdf_grid::{
    FaceGrid, Matrix6, PatchAxis, SurfaceFeatures, SurfacePoint, TriangleMesh, Vector6,
    surface_points,
};

use super::axis::KnownAxis;
use crate::geometry::se3::Pose;

/// Eigenvalue of the Gramian from which on a motion counts as held.
pub(crate) const INFORMATION_FLOOR: f64 = 2e-4;

/// Eigenvalues beyond this say nothing more: a rim holds a lid as well as a face does.
const ENOUGH: f64 = 0.02;

/// Opposite faces turn from each other by at most 20 degrees.
const OPPOSITE_COSINE: f64 = 0.94;

/// Samples that evaluate a pose, those that screen hypotheses, and those that choose what to screen.
const SAMPLES: usize = 1500;
const FEW_SAMPLES: usize = 256;
const FEWEST_SAMPLES: usize = 80;

/// Samples of the fixed part, at most.
const MOST_FIXED_SAMPLES: usize = 60_000;

/// Hypotheses with less information are none, nats; less this where few samples tell it.
const LEAST: f64 = 8.0;
const MARGIN: f64 = 3.0;

/// Clearance within which faces of hypotheses mate, root mean square radii of the moving part.
const WIDEST: f64 = 0.06;

/// Faces that lie in one another mate up to this share of the thinnest wall, so that samples do not
/// mate through walls; and at least, at most so many radii.
const OF_A_WALL: f64 = 0.45;
const NARROWEST: f64 = 0.008;

/// A wall has at least this share of its part's surface.
const WALL_SHARE: f64 = 0.04;

/// Clearance of poses that are seated, as a share of that of hypotheses.
const SEATED: f64 = 2.0 / 3.0;

/// Samples deeper than this in the other part interpenetrate, clearances; coarse for hypotheses.
const DEEP: f64 = 0.1;
const COARSELY_DEEP: f64 = 0.3;

/// Directions in which a part may be pulled out.
const DIRECTIONS: usize = 162;

/// A direction is blocked by contact whose pressure along it is above this.
const BLOCKED: f64 = 5e-4;

/// The sum of `Jᵀ J` over mating samples, mean over the whole surface.
///
/// Its coordinates are a displacement along the axes of the fixed frame, and a turn about them through
/// the moving part's centre times its root mean square radius.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactGramian {
    /// Of all mating samples.
    pub matrix: Matrix6,
    /// Share of the moving part's surface that mates.
    pub share: f64,
}

impl ContactGramian {
    /// How much contact says about the pose, nats: the logarithm of the determinant of
    /// `1 + G / floor`.
    pub fn information(&self) -> f64 {
        match self.share {
            0.0 => 0.0,
            _ => self.matrix.ln_det_plus_identity(INFORMATION_FLOOR),
        }
    }

    /// The information where no motion counts as held better than by a small face.
    fn saturated_information(&self) -> f64 {
        let (values, _) = self.matrix.eigen();
        let of = |v: &f64| {
            let v = v.max(0.0);
            (1.0 + v * ENOUGH / (v + ENOUGH) / INFORMATION_FLOOR).ln()
        };
        values.iter().map(of).sum()
    }
}

/// How contact holds a part at a pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HoldReport {
    /// Information of contact, nats.
    pub information: f64,
    /// Share of the moving part's surface that mates.
    pub share: f64,
    /// Share of the directions in which nothing blocks a displacement: 0.5 of a part that lies on a
    /// plane, 0.13 of one in a corner, nearly 0 of one in a hole.
    pub escape: f64,
    /// Area of both surfaces that lies inside the other part, over the moving part's area.
    pub interpenetration: f64,
    /// What ranks poses before their overlap is known, nats.
    pub hold: f64,
}

/// Two parts whose contact is asked for at many poses.
#[derive(Debug)]
pub struct MatingContact {
    /// The fixed part's faces, for opposite faces within the clearance, and for depths.
    fixed: FaceGrid,
    moving: FaceGrid,
    samples: Vec<SurfacePoint>,
    few: Vec<SurfacePoint>,
    fewest: Vec<SurfacePoint>,
    /// Samples in each smooth patch of the moving part.
    patch_samples: Vec<u32>,
    fixed_samples: SampleCells,
    /// Samples of the fixed part per area as of the moving part: 1 over their number.
    fixed_weight: f64,
    /// Centre of the moving part's box, its frame, metres.
    pub(crate) centre: DVec3,
    /// Root mean square distance of its surface from the centre, metres.
    pub(crate) radius: f64,
    /// Clearance within which faces mate where hypotheses are screened, metres.
    clearance: f64,
    /// How far mating faces of hypotheses may lie in one another, and how far apart poses are that
    /// count as different, metres.
    pub(crate) resolution: f64,
    /// The fixed part's axes of turn, those with most area first.
    pub(super) axes: Vec<PatchAxis>,
    /// What the moving part turns about and slides along, if that is known.
    pub(super) known_axis: Option<KnownAxis>,
    /// Corners of the moving part's box, its frame, metres.
    pub(crate) corners: [DVec3; 8],
}

impl MatingContact {
    /// Prepares two parts with their features. Faces mate within `clearance` (metres), by default a
    /// share of the moving part's size and less where walls are thin.
    pub fn new(
        [fixed, moving]: [&TriangleMesh; 2],
        [fixed_features, moving_features]: [&SurfaceFeatures; 2],
        clearance: Option<f64>,
    ) -> Self {
        let samples = surface_points(moving, SAMPLES);
        let bounds = moving.bounds();
        let centre = bounds.center();
        let square = |s: &SurfacePoint| s.weight * s.position.distance_squared(centre);
        let radius = samples.iter().map(square).sum::<f64>().sqrt();
        let wall = (moving_features.wall_thickness(moving.area(), WALL_SHARE))
            .min(fixed_features.wall_thickness(fixed.area(), WALL_SHARE));
        let clearance = clearance.map_or(WIDEST * radius, |c| c / SEATED);
        let resolution = (OF_A_WALL * wall)
            .clamp(NARROWEST * radius, WIDEST * radius)
            .min(clearance);
        let count = SAMPLES as f64 * fixed.area() / moving.area();
        let count = (count as usize).clamp(SAMPLES, MOST_FIXED_SAMPLES);
        let patches = samples.iter().map(|s| s.patch + 1).max().unwrap_or(0);
        let mut patch_samples = vec![0; patches];
        for s in &samples {
            patch_samples[s.patch] += 1;
        }
        let mut axes = fixed_features.axes.clone();
        axes.sort_by(|a, b| b.area().total_cmp(&a.area()));
        Self {
            axes,
            known_axis: None,
            fixed: FaceGrid::new(fixed, clearance, OPPOSITE_COSINE),
            moving: FaceGrid::new(moving, resolution, OPPOSITE_COSINE),
            few: surface_points(moving, FEW_SAMPLES),
            fewest: surface_points(moving, FEWEST_SAMPLES),
            patch_samples,
            fixed_samples: SampleCells::new(&surface_points(fixed, count), bounds.diagonal() / 8.0),
            fixed_weight: fixed.area() / moving.area(),
            samples,
            centre,
            radius,
            clearance,
            resolution,
            corners: bounds.corners(),
        }
    }

    /// Clearance within which faces of a seated part mate, metres.
    pub fn clearance(&self) -> f64 {
        SEATED * self.clearance
    }

    /// How far apart and in one another mating faces may be for a clearance.
    fn limits(&self, clearance: f64) -> [f64; 2] {
        [
            clearance.min(self.resolution),
            clearance.min(self.clearance),
        ]
    }

    /// Calls `found` with every mating sample, its position, its normal and the opposite face's gap
    /// and normal, fixed frame.
    pub(super) fn visit_mating(
        &self,
        samples: &[SurfacePoint],
        pose: &Pose,
        clearance: f64,
        mut found: impl FnMut(&SurfacePoint, DVec3, DVec3, f64, DVec3),
    ) {
        let limits = self.limits(clearance);
        for sample in samples {
            let (p, n) = (pose.apply(sample.position), pose.rotation * sample.normal);
            if let Some(face) = self.fixed.opposite_face(p, n, limits) {
                found(
                    sample,
                    p,
                    pose.rotation * sample.smooth_normal,
                    face.gap,
                    face.normal,
                );
            }
        }
    }

    /// The row of a mating sample: what it resists.
    pub(super) fn row(&self, centre: DVec3, p: DVec3, n: DVec3) -> Vector6 {
        let t = (p - centre).cross(n) / self.radius;
        [n.x, n.y, n.z, t.x, t.y, t.z]
    }

    /// The contact Gramian at a pose within a clearance, metres.
    pub fn gramian(&self, pose: &Pose, clearance: f64) -> ContactGramian {
        self.gramian_of(&self.samples, pose, clearance)
    }

    fn gramian_of(&self, samples: &[SurfacePoint], pose: &Pose, clearance: f64) -> ContactGramian {
        let centre = pose.apply(self.centre);
        let mut gramian = ContactGramian::default();
        self.visit_mating(samples, pose, clearance, |s, p, n, _, _| {
            gramian.share += s.weight;
            gramian.matrix.add_outer(s.weight, &self.row(centre, p, n));
        });
        gramian
    }

    /// What ranks hypotheses: information within the coarse clearance, less what lies inside the
    /// fixed part; none where little mates or much lies inside.
    pub(super) fn screen(&self, pose: &Pose) -> Option<f64> {
        self.screen_by(pose, &self.few, LEAST)
    }

    /// The same by fewer samples: which hypotheses are worth more of them.
    pub(super) fn screen_coarsely(&self, pose: &Pose) -> Option<f64> {
        self.screen_by(pose, &self.fewest, LEAST - MARGIN)
    }

    fn screen_by(&self, pose: &Pose, samples: &[SurfacePoint], least: f64) -> Option<f64> {
        let clearance = self.clearance;
        let information = self.gramian_of(samples, pose, clearance).information();
        if information < least {
            return None;
        }
        let mut inside = 0.0;
        for s in samples {
            let p = pose.apply(s.position);
            if self.fixed.is_deeper(p, COARSELY_DEEP * self.resolution) {
                inside += s.weight;
                if information - INSIDE * inside < least {
                    return None;
                }
            }
        }
        Some(information - INSIDE * inside)
    }

    /// How contact holds the part at a pose, without its overlap.
    pub fn hold(&self, pose: &Pose) -> HoldReport {
        let held = self.mating(pose);
        let interpenetration = self.interpenetration(pose, f64::INFINITY);
        HoldReport {
            interpenetration,
            hold: held.hold - INSIDE * interpenetration,
            ..held
        }
    }

    /// The same hold as [`Self::hold`]'s, if it is above `least` (nats): faster where it is not.
    pub(super) fn hold_above(&self, pose: &Pose, least: f64) -> Option<f64> {
        let held = self.mating(pose);
        if held.hold <= least {
            return None;
        }
        let most = (held.hold - least) / INSIDE;
        let hold = held.hold - INSIDE * self.interpenetration(pose, most);
        (hold > least).then_some(hold)
    }

    /// How contact holds the part, as if nothing lay inside.
    fn mating(&self, pose: &Pose) -> HoldReport {
        let clearance = self.clearance();
        let centre = pose.apply(self.centre);
        let (mut all, mut by_patch) = (ContactGramian::default(), Matrix6::default());
        let mut normals: Vec<(DVec3, f64)> = Vec::new();
        let patches = self.patch_samples.len() as f64;
        self.visit_mating(&self.samples, pose, clearance, |s, p, n, _, _| {
            let row = self.row(centre, p, n);
            all.share += s.weight;
            all.matrix.add_outer(s.weight, &row);
            let weight = 1.0 / (patches * f64::from(self.patch_samples[s.patch]));
            by_patch.add_outer(weight, &row);
            normals.push((n, s.weight));
        });
        let escape = escape(&normals);
        let hold = match normals.is_empty() {
            true => 0.0,
            false => {
                all.saturated_information()
                    + PATCHES * by_patch.ln_det_plus_identity(INFORMATION_FLOOR)
            }
        };
        HoldReport {
            information: all.information(),
            share: all.share,
            escape,
            interpenetration: 0.0,
            hold: hold - ESCAPE * escape,
        }
    }

    /// Area of both surfaces that lies deep in the other part, over the moving part's area; where it
    /// is above `most`, something above that.
    fn interpenetration(&self, pose: &Pose, most: f64) -> f64 {
        let depth = DEEP * self.resolution;
        let mut moving = 0.0;
        for s in &self.samples {
            if self.fixed.is_deeper(pose.apply(s.position), depth) {
                moving += s.weight;
                if moving > most {
                    return moving;
                }
            }
        }
        let back = pose.inverse();
        let corners = self.corners.map(|c| pose.apply(c));
        let mut fixed = 0.0;
        for (p, weight) in self.fixed_samples.in_box(&corners) {
            if self.moving.is_deeper(back.apply(*p), depth) {
                fixed += weight;
                if moving + self.fixed_weight * fixed > most {
                    break;
                }
            }
        }
        moving + self.fixed_weight * fixed
    }

    /// Root mean square distance between the corners of the moving part's box at two poses, metres.
    pub(super) fn distance(&self, a: &Pose, b: &Pose) -> f64 {
        let square = |c: &DVec3| a.apply(*c).distance_squared(b.apply(*c));
        (self.corners.iter().map(square).sum::<f64>() / 8.0).sqrt()
    }

    /// Samples of the moving part: many, and few.
    pub(super) fn samples(&self) -> [&[SurfacePoint]; 2] {
        [&self.samples, &self.few]
    }
}

/// Nats that one part's whole surface inside the other costs a pose.
pub(super) const INSIDE: f64 = 100.0;

/// Nats that it costs to be free to leave in all directions.
const ESCAPE: f64 = 80.0;

/// Weight of the information where all patches count alike, beside that where area counts.
const PATCHES: f64 = 0.5;

/// Share of the directions in which contact on these normals (with weights) blocks nothing.
fn escape(normals: &[(DVec3, f64)]) -> f64 {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let free = |k: usize| {
        let z = 1.0 - 2.0 * (k as f64 + 0.5) / DIRECTIONS as f64;
        let (radius, angle) = ((1.0 - z * z).sqrt(), golden * k as f64);
        let d = DVec3::new(radius * angle.cos(), radius * angle.sin(), z);
        let push = |(n, w): &(DVec3, f64)| w * n.dot(d).max(0.0).powi(2);
        BLOCKED / (BLOCKED + normals.iter().map(push).sum::<f64>())
    };
    (0..DIRECTIONS).map(free).sum::<f64>() / DIRECTIONS as f64
}

/// Samples in cells, to be looked up by box.
#[derive(Debug)]
struct SampleCells {
    cell: f64,
    cells: HashMap<[i32; 3], Vec<(DVec3, f64)>>,
}

impl SampleCells {
    fn new(samples: &[SurfacePoint], cell: f64) -> Self {
        let mut cells: HashMap<_, Vec<_>> = HashMap::new();
        for s in samples {
            let list = cells.entry(key(s.position / cell)).or_default();
            list.push((s.position, s.weight));
        }
        Self { cell, cells }
    }

    /// The samples of all cells that the box around some points touches.
    fn in_box(&self, around: &[DVec3]) -> impl Iterator<Item = &(DVec3, f64)> {
        let low = around.iter().fold(DVec3::INFINITY, |a, p| a.min(*p));
        let high = around.iter().fold(DVec3::NEG_INFINITY, |a, p| a.max(*p));
        let (low, high) = (key(low / self.cell), key(high / self.cell));
        let rows = (low[0]..=high[0]).flat_map(move |x| (low[1]..=high[1]).map(move |y| [x, y]));
        let keys = rows.flat_map(move |[x, y]| (low[2]..=high[2]).map(move |z| [x, y, z]));
        keys.flat_map(|key| self.cells.get(&key).into_iter().flatten())
    }
}

fn key(cell: DVec3) -> [i32; 3] {
    cell.floor().to_array().map(|x| x as i32)
}
