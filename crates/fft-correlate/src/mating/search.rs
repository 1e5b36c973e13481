//! The search for poses that contact holds: screens hypotheses, seats the best of them, ranks them by
//! hold and overlap, and gathers places that are alike.

use std::f64::consts::TAU;
use std::sync::OnceLock;

use glam::{DQuat, DVec3};
use rayon::prelude::*;
use sdf_grid::{
    Aabb, Enclosure, Interference, InterferenceQuery, Monitor, SurfaceFeatures, SymmetryOrder,
    TriangleMesh, symmetry,
};

use super::axis::{KnownAxis, LEANS};
use super::contact::{HoldReport, INFORMATION_FLOOR, INSIDE, MatingContact};
use super::hypotheses::{Family, Hypotheses};
use super::joint::Joint;
use crate::geometry::pose_spacing::PoseSpacing;
use crate::geometry::se3::Pose;
use crate::rotations::search_rotations::search_rotations;

/// Poses of one family that go on, at most, and of all.
const OF_A_FAMILY: usize = 40;
const OF_ALL: usize = 800;

/// Poses of a family that few samples choose for each that goes on.
const CHOSEN: usize = 4;

/// Families of alike holes that are screened in all poses; others only where these were good.
const SCREENED_ALIKE: usize = 4;

/// Places of which each is tried in all alike holes, and the sine of the angle by which they may lean.
const REPEATED: usize = 4;
const PLAY: f64 = 0.03;

/// Angle between the rotations of balls in cups, radians: 30 degrees.
const BALL_STEP: f64 = std::f64::consts::FRAC_PI_6;

/// Seated poses that slide home, and those whose overlap is measured, at most; fewer if few are
/// asked for.
const SLIDING: usize = 60;
const MEASURED: usize = 40;

/// Nats by which a slide home may make a seated pose better where poor ones are not asked for.
const SLIDES: f64 = 20.0;

/// Nats that overlap costs: this for every factor e of `1 + overlap / slight`, and as much as surface
/// inside the other part for its share of the volume.
const OVERLAP: f64 = 8.0;
const SLIGHT_OVERLAP: f64 = 3e-3;

/// Nats that a depth of one radius of the other part costs, beyond that of facets.
const DEPTH: f64 = 60.0;
const FACET_DEPTH: f64 = 0.02;

/// Nats that it is worth to close a space as large as the moving part's radius cubed.
const CLOSES: f64 = 10.0;

/// Places are alike if the part is held alike in them: ranks within this many nats, each eigenvalue
/// of the Gramian within this factor's logarithm.
const ALIKE_NATS: f64 = 1.0;
const ALIKE_RATIO: f64 = 0.4;

/// A part whose axis is this near to a known one lies on it, shares of the resolution.
const ON_AXIS: f64 = 0.1;

/// A part is round whose turns differ by this share of the resolution at most.
const ROUND: f64 = 0.15;

/// Facets differ from a circle by more than this, diagonals; turns that are tried of one facet.
const EXACT: f64 = 1e-6;
const FACET_TURNS: usize = 6;

/// What is known beforehand about where the moving part belongs.
#[derive(Debug, Clone, Default)]
pub struct MatingSearchOptions {
    /// Places returned, at most.
    pub top: usize,
    /// Places that rank lower are not returned, nats; all are by default.
    pub least: Option<f64>,
    /// Clearance within which faces mate, metres; by default from the parts.
    pub clearance: Option<f64>,
    /// Poses that may be returned.
    pub region: SearchRegion,
    /// An axis of the fixed frame (point, metres, and direction): the moving part turns about it and
    /// slides along it, and moves in no other way.
    pub axis: Option<(DVec3, DVec3)>,
    /// Motions that map the moving part onto itself: poses that differ by one count as the same.
    pub symmetries: Vec<Pose>,
    /// A pose of the moving part: of places that are alike the nearest to it comes first.
    pub present: Option<Pose>,
    /// Joints without travel, and of poses that differ by a free turn the one that was found: much
    /// faster, for a search that asks many times.
    pub without_travel: bool,
}

/// Which poses a search may return, fixed frame; all where nothing is given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SearchRegion {
    /// Near a pose: the moving part's middle at most so far away (metres), turned by at most an angle
    /// (radians).
    pub near: Option<(Pose, f64, f64)>,
    /// A point of the moving part (metres, its frame) lies in a box.
    pub places: Option<(DVec3, Aabb)>,
    /// Turned by at most an angle (radians) from one of these rotations.
    pub rotations: Option<(Vec<DQuat>, f64)>,
}

