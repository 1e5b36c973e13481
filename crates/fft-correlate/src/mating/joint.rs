//! The joint that contact leaves: which motions are free, about which axis, how far.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use sdf_grid::{Matrix6, Vector6};
use serde::{Deserialize, Serialize};

use super::contact::MatingContact;
use crate::geometry::se3::Pose;

/// A motion is free if contact resists it by less than this share of what it resists most: facets of
/// threads do by up to 2e-3, and the least that a part is held by is some 1e-2.
const FREE: f64 = 5e-3;

/// But a motion that is resisted in one sense only, as by a slender taper, is held by more than this.
const ONE_SIDED: f64 = 1e-5;
const OTHER_SENSE: f64 = 0.05;

/// A displacement at a stop has at least this share of an eigenvector.
const MOSTLY: f64 = 0.8;

/// A part is guided if, this share of its length away from its stop, this share of what mates there
/// still does.
const GUIDED_LENGTH: f64 = 0.5;
const GUIDED_SHARE: f64 = 0.8;

/// A part turns about an axis without advancing if that is resisted by less than this share.
const TURNS: f64 = 1e-4;

/// Turns this small against displacements, or the other way round, are none.
const NONE: f64 = 0.05;

/// The pitch of a thread is that of so many turns by 15 degrees.
const THREAD_STEP: f64 = PI / 12.0;
const THREAD_STEPS: usize = 8;

/// A joint turns about an axis of the fixed part that leans by at most 3 degrees from the one found,
/// so many clearances beside it.
const SAME_AXIS_COSINE: f64 = 0.9986;
const SAME_AXIS: f64 = 1.0;

/// Travel is followed in steps of this many clearances.
const STRIDE: f64 = 1.0;

/// Steps of a travel, at most.
const STEPS: usize = 400;

/// Contact is lost where less than this share of it is left.
const LOST: f64 = 0.1;

/// Surface that may lie in the other part along the travel beyond what does at the pose, shares of
/// the moving part's.
const BLOCKED: f64 = 0.004;

/// Which motions contact leaves free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum JointKind {
    /// None.
    #[default]
    Fixed,
    /// A displacement along the axis.
    Prismatic,
    /// A turn about the axis.
    Revolute,
    /// Both.
    Cylindrical,
    /// A turn about the axis with a displacement along it.
    Screw,
    /// Displacements across the axis, and a turn about it.
    Planar,
    /// All turns about a point.
    Ball,
    /// This many motions, which are those of no other kind: contact does not determine the pose.
    Undetermined(usize),
}

impl JointKind {
    /// All kinds that determine the pose up to their motions.
    pub const DETERMINED: [Self; 7] = [
        Self::Fixed,
        Self::Prismatic,
        Self::Revolute,
        Self::Cylindrical,
        Self::Screw,
        Self::Planar,
        Self::Ball,
    ];

    /// Whether the part may turn about one axis.
    pub fn turns(self) -> bool {
        matches!(self, Self::Revolute | Self::Cylindrical | Self::Screw)
    }

    /// The kind of this name, if it determines the pose up to its motions.
    pub fn determined(name: &str) -> Option<Self> {
        (Self::DETERMINED.into_iter()).find(|kind| kind.name() == name)
    }

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Prismatic => "prismatic",
            Self::Revolute => "revolute",
            Self::Cylindrical => "cylindrical",
            Self::Screw => "screw",
            Self::Planar => "planar",
            Self::Ball => "ball",
            Self::Undetermined(_) => "undetermined",
        }
    }

    /// Free motions.
    pub fn freedoms(self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Prismatic | Self::Revolute | Self::Screw => 1,
            Self::Cylindrical => 2,
            Self::Planar | Self::Ball => 3,
            Self::Undetermined(count) => count,
        }
    }
}

/// How far a free motion goes from the pose, both ways.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Travel {
    /// Least and greatest value: metres, or radians of a turn.
    pub range: [f64; 2],
    /// Whether the parts block the motion there; else contact is lost, or the motion has no end.
    pub blocked: [bool; 2],
}

/// The joint of two parts at a pose.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Joint {
    /// Which motions are free.
    pub kind: JointKind,
    /// Direction of the axis, fixed frame, unit length; zero of joints without one.
    pub axis: DVec3,
    /// A point of the axis, or the centre of a ball, fixed frame, metres.
    pub point: DVec3,
    /// Displacement per turn of a screw, metres, positive if right-handed; else 0.
    pub pitch: f64,
    /// Travel along the axis, metres, of prismatic and cylindrical joints.
    pub slide: Option<Travel>,
    /// Travel about the axis, radians, of joints that turn.
    pub turn: Option<Travel>,
    /// The free motions: displacements of the moving part's centre along the fixed axes (metres) and
    /// turns about it (radians), unit length where turns count by the part's radius.
    pub free: Vec<Vector6>,
}

