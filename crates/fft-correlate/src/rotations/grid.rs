//! The rotations a table holds, and which of them a query reads with which weights.
//!
//! A ball of up to 120 degrees is one chart; larger balls and the full set are cut into the four
//! cells of the cubed 3-sphere (two where a part has a symmetry axis), each a little larger than its
//! share, and joined by weights that sum to one and fade smoothly across every seam. A symmetry of
//! order n makes n images of each chart, joined the same way; a body of revolution needs only the
//! rotations without twist about its axis, a two-dimensional chart.

mod build;
mod near;

use std::f64::consts::FRAC_PI_4;

use glam::{DQuat, DVec3};

use crate::chart::Chart;
use crate::fold::{Fold, Symmetry};
use crate::rotation_domain::{AxisSymmetry, RotationDomain, RotationError, quaternion};
use crate::taps::{Interpolation, Reach, Taps, fade};
use crate::{Pose, Wrench};

/// Nodes over a rotation domain, in the order of a table's rows.
#[derive(Debug, Clone)]
pub struct RotationGrid {
    nodes: Vec<DQuat>,
    charts: Vec<Chart>,
    patches: Vec<Patch>,
    symmetry: Option<Symmetry>,
    cover: Cover,
    step: f64,
}

/// One image of a chart under the symmetry: queries near `image` are turned onto the chart.
#[derive(Debug, Clone, Copy)]
struct Patch {
    chart: usize,
    /// The chart's centre, turned back by `turn`.
    image: DQuat,
    /// The symmetry's turn that takes queries near `image` onto the chart.
    turn: DQuat,
}

/// How coverage ends.
#[derive(Debug, Clone, Copy)]
enum Cover {
    All,
    /// Beyond this angle from the centre, over the margin; radians.
    Ball {
        center: DQuat,
        angle: f64,
        margin: f64,
    },
    /// With the tilt away from the spin axis; and beyond the ends of the range, `margin` nodes.
    Spin {
        margin: f64,
    },
    /// With the angle from the nearest listed rotation.
    List {
        margin: f64,
    },
}

/// Where one patch reads for a pose.
pub(crate) struct Site<'a> {
    /// Share of this patch in the result and its gradient by a turn of the query's pose.
    pub(crate) share: f64,
    pub(crate) share_gradient: DVec3,
    /// The pose to read at.
    pub(crate) pose: Pose,
    pub(crate) chart: &'a Chart,
    pub(crate) taps: [Taps; 3],
    /// Gradients of the three chart coordinates (in nodes) by a turn of [`Site::pose`].
    pub(crate) gradients: [DVec3; 3],
    pub(crate) coverage: f64,
    /// Gradient of the coverage by a turn of [`Site::pose`].
    pub(crate) coverage_gradient: DVec3,
    fold: Fold,
}

impl Site<'_> {
    /// A wrench at [`Site::pose`] as a wrench at the query's pose.
    pub(crate) fn pull_back(&self, wrench: &Wrench) -> Wrench {
        self.fold.pull_back(wrench)
    }
}

/// Nodes over which coverage fades outside the domain, in spacings.
pub(crate) const MARGIN: f64 = 2.0;

