//! Hypotheses of how two parts fit: poses in which planes of one lie on planes of the other, pins in
//! holes, balls in cups. They come from the surfaces alone, whatever the frames.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3};
use sdf_grid::{PatchAxis, Plane, RoundPatch, SurfaceFeatures};

use super::axis::KnownAxis;
use crate::geometry::se3::Pose;

/// Directions are parallel if they turn from each other by less: 1 degree.
const PARALLEL_COSINE: f64 = 0.99985;

/// Sine of the angle between alike axes, at most.
const ALIKE_SINE: f64 = 0.01;

/// Directions of each part whose pairs give rotations.
const DIRECTIONS: [usize; 2] = [14, 12];

/// Rotations, at most.
const ROTATIONS: usize = 120;

/// Offsets along each direction, at most, and directions, of one rotation.
const OFFSETS: usize = 30;
const GROUPS: usize = 6;

/// Places of one rotation, at most.
const PLACES: usize = 12_000;

/// Directions span space if the volume between them is at least this.
const LEAST_SPAN: f64 = 0.3;

/// Planes that become flush count less than planes that mate.
const FLUSH: f64 = 0.3;

/// A pin goes into a hole of at most `1 / 0.7` times its radius; and of 0.96 times, for facets.
const PIN_RATIO: std::ops::Range<f64> = 0.7..1.04;

/// Pairs of axes, at most; of alike ones only some are tried in all spins and places.
const AXIS_PAIRS: usize = 300;

/// Spins evenly about an axis, and those that make planes parallel, at most.
const SPINS: usize = 24;
const ALIGNED_SPINS: usize = 24;

/// A part that more turns about an axis map onto itself is nearly round.
const MOST_TURNS: usize = 64;

/// Places along an axis from planes, and evenly, at most.
const AXIAL_PLACES: usize = 40;
const EVEN_PLACES: usize = 120;

/// Pairs of planes with one pair of directions.
struct Direction<'a> {
    normal: DVec3,
    area: f64,
    planes: Vec<&'a Plane>,
}

/// Poses that have something in common, of which only the best are kept.
pub(super) struct Family {
    pub(super) poses: Vec<Pose>,
    /// Families of this number differ by which of many alike holes they use: what is best in one is
    /// tried in the others.
    pub(super) alike: Option<usize>,
    /// Where the hole is, metres, fixed frame.
    pub(super) anchor: DVec3,
}

impl Family {
    fn single(poses: Vec<Pose>) -> Self {
        Self {
            poses,
            alike: None,
            anchor: DVec3::ZERO,
        }
    }
}