impl Joint {
    /// The axis and a point of it in the frame of the moving part, which lies at `pose`.
    pub fn in_moving_frame(&self, pose: &Pose) -> (DVec3, DVec3) {
        let axis = pose.rotation.conjugate() * self.axis;
        (axis, pose.inverse().apply(self.point))
    }
}

/// A motion: displacement of the centre and turn.
#[derive(Clone, Copy)]
struct Motion {
    shift: DVec3,
    turn: DVec3,
}

impl MatingContact {
    /// The joint that contact leaves at a pose.
    pub fn joint(&self, pose: &Pose) -> Joint {
        let (mut joint, one_sided) = self.on_axis(pose);
        if joint.kind == JointKind::Fixed {
            let guide = one_sided.iter().find_map(|d| self.guide(pose, *d));
            if let Some(axis) = guide {
                joint.kind = JointKind::Prismatic;
                joint.axis = axis;
                joint.free = vec![[axis.x, axis.y, axis.z, 0.0, 0.0, 0.0]];
            }
        }
        let centre = pose.apply(self.centre);
        let about_axis = |turn: DVec3, along: f64| Motion {
            shift: turn.cross(centre - joint.point) + along * joint.axis,
            turn,
        };
        let slides = matches!(joint.kind, JointKind::Prismatic | JointKind::Cylindrical);
        let slide = slides.then(|| {
            let motion = Motion {
                shift: joint.axis,
                turn: DVec3::ZERO,
            };
            self.travel(pose, motion, STRIDE * self.clearance(), f64::INFINITY)
        });
        let turns = match joint.kind {
            JointKind::Revolute | JointKind::Cylindrical | JointKind::Planar => Some(0.0),
            JointKind::Screw => Some(joint.pitch / TAU),
            _ => None,
        };
        let turn = turns.map(|along| {
            let motion = about_axis(joint.axis, along);
            let (step, most) = match joint.kind {
                JointKind::Screw => (0.2, f64::INFINITY),
                _ => (0.05, PI),
            };
            self.travel(pose, motion, step, most)
        });
        (joint.slide, joint.turn) = (slide, turn);
        joint
    }

    /// The joint that contact leaves at a pose, without how far it lets the part go; a part at a stop
    /// of its guide counts as fixed.
    pub(super) fn joint_without_travel(&self, pose: &Pose) -> Joint {
        self.on_axis(pose).0
    }

    /// Kind, exact axis and pitch; and directions of displacements that contact resists in the
    /// opposite sense only.
    fn on_axis(&self, pose: &Pose) -> (Joint, Vec<DVec3>) {
        let (mut joint, one_sided) = self.classify(pose);
        self.snap(&mut joint);
        if joint.kind == JointKind::Screw {
            let pitches = [1.0, -1.0].map(|sense| self.pitch(pose, &joint, sense));
            let best = pitches
                .into_iter()
                .flatten()
                .max_by(|a, b| a.1.total_cmp(&b.1));
            joint.pitch = best.map_or(joint.pitch, |b| b.0);
        }
        (joint, one_sided)
    }

    /// Gives a joint that turns the exact axis of the fixed part that it turns about: a part that leans
    /// in its play does not lean the axis.
    fn snap(&self, joint: &mut Joint) {
        if !joint.kind.turns() {
            return;
        }
        let same = self.axes.iter().find(|axis| {
            let apart = axis.point - joint.point;
            let off = apart - joint.axis * apart.dot(joint.axis);
            axis.direction.dot(joint.axis).abs() > SAME_AXIS_COSINE
                && off.length() < SAME_AXIS * self.clearance()
        });
        if let Some(axis) = same {
            let along = (joint.point - axis.point).dot(axis.direction);
            joint.point = axis.point + along * axis.direction;
            joint.axis = axis.direction * axis.direction.dot(joint.axis).signum();
        }
    }

