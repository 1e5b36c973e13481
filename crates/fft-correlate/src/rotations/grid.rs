//! The rotations a table holds, and which of them a query reads with which weights.
//!
//! A ball of up to 120 degrees is one chart; larger balls and the full set are cut into the four
//! cells of the cubed 3-sphere (two where a part has a symmetry axis), each a little larger than
//! its share, and joined by weights that sum to one and fade smoothly across every seam. A symmetry
//! of order n makes n images of each chart, joined the same way; a body of revolution needs only
//! the rotations without twist about its axis, a two-dimensional chart.

use std::f64::consts::{FRAC_PI_4, PI};

use glam::{DQuat, DVec3};

use crate::geometry::half_turn::{HalfTurnGroup, RotationSum, groups_where};
use crate::geometry::se3::{Pose, Wrench};
use crate::geometry::taps::{Edge, Reach, Taps};
use crate::rotations::atlas::{Atlas, Cover, Patch, RadialStop, RelativeRotation};
use crate::rotations::build;
use crate::rotations::chart::{Chart, node_sum};
use crate::rotations::domain::{AxisSymmetry, RotationDomain, RotationError, quaternion};
use crate::rotations::symmetry::{Fold, Symmetry};

/// Nodes over a rotation domain, in the order of a table's rows.
///
/// ```
/// use fft_correlate::{RotationDomain, RotationGrid};
/// use glam::DQuat;
///
/// let grid = RotationGrid::new(&RotationDomain::ball(10.0, 5.0), None)?;
/// assert!(grid.step() <= 5f64.to_radians());
/// // The middle of the ball is a node.
/// let nearest = |q: DQuat| grid.nodes().iter().map(|n| n.angle_between(q)).fold(9.0, f64::min);
/// assert!(nearest(DQuat::IDENTITY) < 1e-6);
/// # Ok::<(), fft_correlate::RotationError>(())
/// ```
#[derive(Debug, Clone)]
pub struct RotationGrid {
    atlas: Atlas,
}

/// Where one patch reads for a pose.
pub(crate) struct Site<'a> {
    /// Share of this patch in the result and its gradient by a turn of the query's pose.
    pub(crate) share: f64,
    pub(crate) share_gradient: DVec3,
    /// The pose to read at, but for [`Site::rest`].
    pub(crate) pose: Pose,
    /// Where a rotation outside the domain is read instead.
    pub(crate) rest: Option<RadialStop>,
    pub(crate) chart: &'a Chart,
    pub(crate) taps: [Taps; 3],
    /// Gradients of the three chart coordinates (in nodes) by a turn of what is read.
    pub(crate) gradients: [DVec3; 3],
    pub(crate) coverage: f64,
    /// What is read counts by this, 1 in the domain and 0 far outside.
    pub(crate) weight: f64,
    /// Gradient of the weight by a turn of [`Site::pose`].
    pub(crate) weight_gradient: DVec3,
    fold: Fold,
}

/// How far a rotation is covered, and what is read there counts, with the gradient by a turn.
struct Coverage {
    coverage: f64,
    weight: f64,
    gradient: DVec3,
}

impl Coverage {
    const WHOLE: Self = Self {
        coverage: 1.0,
        weight: 1.0,
        gradient: DVec3::ZERO,
    };

    /// Beyond `angle` coverage ends over `margin`, what is read fades over `fade`; radians.
    fn beyond(away: &RelativeRotation, angle: f64, margin: f64, fade: f64) -> Self {
        let (weight, gradient) = away.beyond(angle, fade);
        Self {
            coverage: away.beyond(angle, margin).0,
            weight,
            gradient,
        }
    }
}

impl Site<'_> {
    /// The rotation that is read.
    pub(crate) fn rotation(&self) -> DQuat {
        self.rest
            .map_or(self.pose.rotation, |rest| rest.apply(self.pose.rotation))
    }

    /// A torque by turns of what is read as one by turns of [`Site::pose`].
    pub(crate) fn turn_back(&self, torque: DVec3) -> DVec3 {
        self.rest.map_or(torque, |rest| rest.pull_back(torque))
    }

    /// A wrench at [`Site::pose`] as a wrench at the query's pose.
    pub(crate) fn pull_back(&self, wrench: &Wrench) -> Wrench {
        self.fold.pull_back(wrench)
    }
}