impl SearchRegion {
    /// Whether of poses that turn the moving part onto itself some may be out of the region.
    fn turns_are_limited(&self) -> bool {
        self.near.is_some() || self.rotations.is_some()
    }

    /// Whether a pose lies in the region; `middle` is the moving part's, metres, its frame.
    fn contains(&self, pose: &Pose, middle: DVec3) -> bool {
        let near = |(at, distance, angle): &(Pose, f64, f64)| {
            at.apply(middle).distance(pose.apply(middle)) <= *distance
                && at.angle_to(pose) <= *angle
        };
        let turned = |(rotations, angle): &(Vec<DQuat>, f64)| {
            let cosine = (0.5 * angle).cos();
            rotations
                .iter()
                .any(|q| q.dot(pose.rotation).abs() >= cosine)
        };
        self.near.as_ref().is_none_or(near)
            && self
                .places
                .as_ref()
                .is_none_or(|(point, box_)| box_.contains(pose.apply(*point)))
            && self.rotations.as_ref().is_none_or(turned)
    }
}

/// A pose in which contact holds the moving part.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldPose {
    /// Pose of the moving part, fixed frame.
    pub pose: Pose,
    /// How contact holds it.
    pub hold: HoldReport,
    /// How far the solids lie in one another.
    pub interference: Interference,
    /// Share of the moving part's volume that the fixed part fills as well.
    pub overlap: f64,
    /// Volume that both parts enclose together and neither alone, cubic metres: the inside of a box
    /// that a lid closes.
    pub enclosed: f64,
    /// What ranks it, nats: the hold, less what overlap costs, more for what it encloses.
    pub rank: f64,
    /// The joint that contact leaves.
    pub joint: Joint,
    /// Other places in which the same contact holds it.
    pub alike: Vec<Pose>,
}

/// A search for poses of a moving part that contact with a fixed part holds.
pub struct MatingSearch<'a> {
    fixed: &'a TriangleMesh,
    moving: &'a TriangleMesh,
    features: [SurfaceFeatures; 2],
    pub(super) contact: MatingContact,
    enclosure: Enclosure<'a>,
    pub(super) options: MatingSearchOptions,
    same: PoseSpacing,
    /// Direction of the moving part's axis of revolution, its frame, if it has one.
    round: Option<DVec3>,
    /// Turns of a round part that bring its facets to others' places, radians.
    facet_turns: Vec<f64>,
    /// The best hypotheses, found once.
    screened: OnceLock<Vec<Candidate>>,
}

#[derive(Debug, Clone)]
struct Candidate {
    pose: Pose,
    value: f64,
}

impl<'a> MatingSearch<'a> {
    /// Prepares the search for two parts.
    pub fn new(
        fixed: &'a TriangleMesh,
        moving: &'a TriangleMesh,
        options: MatingSearchOptions,
    ) -> Self {
        let features = [[fixed, moving], [moving, fixed]]
            .map(|[part, other]| SurfaceFeatures::beside(part, other));
        let [f, m] = &features;
        let mut contact = MatingContact::new([fixed, moving], [f, m], options.clearance);
        contact.known_axis = options.axis.map(KnownAxis::new);
        let axes = symmetry::detect(moving, ROUND * contact.resolution);
        let round = axes.iter().find(|a| a.order == SymmetryOrder::Continuous);
        let round = round.map(|a| a.direction);
        let same = PoseSpacing {
            angle: contact.resolution / contact.radius,
            distance: contact.resolution,
            pivot: contact.centre,
            symmetries: options.symmetries.clone(),
        };
        Self {
            fixed,
            moving,
            features,
            contact,
            enclosure: Enclosure::new(fixed, moving),
            facet_turns: round.map_or(Vec::new(), |axis| facet_turns(moving, axis)),
            round,
            options,
            same,
            screened: OnceLock::new(),
        }
    }

    /// The contact that the search evaluates.
    pub fn contact(&self) -> &MatingContact {
        &self.contact
    }