    /// The pitch of a thread, metres, from a turn in one sense: a nut against a shoulder, which it leaves
    /// then, is held by more than its thread. And the least share that mates on the way.
    fn pitch(&self, pose: &Pose, joint: &Joint, sense: f64) -> Option<(f64, f64)> {
        let step = sense * THREAD_STEP;
        let motion = Motion {
            shift: joint.axis.cross(pose.apply(self.centre) - joint.point)
                + joint.pitch / TAU * joint.axis,
            turn: joint.axis,
        };
        let (mut there, mut first, mut least) = (*pose, None, f64::INFINITY);
        for k in 0..=THREAD_STEPS {
            there = self.middle(&self.follow(&there, motion, step));
            least = least.min(self.hold(&there).share);
            let first = *first.get_or_insert(there);
            let turn = there.rotation * first.rotation.conjugate();
            let angle = 2.0 * turn.xyz().dot(joint.axis).atan2(turn.w);
            let angle = (angle + PI).rem_euclid(TAU) - PI;
            let advance = (there.apply(self.centre) - first.apply(self.centre)).dot(joint.axis);
            if k == THREAD_STEPS {
                let expected = step * THREAD_STEPS as f64;
                let turned = (angle - expected).abs() < 0.3 * expected.abs();
                return turned.then(|| (TAU * advance / angle, least));
            }
        }
        None
    }