impl RotationGrid {
    /// The largest number of nodes each chart of a grid may have, before any are left out.
    pub const MAX_NODES: u64 = build::MAX_NODES;

    /// Grids a domain, leaving out what the symmetry makes redundant.
    ///
    /// # Errors
    /// If a number of the domain or symmetry is out of range, there would be too many nodes, or
    /// a symmetry comes with a list or spin.
    pub fn new(
        domain: &RotationDomain,
        symmetry: Option<&AxisSymmetry>,
    ) -> Result<Self, RotationError> {
        if let Some(s) = symmetry {
            s.validate()?;
            if matches!(
                domain,
                RotationDomain::List { .. } | RotationDomain::Spin { .. }
            ) {
                return Err(RotationError::Symmetry { order: s.order });
            }
        }
        // Turns by a full circle tell nothing.
        let symmetry = symmetry.filter(|s| s.order != 1).map(Symmetry::new);
        let atlas = match domain {
            RotationDomain::List {
                rotations,
                margin_deg,
            } => build::list(rotations, *margin_deg)?,
            RotationDomain::Spin {
                center,
                axis,
                range_deg,
                step_deg,
            } => build::spin(*center, *axis, *range_deg, *step_deg)?,
            RotationDomain::Ball {
                center,
                angle_deg,
                step_deg,
            } => build::ball(*center, *angle_deg, *step_deg, symmetry)?,
            RotationDomain::Full { center, step_deg } => {
                let center = quaternion("center", *center)?;
                build::full(center, build::step("step_deg", *step_deg)?, symmetry)?
            }
        };
        Ok(Self { atlas })
    }

    /// About how many nodes the boxes of a domain's charts have, before any is left out; infinite
    /// for steps out of range.
    pub(crate) fn box_nodes(domain: &RotationDomain, symmetry: Option<&AxisSymmetry>) -> f64 {
        // Charts about the axis of a body of revolution are flat.
        let axes = if symmetry.is_some_and(|s| s.order == 0) {
            2
        } else {
            3
        };
        let cells = |angle: f64, step: f64| match step > 0.0 {
            true => angle / step,
            false => f64::INFINITY,
        };
        match domain {
            RotationDomain::List { rotations, .. } => rotations.len() as f64,
            RotationDomain::Spin {
                range_deg,
                step_deg,
                ..
            } => {
                let [first, last] = range_deg.unwrap_or([0.0, 360.0]);
                cells(last - first, *step_deg)
            }
            RotationDomain::Ball {
                angle_deg,
                step_deg,
                ..
            } => (2.0 * cells(*angle_deg, *step_deg)).powi(axes),
            RotationDomain::Full { step_deg, .. } => {
                4.0 * (2.0 * cells(90.0, *step_deg)).powi(axes)
            }
        }
    }

    /// About how many bytes a grid takes, without making it; `None` if [`RotationGrid::new`] refuses
    /// it before it takes any.
    pub(crate) fn bytes(domain: &RotationDomain, symmetry: Option<&AxisSymmetry>) -> Option<u64> {
        // A node's rotation, its place in its chart, and its number there.
        let each = size_of::<DQuat>() + size_of::<[u32; 2]>() + size_of::<u32>();
        let nodes = Self::box_nodes(domain, symmetry);
        // There are four charts at most.
        (nodes <= 4.0 * Self::MAX_NODES as f64).then(|| nodes as u64 * each as u64)
    }

    /// Rotations of the nodes, in the order of a table's rows.
    pub fn nodes(&self) -> &[DQuat] {
        &self.atlas.nodes
    }

    /// What the node of a row keeps, of the energies at its rotation and near it.
    pub fn node_sum(&self, row: usize) -> RotationSum {
        match self.atlas.places.get(row) {
            Some([chart, flat]) => {
                let chart = &self.atlas.charts[*chart as usize];
                node_sum(chart, chart.unravel(*flat as usize))
            }
            // Listed rotations answer for themselves.
            None => RotationSum::one(self.atlas.nodes[row]),
        }
    }