/// Two parts' features and what hypotheses are made of.
pub(super) struct Hypotheses<'a> {
    parts: [&'a SurfaceFeatures; 2],
    directions: [Vec<Direction<'a>>; 2],
    /// Resolution of places, metres.
    clearance: f64,
    /// Axis of revolution of the moving part, if it has one: its spin does not matter.
    round: Option<DVec3>,
    /// Motions that map the moving part onto itself.
    symmetries: &'a [Pose],
    /// Whether poses that they make equal are all wanted, not one of them.
    all_equal: bool,
}

impl<'a> Hypotheses<'a> {
    /// Of the fixed and the moving part.
    pub(super) fn new(
        parts: [&'a SurfaceFeatures; 2],
        clearance: f64,
        round: Option<DVec3>,
        (symmetries, all_equal): (&'a [Pose], bool),
    ) -> Self {
        let widths = parts.map(|p| widths(&p.planes));
        let [first, second] = [0, 1].map(|i| {
            // Sides of a tongue as wide as a groove of the other part, or of such a groove.
            let fit = |a: &&Width<'_>| widths[1 - i].iter().any(|b| (a.1 + b.1).abs() < clearance);
            let fits: Vec<&Plane> = widths[i].iter().filter(fit).map(|w| w.0).collect();
            directions(&parts[i].planes, &fits)
        });
        Self {
            directions: [first, second],
            parts,
            clearance,
            round,
            symmetries,
            all_equal,
        }
    }

    /// Rotations in which at least two directions of the moving part's planes are opposite to
    /// directions of the fixed part's, those with most area opposite first; one of those that the
    /// moving part's symmetry makes equal.
    pub(super) fn rotations(&self) -> Vec<DQuat> {
        let symmetries = if self.all_equal { &[] } else { self.symmetries };
        let [fixed, moving] = &self.directions;
        let fixed = &fixed[..fixed.len().min(DIRECTIONS[0])];
        let moving = &moving[..moving.len().min(DIRECTIONS[1])];
        let opposite_area = |q: DQuat| -> f64 {
            let of = |m: &Direction<'_>| {
                let n = q * m.normal;
                let meets = fixed.iter().filter(|f| n.dot(f.normal) < -PARALLEL_COSINE);
                meets.map(|f| f.area.min(m.area)).fold(0.0, f64::max)
            };
            moving.iter().map(of).sum()
        };
        let mut found: Vec<(DQuat, f64)> = Vec::new();
        for (a, b) in pairs(moving) {
            let angle = a.dot(b);
            if angle.abs() > 0.97 {
                continue;
            }
            for (c, d) in pairs(fixed) {
                if (c.dot(d) - angle).abs() > 0.02 {
                    continue;
                }
                let turn = frame(-c, -d) * frame(a, b).transpose();
                let q = DQuat::from_mat3(&turn).normalize();
                let same = |o: DQuat| o.dot(q).abs() > PARALLEL_COSINE;
                let known = |(o, _): &(DQuat, f64)| {
                    same(*o) || symmetries.iter().any(|s| same(*o * s.rotation))
                };
                if !found.iter().any(known) {
                    found.push((q, opposite_area(q)));
                }
            }
        }
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found.truncate(ROTATIONS);
        found.into_iter().map(|f| f.0).collect()
    }

    /// Places of one rotation in which planes along three directions mate, or become flush.
    pub(super) fn planar(&self, rotation: DQuat) -> Family {
        let mut groups = self.offset_groups(rotation);
        let weight = |g: &OffsetGroup| -> f64 { g.offsets.iter().map(|o| o.1).sum() };
        groups.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
        groups.truncate(GROUPS);
        let mut places: Vec<(DVec3, f64)> = Vec::new();
        for (i, a) in groups.iter().enumerate() {
            for (j, b) in groups.iter().enumerate().skip(i + 1) {
                for c in groups.iter().skip(j + 1) {
                    let rows = DMat3::from_cols(a.normal, b.normal, c.normal).transpose();
                    if rows.determinant().abs() < LEAST_SPAN {
                        continue;
                    }
                    let inverse = rows.inverse();
                    for (x, wx) in &a.offsets {
                        for (y, wy) in &b.offsets {
                            for (z, wz) in &c.offsets {
                                places.push((inverse * DVec3::new(*x, *y, *z), wx * wy * wz));
                            }
                        }
                    }
                }
            }
        }
        places.sort_by(|a, b| b.1.total_cmp(&a.1));
        places.truncate(PLACES);
        let pose = |(t, _): (DVec3, f64)| Pose::new(rotation, t);
        Family::single(places.into_iter().map(pose).collect())
    }

    /// Offsets of the translation along the directions in which planes, or a plane and a pin, mate.
    fn offset_groups(&self, rotation: DQuat) -> Vec<OffsetGroup> {
        let [fixed, moving] = &self.directions;
        let mut groups: Vec<OffsetGroup> = Vec::new();
        for f in fixed {
            for m in moving {
                let along = (rotation * m.normal).dot(f.normal);
                if along.abs() < PARALLEL_COSINE {
                    continue;
                }
                let share = if along < 0.0 { 1.0 } else { FLUSH };
                for a in &f.planes {
                    for b in &m.planes {
                        let offset = a.offset - along.signum() * b.offset;
                        let weight = share * a.area.min(b.area).sqrt();
                        add_offset(&mut groups, f.normal, offset, weight, along < 0.0);
                    }
                }
            }
        }
        // Where nothing stops a part along a groove, its sides lie middle on middle.
        if let Some(along) = common_perpendicular(&groups) {
            let offsets = self.middle_offsets(rotation, along);
            let normal = along;
            groups.push(OffsetGroup { normal, offsets });
        }
        // Planes that touch pins.
        let [fixed_axes, moving_axes] = self.parts.map(|p| &p.axes);
        for f in fixed {
            for (offset, area) in tangents(moving_axes, -(rotation.conjugate() * f.normal)) {
                for a in &f.planes {
                    let weight = area.min(a.area).sqrt();
                    add_offset(&mut groups, f.normal, a.offset + offset, weight, false);
                }
            }
        }
        for m in moving {
            let normal = -(rotation * m.normal);
            for (offset, area) in tangents(fixed_axes, normal) {
                for b in &m.planes {
                    let weight = area.min(b.area).sqrt();
                    add_offset(&mut groups, normal, offset + b.offset, weight, false);
                }
            }
        }
        for g in &mut groups {
            g.offsets = clustered(
                std::mem::take(&mut g.offsets),
                0.5 * self.clearance,
                OFFSETS,
            );
        }
        groups
    }

    /// Offsets along a direction at which the middles of planes that mate meet, and their weights.
    fn middle_offsets(&self, rotation: DQuat, along: DVec3) -> Vec<(f64, f64)> {
        let [fixed, moving] = &self.directions;
        let opposite = |f: &Direction<'_>, m: &Direction<'_>| {
            (rotation * m.normal).dot(f.normal) < -PARALLEL_COSINE
        };
        let pairs = fixed
            .iter()
            .flat_map(|f| moving.iter().map(move |m| (f, m)))
            .filter(|(f, m)| opposite(f, m));
        let planes = pairs.flat_map(|(f, m)| {
            (f.planes.iter()).flat_map(move |a| m.planes.iter().map(move |b| (*a, *b)))
        });
        let offset = |(a, b): (&Plane, &Plane)| {
            let apart = a.middle - rotation * b.middle;
            (apart.dot(along), a.area.min(b.area).sqrt())
        };
        planes.map(offset).collect()
    }

    /// Pins in holes: for every pair of axes and both senses, all spins and places along the axis.
    pub(super) fn coaxial(&self) -> Vec<Family> {
        let mut families = Vec::new();
        let mut kinds: Vec<(AxisPair, DQuat)> = Vec::new();
        let pairs = self.axis_pairs();
        for pair in &pairs {
            for sense in [1.0, -1.0] {
                let base =
                    DQuat::from_rotation_arc(pair.moving.direction, sense * pair.fixed.direction);
                let alike = |(known, turn): &(AxisPair, DQuat)| {
                    std::ptr::eq(known.moving, pair.moving)
                        && pair.is_alike(known, 0.1 * self.clearance)
                        && turn.dot(base).abs() > PARALLEL_COSINE
                };
                let kind = kinds.iter().position(alike).unwrap_or_else(|| {
                    kinds.push((pair.clone(), base));
                    kinds.len() - 1
                });
                families.push(Family {
                    poses: self.along_axis(pair, base, sense),
                    alike: Some(kind),
                    anchor: pair.fixed.point,
                });
            }
        }
        families
    }

    /// Pairs of axes that may lie on each other, the largest first.
    fn axis_pairs(&self) -> Vec<AxisPair<'_>> {
        let [fixed, moving] = self.parts.map(|p| &p.axes);
        let of_axis = |m| fixed.iter().filter_map(move |f| AxisPair::new(f, m));
        let mut pairs: Vec<AxisPair<'_>> = moving.iter().flat_map(of_axis).collect();
        pairs.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        pairs.truncate(AXIS_PAIRS);
        pairs
    }

    /// Axes of the fixed part that a moving one may lie on, in sets that are parallel and alike.
    pub(super) fn alike_axes(&self) -> Vec<Vec<KnownAxis>> {
        let mut sets: Vec<(AxisPair<'_>, Vec<KnownAxis>)> = Vec::new();
        for pair in self.axis_pairs() {
            let axis = KnownAxis::new((pair.fixed.point, pair.fixed.direction));
            let alike = |(first, _): &&mut (AxisPair<'_>, Vec<KnownAxis>)| {
                let sine = first.fixed.direction.cross(pair.fixed.direction).length();
                pair.is_alike(first, 0.1 * self.clearance) && sine < ALIKE_SINE
            };
            match sets.iter_mut().find(alike) {
                Some((_, axes)) if axes.contains(&axis) => {}
                Some((_, axes)) => axes.push(axis),
                None => sets.push((pair, vec![axis])),
            }
        }
        sets.into_iter().map(|(_, axes)| axes).collect()
    }

    /// The moving part's axes on a given axis, both ways, in all spins and places in which boxes
    /// around both parts touch.
    pub(super) fn about(&self, point: DVec3, direction: DVec3) -> Vec<Family> {
        let [fixed, moving] = self.parts;
        let along = |p: &Plane, axis: (DVec3, DVec3)| {
            let middle = (p.middle - axis.0).dot(axis.1);
            [middle - p.radius, middle + p.radius]
        };
        let join = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a.min(c), b.max(d)];
        let known = PatchAxis {
            point,
            direction: direction.normalize(),
            patches: Vec::new(),
        };
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let there = (fixed
            .planes
            .iter()
            .map(|p| along(p, (point, known.direction))))
        .fold(none, join);
        let mut families = Vec::new();
        for axis in &moving.axes {
            let here = (moving
                .planes
                .iter()
                .map(|p| along(p, (axis.point, axis.direction))))
            .chain(axis.patches.iter().map(|p| p.span))
            .fold(none, join);
            let pair = AxisPair {
                fixed: &known,
                moving: axis,
                weight: axis.area(),
                spans: vec![(here, there)],
            };
            for sense in [1.0, -1.0] {
                let base = DQuat::from_rotation_arc(axis.direction, sense * known.direction);
                families.push(Family::single(self.along_axis(&pair, base, sense)));
            }
        }
        families
    }

    /// All spins and places of a pair of axes, the moving one turned by `base` onto the fixed one.
    fn along_axis(&self, pair: &AxisPair, base: DQuat, sense: f64) -> Vec<Pose> {
        let along = sense * pair.fixed.direction;
        let mut places = self.axial_places(pair, base, along);
        let spans = pair.spans.iter().map(|(m, f)| {
            let [a, b] = f.map(|x| sense * x);
            (*m, [a.min(b), a.max(b)])
        });
        let spans: Vec<_> = spans.collect();
        // At least a share of the shorter one must lie in the other.
        let together = |s: f64| {
            spans.iter().any(|([a, b], [c, d])| {
                (s + b).min(*d) - (s + a).max(*c) > 0.15 * (b - a).min(d - c)
            })
        };
        places.retain(|s| together(*s));
        let low = spans
            .iter()
            .map(|(m, f)| f[0] - m[1])
            .fold(f64::INFINITY, f64::min);
        let high = spans
            .iter()
            .map(|(m, f)| f[1] - m[0])
            .fold(f64::NEG_INFINITY, f64::max);
        let steps = ((high - low) / (0.7 * self.clearance)).ceil();
        let steps = (steps as usize).clamp(1, EVEN_PLACES);
        let even = (0..=steps).map(|k| low + (high - low) * k as f64 / steps as f64);
        places.extend(even.filter(|s| together(*s)));
        let mut poses = Vec::new();
        for spin in self.spins(pair, base, along) {
            let rotation = (DQuat::from_axis_angle(along, spin) * base).normalize();
            let foot = pair.fixed.point - rotation * pair.moving.point;
            poses.extend(
                places
                    .iter()
                    .map(|s| Pose::new(rotation, foot + *s * along)),
            );
        }
        poses
    }

    /// Places along the axis in which planes across it mate.
    fn axial_places(&self, pair: &AxisPair, base: DQuat, along: DVec3) -> Vec<f64> {
        let [fixed, moving] = &self.directions;
        let mut places = Vec::new();
        for m in moving {
            let n = base * m.normal;
            for f in fixed {
                if n.dot(along).abs() < 0.998 || n.dot(f.normal).abs() < 0.998 {
                    continue;
                }
                let share = if n.dot(f.normal) < 0.0 { 1.0 } else { FLUSH };
                for a in &f.planes {
                    for b in &m.planes {
                        let there =
                            (a.offset - pair.fixed.point.dot(f.normal)) * f.normal.dot(along);
                        let here = (b.offset - pair.moving.point.dot(m.normal)) * n.dot(along);
                        places.push((there - here, share * a.area.min(b.area).sqrt()));
                    }
                }
            }
        }
        let places = clustered(places, 0.2 * self.clearance, AXIAL_PLACES);
        places.into_iter().map(|p| p.0).collect()
    }

    /// Spins about the axis: those that make planes along it parallel, and evenly all around. Of
    /// turns that map the moving part onto itself, as a gear's by one tooth, only the first counts.
    fn spins(&self, pair: &AxisPair, base: DQuat, along: DVec3) -> Vec<f64> {
        let axis = pair.moving.direction;
        if self.round.is_some_and(|r| r.cross(axis).length() < 0.02) {
            return vec![0.0];
        }
        let aligned = self.aligned_spins(base, along);
        let turns = self.turns_about(axis);
        let step = TAU / (SPINS * turns) as f64;
        let (count, period) = match self.all_equal {
            true => (SPINS * turns, TAU),
            false => (SPINS, TAU / turns as f64),
        };
        let even = (0..count).map(|k| step * k as f64);
        let aligned = aligned.into_iter().map(|s| s.0.rem_euclid(period));
        clustered(aligned.map(|s| (s, 1.0)).collect(), 1e-6, ALIGNED_SPINS)
            .into_iter()
            .map(|s| s.0)
            .chain(even)
            .collect()
    }

    /// Turns about an axis of the moving part that map it onto itself.
    fn turns_about(&self, axis: DVec3) -> usize {
        let same = |s: &&Pose| (s.rotation * axis).dot(axis) > 1.0 - 1e-9;
        self.symmetries
            .iter()
            .filter(same)
            .count()
            .clamp(1, MOST_TURNS)
    }

    /// Turns (radians, 0 to a full one) about an axis `along` of the moving part, which lies at
    /// `base`, that make planes along the axis parallel, and how much they do, those that do most
    /// first.
    pub(super) fn aligned_spins(&self, base: DQuat, along: DVec3) -> Vec<(f64, f64)> {
        let first = along.any_orthonormal_vector();
        let second = along.cross(first);
        let angle = |v: DVec3| v.dot(second).atan2(v.dot(first));
        let [fixed, moving] = &self.directions;
        let mut spins = Vec::new();
        let turned = moving.iter().map(|m| (base * m.normal, m.area));
        for (m, area) in turned.filter(|(m, _)| m.dot(along).abs() < 0.05) {
            for f in fixed.iter().filter(|f| f.normal.dot(along).abs() < 0.05) {
                let spin = angle(-f.normal) - angle(m);
                spins.push((spin.rem_euclid(TAU), area.min(f.area).sqrt()));
            }
        }
        clustered(spins, 0.02, ALIGNED_SPINS)
    }

    /// Balls in cups, in these rotations.
    pub(super) fn concentric(&self, rotations: &[DQuat]) -> Vec<Family> {
        let [fixed, moving] = self.parts.map(|p| &p.spheres);
        let mut families = Vec::new();
        for m in moving {
            for f in fixed.iter().filter(|f| f.convex != m.convex) {
                let [ball, cup] = if m.convex { [m, f] } else { [f, m] };
                if PIN_RATIO.contains(&(ball.radius / cup.radius)) {
                    let pose = |q: &DQuat| Pose::new(*q, f.centre - *q * m.centre);
                    families.push(Family::single(rotations.iter().map(pose).collect()));
                }
            }
        }
        families
    }
}

/// Offsets along one direction, with weights.
struct OffsetGroup {
    normal: DVec3,
    offsets: Vec<(f64, f64)>,
}

/// Adds an offset along a normal to the group of its direction; with `begin` a new one if there is
/// none.
fn add_offset(groups: &mut Vec<OffsetGroup>, normal: DVec3, offset: f64, weight: f64, begin: bool) {
    let parallel = |g: &&mut OffsetGroup| g.normal.dot(normal).abs() > PARALLEL_COSINE;
    match groups.iter_mut().find(parallel) {
        Some(g) => g
            .offsets
            .push((g.normal.dot(normal).signum() * offset, weight)),
        None if begin => groups.push(OffsetGroup {
            normal,
            offsets: vec![(offset, weight)],
        }),
        None => {}
    }
}

/// The direction that is normal to those of all groups, if there are two or more and they leave one.
fn common_perpendicular(groups: &[OffsetGroup]) -> Option<DVec3> {
    let first = groups.first()?.normal;
    let across = groups.iter().map(|g| first.cross(g.normal));
    let along = across.max_by(|a, b| a.length().total_cmp(&b.length()))?;
    let normal = along
        .try_normalize()
        .filter(|_| along.length() > LEAST_SPAN)?;
    let all = groups
        .iter()
        .all(|g| g.normal.dot(normal).abs() < LEAST_SPAN);
    all.then_some(normal)
}

/// Planes with normal `n` that touch cylinders: offsets and areas.
fn tangents(axes: &[PatchAxis], n: DVec3) -> impl Iterator<Item = (f64, f64)> + '_ {
    let across = axes.iter().filter(move |a| a.direction.dot(n).abs() < 0.02);
    across.flat_map(move |a| {
        a.patches.iter().map(move |p| {
            let radius = if p.convex { p.radius } else { -p.radius };
            (a.point.dot(n) + radius, 0.5 * p.area)
        })
    })
}