    /// The direction in which a part at a stop leaves it, if it is guided on its way: if after half its
    /// own length nearly as much of it mates as before. A pin that leaves its hole is not.
    fn guide(&self, pose: &Pose, direction: DVec3) -> Option<DVec3> {
        let along = self.corners.map(|c| (pose.rotation * c).dot(direction));
        let [low, high] = along
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| {
                [l.min(*x), h.max(*x)]
            });
        let (half, step) = (GUIDED_LENGTH * (high - low), self.clearance());
        let start = self.hold(pose).share;
        // Away from the stop the part lies in the middle of its play.
        let mut first = None;
        let (mut there, mut direction, mut gone) = (*pose, direction, 0.0);
        while gone < half {
            let next = self.moved(&there, DVec3::ZERO, step * direction);
            let next = self.approach_nearly_right(&next);
            let moved = next.apply(self.centre) - there.apply(self.centre);
            let turned = there.angle_to(&next) * self.radius;
            let progress = moved.dot(direction);
            if progress < 0.3 * step || turned > 0.3 * step {
                return None;
            }
            (direction, there) = (moved.normalize(), next);
            let first = first.get_or_insert(there.apply(self.centre));
            if gone > 0.0 {
                direction = (there.apply(self.centre) - *first).normalize();
            }
            gone += progress;
            if self.hold(&there).share < GUIDED_SHARE * start {
                return None;
            }
        }
        Some(direction)
    }

    /// The motions that contact leaves free at a pose; none if nothing mates.
    ///
    /// They are those of the Gramian about the middle of what mates, with its own radius as the unit of
    /// turns: a small joint of a large part is held as well as one of a small part.
    ///
    /// Second, directions of displacements that it resists in the opposite sense only.
    fn free_motions(&self, pose: &Pose) -> Option<(Vec<Motion>, Vec<DVec3>)> {
        let [samples, _] = self.samples();
        let mut mating: Vec<(DVec3, DVec3, f64)> = Vec::new();
        self.visit_mating(samples, pose, self.clearance(), |s, p, n, _, _| {
            mating.push((p, n, s.weight));
        });
        let sum = |of: &dyn Fn(DVec3) -> f64| mating.iter().map(|m| m.2 * of(m.0)).sum::<f64>();
        let weight = sum(&|_| 1.0);
        let middle = mating.iter().map(|m| m.2 * m.0).sum::<DVec3>() / weight;
        let radius = (sum(&|p| p.distance_squared(middle)) / weight).sqrt();
        if !radius.is_normal() {
            return None;
        }
        let rows = mating.iter().map(|(p, n, weight)| {
            let t = (*p - middle).cross(*n) / radius;
            ([n.x, n.y, n.z, t.x, t.y, t.z], *weight)
        });
        let mut gramian = Matrix6::default();
        for (row, weight) in rows.clone() {
            gramian.add_outer(weight, &row);
        }
        if let Some(axis) = &self.known_axis {
            // As strongly as contact holds what it holds best.
            let strongest = gramian.eigen().0[5];
            axis.stiffen(&mut gramian, middle, radius, strongest);
        }
        let (values, vectors) = gramian.eigen();
        let one_sided = |motion: &Vector6| {
            let mut senses = [0.0; 2];
            for (row, weight) in rows.clone() {
                let along: f64 = row.iter().zip(motion).map(|(r, m)| r * m).sum();
                senses[usize::from(along < 0.0)] += weight * along * along;
            }
            let least = OTHER_SENSE * (senses[0] + senses[1]);
            // Samples resist what goes along their normals.
            match senses {
                [ahead, _] if ahead < least => Some(1.0),
                [_, back] if back < least => Some(-1.0),
                _ => None,
            }
        };
        let displacements = vectors.iter().filter_map(|v| {
            let shift = DVec3::new(v[0], v[1], v[2]);
            let sense = (shift.length() > MOSTLY).then(|| one_sided(v)).flatten()?;
            Some(sense * shift.normalize())
        });
        let displacements: Vec<DVec3> = displacements.collect();
        let free = values.iter().zip(&vectors).filter(|(value, motion)| {
            let share = *value / values[5];
            share < FREE && (share < ONE_SIDED || one_sided(motion).is_none())
        });
        let mut free: Vec<Vector6> = free.map(|(_, motion)| *motion).collect();
        // A screw that turns as freely without advancing is none.
        if let [motion] = free.as_mut_slice() {
            let axis = DVec3::new(motion[3], motion[4], motion[5]).normalize_or_zero();
            let shift = DVec3::new(motion[0], motion[1], motion[2]);
            let turn = shift.reject_from_normalized(axis).to_array();
            let turn = [turn[0], turn[1], turn[2], motion[3], motion[4], motion[5]];
            let along = |row: &Vector6| row.iter().zip(&turn).map(|(r, m)| r * m).sum::<f64>();
            let resisted: f64 = rows.clone().map(|(row, w)| w * along(&row).powi(2)).sum();
            if axis != DVec3::ZERO && resisted < TURNS * values[5] {
                *motion = turn;
            }
        }
        // At the part's centre instead of the middle, unit length where turns count by its radius.
        let centre = pose.apply(self.centre);
        let at_centre = |v: &Vector6| {
            let turn = DVec3::new(v[3], v[4], v[5]) / radius;
            let shift = DVec3::new(v[0], v[1], v[2]) + turn.cross(centre - middle);
            let size = (shift.length_squared() + (turn * self.radius).length_squared()).sqrt();
            Motion {
                shift: shift / size,
                turn: turn / size,
            }
        };
        Some((free.iter().map(at_centre).collect(), displacements))
    }

    /// Kind and axis; and directions of displacements that contact resists in the opposite sense only.
    fn classify(&self, pose: &Pose) -> (Joint, Vec<DVec3>) {
        match self.free_motions(pose) {
            Some((free, one_sided)) => (self.kind(pose, &free), one_sided),
            None => {
                let nothing = Joint {
                    kind: JointKind::Undetermined(6),
                    point: pose.apply(self.centre),
                    ..Joint::default()
                };
                (nothing, Vec::new())
            }
        }
    }

    /// Kind and axis of a joint with these free motions.
    fn kind(&self, pose: &Pose, motions: &[Motion]) -> Joint {
        let centre = pose.apply(self.centre);
        let joint = |kind, axis: DVec3, point, pitch| Joint {
            kind,
            axis,
            point,
            pitch,
            slide: None,
            turn: None,
            free: motions
                .iter()
                .map(|m| {
                    let ([a, b, c], [d, e, f]) = (m.shift.to_array(), m.turn.to_array());
                    [a, b, c, d, e, f]
                })
                .collect(),
        };
        let none = joint(
            JointKind::Undetermined(motions.len()),
            DVec3::ZERO,
            centre,
            0.0,
        );
        let (turns, slides) = self.split(motions);
        match (turns.as_slice(), slides.as_slice()) {
            ([], []) => joint(JointKind::Fixed, DVec3::ZERO, centre, 0.0),
            ([], [slide]) => joint(JointKind::Prismatic, *slide, centre, 0.0),
            ([turn], []) => {
                let (axis, point, pitch) = screw(turn, centre);
                let kind = match pitch.abs() > NONE * self.radius {
                    true => JointKind::Screw,
                    false => JointKind::Revolute,
                };
                let pitch = if kind == JointKind::Screw { pitch } else { 0.0 };
                joint(kind, axis, point, pitch)
            }
            ([turn], [slide]) => {
                let (axis, point, _) = screw(turn, centre);
                match axis.cross(*slide).length() < 2.0 * NONE {
                    true => joint(JointKind::Cylindrical, axis, point, 0.0),
                    false => none,
                }
            }
            ([turn], [a, b]) => {
                let normal = a.cross(*b).normalize_or_zero();
                let axis = turn.turn.normalize_or_zero();
                match axis.cross(normal).length() < 2.0 * NONE {
                    true => joint(JointKind::Planar, normal, centre, 0.0),
                    false => none,
                }
            }
            (turns @ [_, _, _], []) => match ball_centre(turns, centre, self.radius) {
                Some(point) => joint(JointKind::Ball, DVec3::ZERO, point, 0.0),
                None => none,
            },
            _ => none,
        }
    }

    /// Motions combined so that as many as possible are mere displacements (unit length); the others.
    fn split(&self, motions: &[Motion]) -> (Vec<Motion>, Vec<DVec3>) {
        // Gram-Schmidt on the turns, the largest first: what has no turn left is a displacement.
        let mut left: Vec<Motion> = motions.to_vec();
        let mut turns: Vec<Motion> = Vec::new();
        loop {
            let size = |m: &Motion| m.turn.length() * self.radius;
            let largest =
                (0..left.len()).max_by(|a, b| size(&left[*a]).total_cmp(&size(&left[*b])));
            let Some(largest) = largest.filter(|i| size(&left[*i]) > NONE) else {
                break;
            };
            let m = left.swap_remove(largest);
            for other in &mut left {
                let part = other.turn.dot(m.turn) / m.turn.length_squared();
                other.turn -= part * m.turn;
                other.shift -= part * m.shift;
            }
            turns.push(m);
        }
        let mut slides: Vec<DVec3> = Vec::new();
        for m in left {
            let rest = slides.iter().fold(m.shift, |s, d| s - s.dot(*d) * d);
            slides.extend(rest.try_normalize());
        }
        (turns, slides)
    }

    /// How far a motion goes in steps (times the motion) before parts block it or contact is lost.
    fn travel(&self, pose: &Pose, motion: Motion, step: f64, most: f64) -> Travel {
        let at_pose = self.hold(pose);
        let follow = |sense: f64| {
            let mut reached: f64 = 0.0;
            for k in 1..=STEPS {
                let length = (step * k as f64).min(most);
                let there = self.follow(pose, motion, sense * length);
                let hold = self.hold(&there);
                if hold.interpenetration > at_pose.interpenetration + BLOCKED {
                    return (sense * reached, true);
                }
                if hold.share < LOST * at_pose.share {
                    return (sense * reached, false);
                }
                reached = length;
                if length >= most {
                    break;
                }
            }
            (sense * reached, false)
        };
        let [back, ahead] = [-1.0, 1.0].map(follow);
        Travel {
            range: [back.0, ahead.0],
            blocked: [back.1, ahead.1],
        }
    }

    /// The pose after a constant motion for some length.
    fn follow(&self, pose: &Pose, motion: Motion, length: f64) -> Pose {
        let angle = motion.turn.length();
        if angle == 0.0 {
            return self.moved(pose, DVec3::ZERO, length * motion.shift);
        }
        let centre = pose.apply(self.centre);
        let (axis, point, pitch) = screw(&motion, centre);
        let turn = glam::DQuat::from_axis_angle(axis, angle * length);
        let along = pitch / TAU * angle * length * axis;
        let rotation = (turn * pose.rotation).normalize();
        let centre = point + turn * (centre - point) + along;
        Pose::new(rotation, centre - rotation * self.centre)
    }
}