impl RotationGrid {
    /// The largest number of nodes a grid may have, before any are left out.
    pub const MAX_NODES: u64 = 1 << 27;

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
        match domain {
            RotationDomain::List {
                rotations,
                margin_deg,
            } => build::list(rotations, *margin_deg),
            RotationDomain::Spin {
                center,
                axis,
                range_deg,
                step_deg,
            } => build::spin(*center, *axis, *range_deg, *step_deg),
            RotationDomain::Ball {
                center,
                angle_deg,
                step_deg,
            } => build::ball(*center, *angle_deg, *step_deg, symmetry),
            RotationDomain::Full { center, step_deg } => {
                let center = quaternion("center", *center)?;
                build::full(center, build::step("step_deg", *step_deg)?, symmetry)
            }
        }
    }

    /// About how many nodes the boxes of a domain's charts have, before any is left out and without
    /// symmetry; infinite for steps out of range.
    pub(crate) fn box_nodes(domain: &RotationDomain) -> f64 {
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
            } => (2.0 * cells(*angle_deg, *step_deg)).powi(3),
            RotationDomain::Full { step_deg, .. } => 4.0 * cells(90.0, *step_deg).powi(3),
        }
    }

    /// Rotations of the nodes, in the order of a table's rows.
    pub fn nodes(&self) -> &[DQuat] {
        &self.nodes
    }

    /// Replaces, in the charts, each row by `slots[row]`, which may be [`Chart::ABSENT`].
    pub(crate) fn number(&mut self, slots: &[u32]) {
        for row in self.charts.iter_mut().flat_map(|c| &mut c.rows) {
            if *row != Chart::ABSENT {
                *row = slots[*row as usize];
            }
        }
    }

    /// Angle between neighbouring nodes, radians; for a list, the angle at which coverage ends.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Calls `visit` for every patch that `pose` reads; their shares sum to 1.
    pub(crate) fn visit<'a>(
        &'a self,
        pose: &Pose,
        interpolation: Interpolation,
        mut visit: impl FnMut(Site<'a>),
    ) {
        if let Cover::List { margin } = self.cover {
            return visit(self.nearest(pose, margin));
        }
        if self.patches.len() == 1 {
            return visit(self.site(pose, 0, interpolation, (1.0, DVec3::ZERO)));
        }
        let q = pose.rotation;
        let best = (0..self.patches.len())
            .map(|k| self.closeness(k, q))
            .fold(0.0, f64::max);
        // A patch whose closeness is below this one's seam has no share.
        let least = best * (FRAC_PI_4 - 0.5 * self.step).max(0.0).tan();
        let near = |k: &usize| self.closeness(*k, q) > least;
        let (mut total, mut total_gradient) = (0.0, DVec3::ZERO);
        for k in (0..self.patches.len()).filter(near) {
            let (share, gradient) = self.share(k, q);
            total += share;
            total_gradient += gradient;
        }
        for k in (0..self.patches.len()).filter(near) {
            let (share, gradient) = self.share(k, q);
            if share > 0.0 {
                let share = share / total;
                let gradient = (gradient - share * total_gradient) / total;
                visit(self.site(pose, k, interpolation, (share, gradient)));
            }
        }
    }

    /// Cosine of half the angle from the query to the patch's image (for a body of revolution, to
    /// the nearest of its images).
    fn closeness(&self, patch: usize, q: DQuat) -> f64 {
        let image = self.patches[patch].image;
        match &self.symmetry {
            Some(s) if s.is_continuous() => s.swing_closeness(q, image),
            _ => q.dot(image).abs(),
        }
    }

    /// Gradient of [`Self::closeness`] by a turn of `q`.
    fn closeness_gradient(&self, patch: usize, q: DQuat) -> DVec3 {
        let image = self.patches[patch].image;
        match &self.symmetry {
            Some(s) if s.is_continuous() => s.swing_closeness_gradient(q, image),
            _ => {
                let toward = image * q.conjugate();
                0.5 * toward.w.signum() * toward.xyz()
            }
        }
    }

    /// Share of a patch before division by the sum: a product over the seams with all others.
    fn share(&self, patch: usize, q: DQuat) -> (f64, DVec3) {
        let own = self.closeness(patch, q);
        let own_gradient = self.closeness_gradient(patch, q);
        let (mut share, mut log_gradient) = (1.0, DVec3::ZERO);
        for other in (0..self.patches.len()).filter(|&k| k != patch) {
            let width = self.seam_width(patch, other);
            let theirs = self.closeness(other, q);
            let place = theirs.atan2(own) - FRAC_PI_4;
            if place <= -width {
                continue;
            }
            let (factor, slope) = fade((place + width) / (2.0 * width));
            if factor <= 0.0 {
                return (0.0, DVec3::ZERO);
            }
            let turn = own * self.closeness_gradient(other, q) - theirs * own_gradient;
            share *= factor;
            log_gradient += slope / (2.0 * width) / factor * turn / (own * own + theirs * theirs);
        }
        (share, share * log_gradient)
    }

    /// Half the width of a seam in the angle whose tangent is the ratio of closenesses: about one
    /// node of the chart on each side.
    fn seam_width(&self, a: usize, b: usize) -> f64 {
        seam_width(
            self.patches[a].image,
            self.patches[b].image,
            &self.symmetry,
            0.5 * self.step,
        )
    }

    fn site(
        &self,
        pose: &Pose,
        patch: usize,
        interpolation: Interpolation,
        (share, share_gradient): (f64, DVec3),
    ) -> Site<'_> {
        let Patch { chart, turn, .. } = self.patches[patch];
        let chart = &self.charts[chart];
        let (pose, fold) = match &self.symmetry {
            Some(s) => s.fold(pose, turn, chart.center),
            None => (*pose, Fold::Identity),
        };
        let (mut x, mut gradients) = chart.locate(pose.rotation);
        let (mut coverage, mut coverage_gradient) = self.coverage(chart, pose.rotation);
        if let Cover::Spin { margin } = self.cover
            && !chart.periodic
        {
            match Reach::new(x[2], chart.shape[2], margin) {
                Some(reach) => {
                    coverage_gradient = coverage_gradient * reach.coverage
                        + coverage * reach.coverage_slope * gradients[2];
                    coverage *= reach.coverage;
                    gradients[2] *= reach.slope;
                    x[2] = reach.at;
                }
                None => (coverage, coverage_gradient) = (0.0, DVec3::ZERO),
            }
        }
        let taps = std::array::from_fn(|k| {
            if chart.periodic && k == 2 {
                Taps::periodic(x[k], chart.shape[k], interpolation)
            } else {
                Taps::open(x[k], chart.shape[k], interpolation)
            }
        });
        Site {
            share,
            share_gradient,
            pose,
            chart,
            taps,
            gradients,
            coverage,
            coverage_gradient,
            fold,
        }
    }

    /// Coverage of a folded rotation and its gradient by a turn.
    fn coverage(&self, chart: &Chart, q: DQuat) -> (f64, DVec3) {
        match self.cover {
            Cover::All | Cover::List { .. } => (1.0, DVec3::ZERO),
            Cover::Ball {
                center,
                angle,
                margin,
            } => beyond(q * center.conjugate(), angle, margin),
            Cover::Spin { margin } => {
                let r = chart.relative(q);
                let twist = DQuat::from_xyzw(0.0, 0.0, r.z, r.w);
                let swing = match twist.length() {
                    l if l > 1e-9 => r * (twist * (1.0 / l)).conjugate(),
                    _ => r,
                };
                // A turn of r turns its swing alike, up to a twist, which leaves the tilt as it is.
                let (coverage, gradient) = beyond(swing, 0.0, margin * self.step);
                (coverage, chart.frame * gradient)
            }
        }
    }

    fn nearest(&self, pose: &Pose, margin: f64) -> Site<'_> {
        let q = pose.rotation;
        let (mut row, mut best) = (0, -1.0);
        for (k, node) in self.nodes.iter().enumerate() {
            let closeness = node.dot(q).abs();
            if closeness > best {
                (row, best) = (k, closeness);
            }
        }
        let (coverage, coverage_gradient) = beyond(q * self.nodes[row].conjugate(), 0.0, margin);
        let mut taps = [Taps::open(0.0, 1, Interpolation::Linear); 3];
        taps[0].nodes = [row; 4];
        Site {
            share: 1.0,
            share_gradient: DVec3::ZERO,
            pose: *pose,
            chart: &self.charts[0],
            taps,
            gradients: [DVec3::ZERO; 3],
            coverage,
            coverage_gradient,
            fold: Fold::Identity,
        }
    }
}

/// Coverage of a rotation away from the identity: 1 up to `angle`, 0 from `angle + margin`
/// (radians), with its gradient by a turn.
fn beyond(r: DQuat, angle: f64, margin: f64) -> (f64, DVec3) {
    let r = if r.w < 0.0 { -r } else { r };
    let sine = r.xyz().length();
    let found = 2.0 * sine.atan2(r.w);
    if found <= angle {
        return (1.0, DVec3::ZERO);
    }
    let (coverage, slope) = fade((found - angle) / margin);
    let outwards = r.xyz() / sine.max(1e-300);
    (coverage, slope / margin * outwards)
}

fn seam_width(a: DQuat, b: DQuat, symmetry: &Option<Symmetry>, half_step: f64) -> f64 {
    let half_apart = match symmetry {
        Some(s) if s.is_continuous() => FRAC_PI_4,
        _ => 0.5 * a.dot(b).abs().min(1.0).acos(),
    };
    half_step.min(0.9 * half_apart) * half_apart.tan()
}