/// A pin and a hole, or several about one axis.
#[derive(Clone)]
struct AxisPair<'a> {
    fixed: &'a PatchAxis,
    moving: &'a PatchAxis,
    weight: f64,
    /// Spans of the moving and the fixed patches that may lie in one another.
    spans: Vec<([f64; 2], [f64; 2])>,
}

impl<'a> AxisPair<'a> {
    fn new(fixed: &'a PatchAxis, moving: &'a PatchAxis) -> Option<Self> {
        let mut weight: f64 = 0.0;
        let mut spans = Vec::new();
        for m in &moving.patches {
            for f in fixed.patches.iter().filter(|f| f.convex != m.convex) {
                let [pin, hole] = if m.convex { [m, f] } else { [f, m] };
                // Of cones, where they have a radius in common.
                let [least, most] = [pin.radii[0] / hole.radii[1], pin.radii[1] / hole.radii[0]];
                let ratio = (pin.radius / hole.radius).clamp(PIN_RATIO.start, 1.0);
                if least < PIN_RATIO.end && most > PIN_RATIO.start {
                    weight = weight.max(m.area.min(f.area) * (1.0 - (1.0 - ratio).abs()));
                    spans.push((m.span, f.span));
                }
            }
        }
        (!spans.is_empty()).then_some(Self {
            fixed,
            moving,
            weight,
            spans,
        })
    }