/// Axis (unit length), the point of it nearest to the centre, and displacement per turn of a motion
/// with a turn.
fn screw(motion: &Motion, centre: DVec3) -> (DVec3, DVec3, f64) {
    let axis = motion.turn.normalize();
    let point = centre + motion.turn.cross(motion.shift) / motion.turn.length_squared();
    let pitch = TAU * motion.shift.dot(axis) / motion.turn.length();
    (axis, point, pitch)
}

/// The point about which three motions turn, if there is one.
fn ball_centre(motions: &[Motion], centre: DVec3, radius: f64) -> Option<DVec3> {
    // Every motion leaves the point p where it is: shift + turn x (p - centre) = 0.
    let (mut matrix, mut right) = (glam::DMat3::ZERO, DVec3::ZERO);
    for m in motions {
        let w = m.turn;
        let cross = glam::DMat3::from_cols(w.cross(DVec3::X), w.cross(DVec3::Y), w.cross(DVec3::Z));
        matrix += cross.transpose() * cross;
        right -= cross.transpose() * m.shift;
    }
    let offset = matrix.try_inverse()? * right;
    let off = |m: &Motion| (m.shift + m.turn.cross(offset)).length() / (m.turn.length() * radius);
    (motions.iter().all(|m| off(m) < 2.0 * NONE)).then_some(centre + offset)
}