    /// The nodes in groups whose sums differ by half turns; the first of a group stands for all.
    pub(crate) fn half_turn_groups(&self) -> Vec<HalfTurnGroup> {
        groups_where(self.nodes(), |first, turn, row| {
            self.node_sum(first)
                .turned(turn)
                .agrees(&self.node_sum(row))
        })
    }

    /// Replaces, in the charts, each row by `slots[row]`, which may be [`Chart::ABSENT`].
    pub(crate) fn number(&mut self, slots: &[u32]) {
        for row in self.atlas.charts.iter_mut().flat_map(|c| &mut c.rows) {
            if *row != Chart::ABSENT {
                *row = slots[*row as usize];
            }
        }
    }

    /// Outside the domain what is read fades over all that is left of a half turn, instead of over
    /// the margin in which coverage ends. Of several listed rotations it fades over the margin:
    /// between them there is nothing.
    pub(crate) fn fade_far(&mut self) {
        let atlas = &mut self.atlas;
        atlas.fade = match atlas.cover {
            Cover::Ball { angle, .. } => PI - angle,
            Cover::List { .. } if atlas.nodes.len() > 1 => atlas.fade,
            _ => PI,
        };
    }

    /// Angle between neighbouring nodes, radians; for a list, the angle at which coverage ends.
    pub fn step(&self) -> f64 {
        self.atlas.step
    }

    /// Calls `visit` for every patch that `pose` reads; their shares sum to 1.
    pub(crate) fn visit<'a>(&'a self, pose: &Pose, mut visit: impl FnMut(Site<'a>)) {
        if let Cover::List { margin } = self.atlas.cover {
            return visit(self.nearest(pose, margin));
        }
        if self.atlas.patches.len() == 1 {
            return visit(self.site(pose, 0, (1.0, DVec3::ZERO)));
        }
        let q = pose.rotation;
        let best = (0..self.atlas.patches.len())
            .map(|k| self.atlas.closeness(k, q))
            .fold(0.0, f64::max);
        // A patch whose closeness is below this one's seam has no share.
        let least = best * (FRAC_PI_4 - 0.5 * self.atlas.step).max(0.0).tan();
        let near = |k: &usize| self.atlas.closeness(*k, q) > least;
        let (mut total, mut total_gradient) = (0.0, DVec3::ZERO);
        for k in (0..self.atlas.patches.len()).filter(near) {
            let (share, gradient) = self.atlas.blend_weight(k, q);
            total += share;
            total_gradient += gradient;
        }
        for k in (0..self.atlas.patches.len()).filter(near) {
            let (share, gradient) = self.atlas.blend_weight(k, q);
            if share > 0.0 {
                let share = share / total;
                let gradient = (gradient - share * total_gradient) / total;
                visit(self.site(pose, k, (share, gradient)));
            }
        }
    }

    /// Writes to `distances`, for each row of the charts, how far it lies from `rotation`, in
    /// nodes: the greatest of the distances along a chart's axes, the least over charts and images.
    /// A query reads rows nearer than 2, on a grid of listed rotations only the nearest.
    pub(crate) fn distances(&self, rotation: DQuat, distances: &mut [f32]) {
        node_distances(&self.atlas, rotation, distances);
    }

    /// Whether `has` holds for every row that a query at `pose` reads, and for those one node
    /// around them.
    pub(crate) fn all_around(&self, pose: &Pose, mut has: impl FnMut(u32) -> bool) -> bool {
        // The next of listed rotations has nothing to do with the nearest.
        let wider = usize::from(!matches!(self.atlas.cover, Cover::List { .. }));
        let mut all = true;
        self.visit(pose, |site| {
            if site.weight > 0.0 && all {
                all = all_around(site.chart, &site.taps, wider, &mut has);
            }
        });
        all
    }