    /// The poses that contact holds best, the best first; none if the surfaces have neither planes
    /// nor axes in common, or the monitor cancels. `others` are seated and ranked with them.
    pub fn run(&self, others: &[Pose], monitor: &dyn Monitor) -> Vec<HeldPose> {
        let screened = self.screened.get_or_init(|| self.screen(monitor)).clone();
        let mut homes = self.seated(screened, others, monitor);
        homes.extend(self.repeated(&homes, monitor));
        let homes = self.distinct(homes, 0.5 * self.contact.resolution, usize::MAX);
        self.ranked(&homes, monitor)
    }

    /// What is best in one of several alike holes, in those where nothing has been found.
    fn repeated(&self, homes: &[Candidate], monitor: &dyn Monitor) -> Vec<Candidate> {
        let moving = &self.features[1].axes;
        let near = self.contact.resolution;
        let mut starts: Vec<Candidate> = Vec::new();
        for alike in self.hypotheses().alike_axes() {
            let hole = |c: &Candidate| {
                let on = |hole: &KnownAxis| hole.carries(&c.pose, moving, (PLAY, near));
                alike.iter().copied().find(on)
            };
            let in_holes = homes.iter().filter_map(|c| Some((c, hole(c)?)));
            for (home, hole) in in_holes.take(REPEATED) {
                for other in &alike {
                    let pose = shifted(&home.pose, other.point - hole.point);
                    let value = home.value;
                    let known = |c: &Candidate| self.contact.distance(&c.pose, &pose) <= near;
                    if !homes.iter().chain(&starts).any(known) {
                        starts.push(Candidate { pose, value });
                    }
                }
            }
        }
        match starts.is_empty() {
            true => Vec::new(),
            false => self.seated(starts, &[], monitor),
        }
    }

    /// The same from given poses only: where contact holds the moving part near them. Poses near which
    /// little mates are left out, as hypotheses are.
    pub fn settle(&self, poses: &[Pose], monitor: &dyn Monitor) -> Vec<HeldPose> {
        let screen = |pose: &Pose| {
            let value = self.contact.screen_coarsely(pose)?;
            Some(Candidate { pose: *pose, value })
        };
        let screened = poses.par_iter().filter_map(screen).collect();
        let homes = self.seated(screened, &[], monitor);
        self.ranked(&homes, monitor)
    }

    /// Distinct poses in which contact holds the part best near those given.
    fn seated(
        &self,
        mut found: Vec<Candidate>,
        others: &[Pose],
        monitor: &dyn Monitor,
    ) -> Vec<Candidate> {
        found.extend(others.iter().map(|pose| Candidate {
            pose: *pose,
            value: f64::INFINITY,
        }));
        found.retain(|c| self.allows(&c.pose));
        let distinct = self.distinct(found, self.contact.resolution, OF_ALL);
        monitor.begin("seating poses", distinct.len() as u64);
        let seat = |c: &Candidate| {
            if monitor.cancelled() {
                return None;
            }
            let (pose, value) = self.contact.seat(&c.pose);
            monitor.advance(1);
            Some(Candidate { pose, value })
        };
        let mut seated: Vec<Candidate> = distinct.par_iter().filter_map(seat).collect();
        let least = self.options.least.unwrap_or(f64::NEG_INFINITY);
        seated.retain(|c| c.value + SLIDES > least);
        let near = 0.5 * self.contact.resolution;
        let seated = self.distinct(seated, near, SLIDING);
        let straight = match self.options.axis {
            Some(_) => Vec::new(),
            None => self.equal(&self.hypotheses().rotations()),
        };
        let slide = |c: &Candidate| {
            let (pose, value) = match monitor.cancelled() {
                true => (c.pose, c.value),
                false => {
                    let start = self.contact.straightened((c.pose, c.value), &straight);
                    let start = self.contact.spun(start, self.round, &self.facet_turns);
                    self.contact.centred(self.contact.slide(start, monitor))
                }
            };
            Candidate { pose, value }
        };
        let mut homes: Vec<Candidate> = seated.par_iter().map(slide).collect();
        // As the parts lie, if that is a fit.
        let present = self.options.present.map(|present| {
            let (pose, value) = self.contact.centred(self.contact.seat(&present));
            Candidate { pose, value }
        });
        homes.extend(present.filter(|c| c.value > 0.0));
        // Nothing ranks higher than this.
        homes.retain(|c| c.value + CLOSES >= least && self.allows(&c.pose));
        self.distinct(homes, near, SLIDING)
    }