    /// Whether the fixed axes have the same patches, up to a length.
    fn is_alike(&self, other: &Self, length: f64) -> bool {
        let near = |a: &RoundPatch, b: &RoundPatch| {
            a.convex == b.convex
                && (a.radius - b.radius).abs() < length
                && ((a.span[1] - a.span[0]) - (b.span[1] - b.span[0])).abs() < length
        };
        let [a, b] = [&self.fixed.patches, &other.fixed.patches];
        a.len() == b.len() && a.iter().all(|p| b.iter().any(|q| near(p, q)))
    }
}

/// A plane, and how far an opposite one is behind it, metres: of a tongue. Of a groove it lies before it,
/// at a negative distance.
type Width<'a> = (&'a Plane, f64);

/// The widths of all pairs of opposite planes that lie side by side, each seen from both.
fn widths(planes: &[Plane]) -> Vec<Width<'_>> {
    let mut found = Vec::new();
    for a in planes {
        for b in planes {
            let apart = a.middle - b.middle;
            let beside = apart - apart.dot(a.normal) * a.normal;
            let opposite = a.normal.dot(b.normal) < -PARALLEL_COSINE;
            if opposite && beside.length() < a.radius.max(b.radius) {
                found.push((a, a.offset + b.offset));
            }
        }
    }
    found
}