    fn site(&self, pose: &Pose, patch: usize, (share, share_gradient): (f64, DVec3)) -> Site<'_> {
        let Patch { chart, turn, .. } = self.atlas.patches[patch];
        let chart = &self.atlas.charts[chart];
        let (pose, fold) = match &self.atlas.symmetry {
            Some(s) => s.fold(pose, turn, chart.center),
            None => (*pose, Fold::Identity),
        };
        // The rotation at which the chart is read.
        let rest = self.atlas.radial_stop(pose.rotation);
        let read = rest.map_or(pose.rotation, |rest| rest.apply(pose.rotation));
        let (mut x, mut gradients) = chart.locate(read);
        // Coverage, which ends with the open axis of a spin.
        let mut covered = self.coverage(chart, pose.rotation);
        if let Cover::Spin { margin } = self.atlas.cover
            && !chart.periodic
        {
            match Reach::new(x[2], chart.shape[2], &self.edge(chart, margin)) {
                Some(reach) => {
                    covered.gradient = covered.gradient * reach.weight
                        + covered.weight * reach.weight_slope * gradients[2];
                    covered.weight *= reach.weight;
                    covered.coverage *= reach.coverage;
                    gradients[2] *= reach.slope;
                    x[2] = reach.at;
                }
                None => {
                    (covered.coverage, covered.weight) = (0.0, 0.0);
                    covered.gradient = DVec3::ZERO;
                }
            }
        }
        let taps = std::array::from_fn(|k| {
            if chart.periodic && k == 2 {
                Taps::periodic(x[k], chart.shape[k])
            } else {
                Taps::open(x[k], chart.shape[k])
            }
        });
        Site {
            share,
            share_gradient,
            pose,
            rest,
            chart,
            taps,
            gradients,
            coverage: covered.coverage,
            weight: covered.weight,
            weight_gradient: covered.gradient,
            fold,
        }
    }

    /// How an open spin ends, in nodes; the fade ends before the middle of what is left of the turn.
    fn edge(&self, chart: &Chart, margin: f64) -> Edge {
        let cells = (chart.shape[2] - 1) as f64;
        let left = 0.5 * (2.0 * PI / self.atlas.step - cells);
        Edge {
            margin,
            fade: [(self.atlas.fade / self.atlas.step).min(left).max(1e-9); 2],
        }
    }

    /// How far a folded rotation is covered.
    fn coverage(&self, chart: &Chart, q: DQuat) -> Coverage {
        let (step, fade) = (self.atlas.step, self.atlas.fade);
        match self.atlas.cover {
            Cover::All | Cover::List { .. } => Coverage::WHOLE,
            Cover::Ball {
                center,
                angle,
                margin,
            } => Coverage::beyond(
                &RelativeRotation::from_center(q, center),
                angle,
                margin,
                fade,
            ),
            Cover::Spin { margin } => {
                let r = chart.relative(q);
                let twist = DQuat::from_xyzw(0.0, 0.0, r.z, r.w);
                let swing = match twist.length() {
                    l if l > 1e-9 => r * (twist * (1.0 / l)).conjugate(),
                    _ => r,
                };
                // A turn of r turns its swing alike, up to a twist, which leaves the tilt as it is.
                let covered = Coverage::beyond(
                    &RelativeRotation::from_rotation(swing),
                    0.0,
                    margin * step,
                    fade,
                );
                Coverage {
                    gradient: chart.frame * covered.gradient,
                    ..covered
                }
            }
        }
    }

    fn nearest(&self, pose: &Pose, margin: f64) -> Site<'_> {
        let q = pose.rotation;
        let (mut row, mut best) = (0, -1.0);
        for (k, node) in self.atlas.nodes.iter().enumerate() {
            let closeness = node.dot(q).abs();
            if closeness > best {
                (row, best) = (k, closeness);
            }
        }
        let away = RelativeRotation::from_center(q, self.atlas.nodes[row]);
        let covered = Coverage::beyond(&away, 0.0, margin, self.atlas.fade);
        let mut taps = [Taps::open(0.0, 1); 3];
        taps[0].nodes = [row; 4];
        Site {
            share: 1.0,
            share_gradient: DVec3::ZERO,
            pose: *pose,
            rest: away.radial_stop(0.0, margin),
            chart: &self.atlas.charts[0],
            taps,
            gradients: [DVec3::ZERO; 3],
            coverage: covered.coverage,
            weight: covered.weight,
            weight_gradient: covered.gradient,
            fold: Fold::Identity,
        }
    }
}