    /// Rotations, and those that the moving part's symmetry makes equal to them.
    fn equal(&self, rotations: &[DQuat]) -> Vec<DQuat> {
        let symmetries = &self.options.symmetries;
        let equal = |q: DQuat| symmetries.iter().map(move |s| q * s.rotation).chain([q]);
        rotations.iter().flat_map(|q| equal(*q)).collect()
    }

    fn hypotheses(&self) -> Hypotheses<'_> {
        let [fixed, moving] = &self.features;
        Hypotheses::new(
            [fixed, moving],
            self.contact.resolution,
            self.round,
            (
                &self.options.symmetries,
                self.options.region.turns_are_limited(),
            ),
        )
    }

    /// The best hypotheses of every family.
    fn screen(&self, monitor: &dyn Monitor) -> Vec<Candidate> {
        let (hypotheses, moving) = (self.hypotheses(), &self.features[1]);
        let rotations = match self.options.axis {
            // A known axis leaves no other rotations.
            Some(_) => Vec::new(),
            None => hypotheses.rotations(),
        };
        let round_families = match self.options.axis {
            Some((point, direction)) => hypotheses.about(point, direction),
            None => hypotheses.coaxial(),
        };
        let evenly = match moving.spheres.is_empty() {
            true => Vec::new(),
            // Balls turn freely: what else mates decides.
            false => search_rotations(BALL_STEP, &[]),
        };
        let spheres = hypotheses.concentric(&[rotations.as_slice(), &evenly].concat());
        let total = rotations.len() + round_families.len() + spheres.len();
        monitor.begin("screening fits", total as u64);
        let mut found: Vec<Candidate> = rotations
            .par_iter()
            .flat_map_iter(|q| self.best_of(&hypotheses.planar(*q).poses, monitor))
            .collect();
        found.extend(self.screen_alike(&round_families, monitor));
        found.extend(spheres.iter().flat_map(|f| self.best_of(&f.poses, monitor)));
        found
    }

    /// The best of families of which some differ by which of many alike holes they use.
    fn screen_alike(&self, families: &[Family], monitor: &dyn Monitor) -> Vec<Candidate> {
        let kinds = families
            .iter()
            .filter_map(|f| f.alike)
            .max()
            .map_or(0, |k| k + 1);
        let mut of_kind: Vec<Vec<&Family>> = vec![Vec::new(); kinds];
        let mut singles: Vec<&Family> = Vec::new();
        for family in families {
            match family.alike {
                Some(kind) => of_kind[kind].push(family),
                None => singles.push(family),
            }
        }
        let best = |family: &&Family| self.best_of(&family.poses, monitor);
        let mut found: Vec<Candidate> = singles.par_iter().flat_map_iter(best).collect();
        let kinds = of_kind.par_iter().flat_map_iter(|alike| {
            let (first, rest) = alike.split_at(alike.len().min(SCREENED_ALIKE));
            let mut found: Vec<Candidate> = Vec::new();
            // Poses relative to the hole.
            let mut good: Vec<Pose> = Vec::new();
            for family in first {
                let best = self.best_of(&family.poses, monitor);
                good.extend(best.iter().map(|c| shifted(&c.pose, -family.anchor)));
                found.extend(best);
            }
            for family in rest {
                let poses: Vec<Pose> = good.iter().map(|p| shifted(p, family.anchor)).collect();
                found.extend(self.best_of(&poses, monitor));
            }
            found
        });
        found.extend(kinds.collect::<Vec<_>>());
        found
    }

    /// The best distinct poses of a family.
    fn best_of(&self, poses: &[Pose], monitor: &dyn Monitor) -> Vec<Candidate> {
        if monitor.cancelled() {
            return Vec::new();
        }
        let mut found: Vec<Candidate> = Vec::new();
        // Between these many poses a search may stop.
        for some in poses.chunks(64) {
            if monitor.cancelled() {
                return Vec::new();
            }
            for pose in some.iter().filter(|p| self.allows(p)) {
                let value = self.contact.screen_coarsely(pose);
                found.extend(value.map(|value| Candidate { pose: *pose, value }));
            }
        }
        let chosen = self.distinct(found, 0.5 * self.contact.resolution, CHOSEN * OF_A_FAMILY);
        let screen = |c: &Candidate| {
            let value = self.contact.screen(&c.pose)?;
            Some(Candidate {
                pose: c.pose,
                value,
            })
        };
        let found = chosen.iter().filter_map(screen).collect();
        monitor.advance(1);
        self.distinct(found, self.contact.resolution, OF_A_FAMILY)
    }

    fn allows(&self, pose: &Pose) -> bool {
        let axes = &self.features[1].axes;
        let near = ON_AXIS * self.contact.resolution;
        let known = self.contact.known_axis;
        known.is_none_or(|axis| axis.carries(pose, axes, (LEANS, near)))
            && self.options.region.contains(pose, self.contact.centre)
    }

    /// The best poses farther apart than a distance (metres), the best first.
    fn distinct(&self, mut found: Vec<Candidate>, apart: f64, most: usize) -> Vec<Candidate> {
        found.sort_by(|a, b| b.value.total_cmp(&a.value));
        let mut kept: Vec<Candidate> = Vec::new();
        for c in found {
            if kept.len() == most {
                break;
            }
            let near = |k: &Candidate| self.contact.distance(&k.pose, &c.pose) <= apart;
            if !kept.iter().any(near) {
                kept.push(c);
            }
        }
        kept
    }

    /// Measures overlaps, ranks, gathers places that are alike, and finds the joints.
    fn ranked(&self, homes: &[Candidate], monitor: &dyn Monitor) -> Vec<HeldPose> {
        // One of the poses that the moving part's symmetry makes equal.
        let kept = self.same.distinct(
            homes.iter().map(|c| &c.pose),
            MEASURED.min(4 * self.options.top).max(16),
        );
        let query = InterferenceQuery::new(self.fixed, self.moving);
        let least = self.options.least.unwrap_or(f64::NEG_INFINITY);
        monitor.begin("measuring overlaps", kept.len() as u64);
        let measure = |i: &usize| {
            if monitor.cancelled() {
                return None;
            }
            let measured = self.measure_above(&query, &homes[*i].pose, least);
            monitor.advance(1);
            measured
        };
        let mut measured: Vec<_> = kept.par_iter().filter_map(measure).collect();
        measured.sort_by(|a, b| b.rank.total_cmp(&a.rank));
        // Places that are alike.
        let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
        for (i, m) in measured.iter().enumerate() {
            let alike = |(first, _): &(usize, Vec<usize>)| {
                let other = &measured[*first];
                (m.rank - other.rank).abs() < ALIKE_NATS && self.is_alike(&m.pose, &other.pose)
            };
            match groups.iter_mut().find(|g| alike(g)) {
                Some((_, members)) => members.push(i),
                None => groups.push((i, vec![i])),
            }
        }
        groups.truncate(self.options.top);
        let hypotheses = self.hypotheses();
        let report = |(_, members): &(usize, Vec<usize>)| {
            let mut members: Vec<HeldPose> = (members.iter())
                .map(|i| HeldPose {
                    pose: self.as_present(&measured[*i].pose),
                    ..measured[*i].clone()
                })
                .collect();
            if let Some(present) = self.options.present {
                let away = |m: &HeldPose| self.contact.distance(&m.pose, &present);
                members.sort_by(|a, b| away(a).total_cmp(&away(b)));
            }
            let mut found = members.remove(0);
            let pose = found.pose;
            found.alike = members.iter().map(|m| m.pose).collect();
            if monitor.cancelled() {
                return found;
            }
            if self.options.without_travel {
                let joint = self.contact.joint_without_travel(&found.pose);
                return HeldPose { joint, ..found };
            }
            let shown = |found: HeldPose| {
                let joint = self.contact.joint(&found.pose);
                self.representative(&query, &hypotheses, HeldPose { joint, ..found })
            };
            let mut best = shown(found);
            if best.pose != pose {
                // The same turn elsewhere.
                let turned = |found: &HeldPose| shown(found.clone()).pose;
                best.alike = members.par_iter().map(turned).collect();
            }
            best
        };
        groups.par_iter().map(report).collect()
    }

    /// Of the poses that the moving part's symmetry makes equal, the nearest to the present one.
    fn as_present(&self, pose: &Pose) -> Pose {
        let Some(present) = self.options.present else {
            return *pose;
        };
        let equal = self.options.symmetries.iter().map(|s| *pose * *s);
        let away = |p: &Pose| self.contact.distance(p, &present);
        (equal.chain([*pose]))
            .min_by(|a, b| away(a).total_cmp(&away(b)))
            .unwrap_or(*pose)
    }

    /// Hold, overlap and joint at given poses, in their order.
    pub fn describe(&self, poses: &[Pose]) -> Vec<HeldPose> {
        let query = InterferenceQuery::new(self.fixed, self.moving);
        let describe = |pose: &Pose| HeldPose {
            joint: self.contact.joint(pose),
            ..self.measure_with(&query, pose)
        };
        poses.par_iter().map(describe).collect()
    }

    /// Hold, overlap and joint at a pose, or at one that differs by a free turn of the joint, is about as
    /// good and has planes of both parts parallel.
    pub fn straight(&self, pose: &Pose) -> HeldPose {
        let query = InterferenceQuery::new(self.fixed, self.moving);
        let found = HeldPose {
            joint: self.contact.joint(pose),
            ..self.measure_with(&query, pose)
        };
        self.representative(&query, &self.hypotheses(), found)
    }

    /// Hold and overlap at a pose, without the joint.
    pub fn measure(&self, pose: &Pose) -> HeldPose {
        let query = InterferenceQuery::new(self.fixed, self.moving);
        self.measure_with(&query, pose)
    }

    /// All but the joint, which is left undetermined.
    fn measure_with(&self, query: &InterferenceQuery<'_>, pose: &Pose) -> HeldPose {
        self.with_overlap(query, self.without_overlap(pose))
    }

    /// The same where the rank is at least `least`, nats: overlap, which takes long, is not measured
    /// where it cannot be.
    pub(super) fn measure_above(
        &self,
        query: &InterferenceQuery<'_>,
        pose: &Pose,
        least: f64,
    ) -> Option<HeldPose> {
        let apart = self.without_overlap(pose);
        let measured = (apart.rank >= least).then(|| self.with_overlap(query, apart));
        measured.filter(|m| m.rank >= least)
    }

    /// The hold at a pose, and what the parts enclose, as if they did not overlap.
    fn without_overlap(&self, pose: &Pose) -> HeldPose {
        let hold = self.contact.hold(pose);
        let enclosed = self.enclosure.volume(pose.rotation, pose.translation);
        let share = enclosed / self.contact.radius.powi(3);
        HeldPose {
            pose: *pose,
            hold,
            interference: Interference::default(),
            overlap: 0.0,
            enclosed,
            rank: hold.hold + CLOSES * share.min(1.0),
            joint: Joint::default(),
            alike: Vec::new(),
        }
    }

    /// The same pose with its overlap, and what that costs.
    fn with_overlap(&self, query: &InterferenceQuery<'_>, apart: HeldPose) -> HeldPose {
        let interference = query.at(apart.pose.rotation, apart.pose.translation);
        let overlap = (interference.volume / self.moving.volume()).clamp(0.0, 1.0);
        let depth = interference.depth / self.contact.radius;
        let cost = OVERLAP * (overlap / SLIGHT_OVERLAP).ln_1p()
            + INSIDE * overlap
            + DEPTH * (depth - FACET_DEPTH).max(0.0);
        HeldPose {
            interference,
            overlap,
            rank: apart.rank - cost,
            ..apart
        }
    }

    /// Whether contact holds the part alike at two poses: as well along its strongest, its second and
    /// all other motions.
    fn is_alike(&self, a: &Pose, b: &Pose) -> bool {
        let clearance = self.contact.clearance();
        let [a, b] = [a, b].map(|pose| self.contact.gramian(pose, clearance).matrix.eigen().0);
        let ratio = |(x, y): (&f64, &f64)| {
            let [x, y] = [x, y].map(|v| v.max(0.0) + INFORMATION_FLOOR);
            (x / y).ln().abs()
        };
        a.iter().zip(&b).map(ratio).fold(0.0, f64::max) < ALIKE_RATIO
    }
}

/// Turns about its axis within which the facets of a round part come to each other's places, radians;
/// none if it has no facets.
fn facet_turns(part: &TriangleMesh, axis: DVec3) -> Vec<f64> {
    let axes = symmetry::detect(part, EXACT * part.bounds().diagonal());
    let own = (axes.iter()).find(|a| a.direction.cross(axis).length() < 1e-3);
    match own.map(|a| a.order) {
        Some(SymmetryOrder::Finite(facets)) => {
            let step = TAU / f64::from(facets) / FACET_TURNS as f64;
            (1..FACET_TURNS).map(|k| k as f64 * step).collect()
        }
        _ => Vec::new(),
    }
}

fn shifted(pose: &Pose, by: DVec3) -> Pose {
    Pose::new(pose.rotation, pose.translation + by)
}