/// Planes by direction: those first with sides of a tongue or groove that fits the other part, then the
/// nearest to such a side for their size, as the floor of a groove; of equally near ones the largest.
fn directions<'a>(planes: &'a [Plane], fits: &[&Plane]) -> Vec<Direction<'a>> {
    let mut found: Vec<Direction<'_>> = Vec::new();
    for plane in planes {
        let parallel = |d: &&mut Direction<'_>| d.normal.dot(plane.normal) > PARALLEL_COSINE;
        match found.iter_mut().find(parallel) {
            Some(d) => {
                d.area += plane.area;
                d.planes.push(plane);
            }
            None => found.push(Direction {
                normal: plane.normal,
                area: plane.area,
                planes: vec![plane],
            }),
        }
    }
    let apart = |d: &Direction<'_>| {
        let to = |f: &&Plane| {
            let share = |p: &&Plane| p.middle.distance(f.middle) / (p.radius + f.radius);
            match f.normal.dot(d.normal) > PARALLEL_COSINE {
                true => 0.0,
                false => d.planes.iter().map(share).fold(1.0, f64::min),
            }
        };
        fits.iter().map(to).fold(1.0, f64::min)
    };
    let mut found: Vec<_> = found.into_iter().map(|d| (apart(&d), d)).collect();
    found.sort_by(|(a, d), (b, e)| a.total_cmp(b).then(e.area.total_cmp(&d.area)));
    found.into_iter().map(|(_, direction)| direction).collect()
}

/// All ordered pairs of directions.
fn pairs<'a>(of: &'a [Direction<'_>]) -> impl Iterator<Item = (DVec3, DVec3)> + 'a {
    of.iter()
        .flat_map(move |a| of.iter().map(move |b| (a.normal, b.normal)))
}

/// An orthonormal frame that begins with `a`, its third axis normal to `b`.
fn frame(a: DVec3, b: DVec3) -> DMat3 {
    let z = a.cross(b).normalize();
    DMat3::from_cols(a, z.cross(a), z)
}

/// Values within `width` of each other as one, with the sum of their weights; the `most` heaviest.
fn clustered(mut values: Vec<(f64, f64)>, width: f64, most: usize) -> Vec<(f64, f64)> {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut found: Vec<(f64, f64)> = Vec::new();
    let mut start = f64::NEG_INFINITY;
    for (value, weight) in values {
        match found.last_mut() {
            Some((mean, sum)) if value - start < width => {
                *mean = (*mean * *sum + value * weight) / (*sum + weight);
                *sum += weight;
            }
            _ => {
                found.push((value, weight));
                start = value;
            }
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found.truncate(most);
    found
}