/// [`RotationGrid::distances`].
fn node_distances(atlas: &Atlas, rotation: DQuat, distances: &mut [f32]) {
    distances.fill(f32::INFINITY);
    if let Cover::List { margin } = atlas.cover {
        for (node, distance) in atlas.nodes.iter().zip(distances.iter_mut()) {
            *distance = (node.angle_between(rotation) / margin) as f32;
        }
        // The nearest is read from far away, too.
        let nearest = distances.iter_mut().min_by(|a, b| a.total_cmp(b));
        if let Some(nearest) = nearest {
            *nearest = nearest.min(1.0);
        }
        return;
    }
    let pose = Pose::new(rotation, DVec3::ZERO);
    for patch in &atlas.patches {
        let chart = &atlas.charts[patch.chart];
        let folded = match &atlas.symmetry {
            Some(s) => s.fold(&pose, patch.turn, chart.center).0,
            None => pose,
        };
        let rest = atlas.radial_stop(folded.rotation);
        let read = rest.map_or(folded.rotation, |rest| rest.apply(folded.rotation));
        let (mut x, _) = chart.locate(read);
        if matches!(atlas.cover, Cover::Spin { .. }) && !chart.periodic {
            x[2] = x[2].clamp(0.0, (chart.shape[2] - 1) as f64);
        }
        lower_distances(chart, x, distances);
    }
}

/// Whether `has` holds for every row of a chart that taps read, and for those `wider` nodes around
/// them.
fn all_around(
    chart: &Chart,
    taps: &[Taps; 3],
    wider: usize,
    mut has: impl FnMut(u32) -> bool,
) -> bool {
    let spans: [(usize, usize); 3] = std::array::from_fn(|k| {
        let closed = chart.periodic && k == 2;
        span(&taps[k], chart.shape[k], wider, closed)
    });
    let [_, ny, nz] = chart.shape;
    let mut all = true;
    for i in 0..spans[0].1 {
        for j in 0..spans[1].1 {
            for k in 0..spans[2].1 {
                let (x, y) = (spans[0].0 + i, spans[1].0 + j);
                let z = (spans[2].0 + k) % nz;
                let row = chart.rows[(x * ny + y) * nz + z];
                all &= row == Chart::ABSENT || has(row);
            }
        }
    }
    all
}

/// The first node and the number of nodes that taps read, `wider` nodes more on each side.
fn span(taps: &Taps, n: usize, wider: usize, closed: bool) -> (usize, usize) {
    let read = |s: &usize| taps.weights[*s] != 0.0 || taps.slopes[*s] != 0.0;
    let (first, last) = ((0..4).find(read), (0..4).rfind(read));
    let (first, last) = (first.unwrap_or(0), last.unwrap_or(0));
    if closed {
        let before = taps.nodes[first] + n - wider % n;
        return (before % n, (last - first + 1 + 2 * wider).min(n));
    }
    let from = taps.nodes[first].saturating_sub(wider);
    let to = (taps.nodes[last] + wider).min(n - 1);
    (from, to - from + 1)
}

/// Lowers each row's distance to that from index `x`.
fn lower_distances(chart: &Chart, x: [f64; 3], distances: &mut [f32]) {
    let along: [Vec<f32>; 3] = std::array::from_fn(|k| {
        let n = chart.shape[k];
        let away = |i: usize| {
            let away = (x[k] - i as f64).abs();
            match chart.periodic && k == 2 {
                true => (away % n as f64).min(n as f64 - away % n as f64),
                // The only node of an axis is read from anywhere.
                false if n == 1 => 0.0,
                false => away,
            }
        };
        (0..n).map(|i| away(i) as f32).collect()
    });
    let mut rows = chart.rows.iter();
    for dx in &along[0] {
        for dy in &along[1] {
            for dz in &along[2] {
                let row = rows.next().copied().unwrap_or(Chart::ABSENT);
                if let Some(distance) = distances.get_mut(row as usize) {
                    *distance = distance.min(dx.max(*dy).max(*dz));
                }
            }
        }
    }
}
