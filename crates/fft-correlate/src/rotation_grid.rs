//! The rotations a table holds, and which of them a query reads with which weights.
//!
//! A ball of up to 120 degrees is one chart; larger balls and the full set are cut into the four
//! cells of the cubed 3-sphere (two where a part has a symmetry axis), each a little larger than its
//! share, and joined by weights that sum to one and fade smoothly across every seam. A symmetry of
//! order n makes n images of each chart, joined the same way; a body of revolution needs only the
//! rotations without twist about its axis, a two-dimensional chart.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use glam::{DQuat, DVec3};

use crate::chart::{Chart, Projection};
use crate::fold::{Fold, Symmetry};
use crate::rotation_domain::{
    AxisSymmetry, RotationDomain, RotationError, check_range, direction, quaternion,
};
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
            } => list(rotations, *margin_deg),
            RotationDomain::Spin {
                center,
                axis,
                range_deg,
                step_deg,
            } => spin(*center, *axis, *range_deg, *step_deg),
            RotationDomain::Ball {
                center,
                angle_deg,
                step_deg,
            } => ball(*center, *angle_deg, *step_deg, symmetry),
            RotationDomain::Full { center, step_deg } => {
                let center = quaternion("center", *center)?;
                full(center, step("step_deg", *step_deg)?, symmetry)
            }
        }
    }

    /// Rotations of the nodes, in the order of a table's rows.
    pub fn nodes(&self) -> &[DQuat] {
        &self.nodes
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

fn step(name: &'static str, degrees: f64) -> Result<f64, RotationError> {
    check_range(
        name,
        "0 < step <= 30 degrees",
        degrees,
        degrees > 0.0 && degrees <= 30.0,
    )
    .map(f64::to_radians)
}

fn check_size(found: f64) -> Result<(), RotationError> {
    let limit = RotationGrid::MAX_NODES;
    if found <= limit as f64 {
        Ok(())
    } else {
        Err(RotationError::Size { found, limit })
    }
}

fn list(rotations: &[[f64; 4]], margin_deg: f64) -> Result<RotationGrid, RotationError> {
    if rotations.is_empty() {
        return Err(RotationError::Empty);
    }
    check_size(rotations.len() as f64)?;
    let margin = check_range(
        "margin_deg",
        "0 < margin <= 180 degrees",
        margin_deg,
        margin_deg > 0.0 && margin_deg <= 180.0,
    )?
    .to_radians();
    let nodes = rotations
        .iter()
        .map(|&q| quaternion("rotations", q))
        .collect::<Result<Vec<_>, _>>()?;
    let chart = Chart {
        projection: Projection::Gnomonic,
        center: DQuat::IDENTITY,
        frame: DQuat::IDENTITY,
        spacing: margin,
        origin: [0.0; 3],
        shape: [nodes.len(), 1, 1],
        periodic: false,
        rows: (0..nodes.len() as u32).collect(),
    };
    Ok(RotationGrid {
        nodes,
        charts: vec![chart],
        patches: Vec::new(),
        symmetry: None,
        cover: Cover::List { margin },
        step: margin,
    })
}

fn spin(
    center: [f64; 4],
    axis: [f64; 3],
    range_deg: Option<[f64; 2]>,
    step_deg: f64,
) -> Result<RotationGrid, RotationError> {
    let center = quaternion("center", center)?;
    let axis = direction("axis", axis)?;
    check_range(
        "step_deg",
        "0 < step <= 45 degrees",
        step_deg,
        step_deg > 0.0 && step_deg <= 45.0,
    )?;
    let [first, last] = range_deg.unwrap_or([0.0, 360.0]);
    let width = check_range(
        "range_deg",
        "first < last <= first + 360 degrees",
        last - first,
        last > first && last - first <= 360.0,
    )?;
    let cells = (width / step_deg - 1e-9).ceil().max(1.0);
    check_size(cells)?;
    let periodic = width == 360.0;
    let zero = if periodic {
        first.to_radians()
    } else {
        (0.5 * (first + last)).to_radians()
    };
    let spacing = 0.5 * width.to_radians() / cells;
    let mut chart = Chart {
        projection: Projection::Twist,
        center: DQuat::from_axis_angle(axis, zero) * center,
        frame: DQuat::from_rotation_arc(DVec3::Z, axis),
        spacing,
        origin: [0.0, 0.0, if periodic { 0.0 } else { 0.5 * cells }],
        shape: [1, 1, cells as usize + usize::from(!periodic)],
        periodic,
        rows: Vec::new(),
    };
    chart.rows = (0..chart.len() as u32).collect();
    Ok(RotationGrid {
        nodes: (0..chart.len()).map(|k| chart.node([0, 0, k])).collect(),
        patches: vec![Patch {
            chart: 0,
            image: chart.center,
            turn: DQuat::IDENTITY,
        }],
        charts: vec![chart],
        symmetry: None,
        cover: Cover::Spin { margin: MARGIN },
        step: 2.0 * spacing,
    })
}

/// The largest ball that is one chart, radians: beyond it the chart's nodes crowd.
const ONE_CHART: f64 = 2.0 * PI / 3.0;

fn ball(
    center: [f64; 4],
    angle_deg: f64,
    step_deg: f64,
    symmetry: Option<Symmetry>,
) -> Result<RotationGrid, RotationError> {
    let center = quaternion("center", center)?;
    let step = step("step_deg", step_deg)?;
    let angle = check_range(
        "angle_deg",
        "0 < angle <= 180 degrees",
        angle_deg,
        angle_deg > 0.0 && angle_deg <= 180.0,
    )?
    .to_radians();
    if angle > ONE_CHART || angle + (MARGIN + 2.0) * step > 0.9 * PI {
        return full(center, step, symmetry);
    }
    // Where the ball meets its images, the image further from a query is read too, within the seam's
    // blending zone: there it must be covered as well.
    let apart = symmetry.as_ref().map_or(f64::INFINITY, Symmetry::half_turn);
    let angle = if angle + step > apart {
        angle + 2.0 * step
    } else {
        angle
    };
    let half_step = 0.5 * step;
    // Queries in the ball or its margin touch no node further from the centre.
    let reach = (0.5 * angle / half_step + MARGIN).ceil() + 2.0;
    let frame = symmetry
        .as_ref()
        .map_or(DQuat::IDENTITY, |s| s.frame(center));
    let chart = boxed(center, frame, half_step, reach, &symmetry)?;
    let edge = (0.5 * angle).tan() * (1.0 - 1e-9);
    // The nearest point of a cell lies in the ball.
    let within = |chart: &Chart, cell: [usize; 3]| {
        let (low, high) = (
            chart.coordinates(cell),
            chart.coordinates(cell.map(|c| c + 1)),
        );
        let nearest = low.max(-high).max(DVec3::ZERO);
        DVec3::new(nearest.x.tan(), nearest.y.tan(), nearest.z.tan()).length() < edge
    };
    let cover = Cover::Ball {
        center,
        angle,
        margin: MARGIN * step,
    };
    Ok(assemble(vec![chart], symmetry, cover, step, within))
}

fn full(
    center: DQuat,
    step: f64,
    symmetry: Option<Symmetry>,
) -> Result<RotationGrid, RotationError> {
    let cells = (FRAC_PI_2 / step - 1e-9).ceil();
    let half_step = FRAC_PI_4 / cells;
    let charts = match &symmetry {
        // The share of a chart ends one node beyond the cell's face.
        None => [DQuat::IDENTITY]
            .into_iter()
            .chain([DVec3::X, DVec3::Y, DVec3::Z].map(|e| DQuat::from_axis_angle(e, PI)))
            .map(|turn| {
                boxed(
                    turn * center,
                    DQuat::IDENTITY,
                    half_step,
                    cells + 1.0,
                    &None,
                )
            })
            .collect::<Result<Vec<_>, _>>()?,
        // A prism's cell reaches further at its corners: up to atan(2/sqrt 3) = 49.2 degrees.
        Some(s) => {
            let reach = (49.2 / 45.0 * cells).ceil() + 4.0;
            [center, s.flipped(center)]
                .into_iter()
                .map(|c| boxed(c, s.frame(c), half_step, reach, &symmetry))
                .collect::<Result<Vec<_>, _>>()?
        }
    };
    Ok(assemble(
        charts,
        symmetry,
        Cover::All,
        2.0 * half_step,
        |_, _| true,
    ))
}

/// A gnomonic chart of `reach` nodes to each side of its centre, flat along the axis of a body of
/// revolution.
fn boxed(
    center: DQuat,
    frame: DQuat,
    spacing: f64,
    reach: f64,
    symmetry: &Option<Symmetry>,
) -> Result<Chart, RotationError> {
    let flat = symmetry.as_ref().is_some_and(Symmetry::is_continuous);
    let reach = [reach, reach, if flat { 0.0 } else { reach }];
    check_size(reach.iter().map(|r| 2.0 * r + 1.0).product())?;
    Ok(Chart {
        projection: Projection::Gnomonic,
        center,
        frame,
        spacing,
        origin: reach,
        shape: reach.map(|r| 2 * r as usize + 1),
        periodic: false,
        rows: Vec::new(),
    })
}

/// Numbers the nodes read by queries in the cells that pass `within` and lie, at least in part, on
/// their chart's side of the seams.
fn assemble(
    charts: Vec<Chart>,
    symmetry: Option<Symmetry>,
    cover: Cover,
    step: f64,
    within: impl Fn(&Chart, [usize; 3]) -> bool,
) -> RotationGrid {
    let mut grid = RotationGrid {
        nodes: Vec::new(),
        patches: patches(&charts, symmetry.as_ref()),
        charts,
        symmetry,
        cover,
        step,
    };
    for c in 0..grid.charts.len() {
        let mut rows = grid.read_nodes(c, &within);
        for (flat, row) in rows.iter_mut().enumerate() {
            if *row != Chart::ABSENT {
                *row = grid.nodes.len() as u32;
                grid.nodes
                    .push(grid.charts[c].node(grid.charts[c].unravel(flat)));
            }
        }
        grid.charts[c].rows = rows;
    }
    grid
}

/// All different images of the charts' centres under the symmetry.
fn patches(charts: &[Chart], symmetry: Option<&Symmetry>) -> Vec<Patch> {
    let mut patches: Vec<Patch> = Vec::new();
    for (chart, c) in charts.iter().enumerate() {
        let turns = symmetry.map_or(vec![DQuat::IDENTITY], Symmetry::turns);
        for turn in turns {
            let image = symmetry.map_or(c.center, |s| s.turned(c.center, turn.conjugate()));
            if patches
                .iter()
                .all(|p| p.image.dot(image).abs() < 1.0 - 1e-9)
            {
                patches.push(Patch { chart, image, turn });
            }
        }
    }
    patches
}

impl RotationGrid {
    /// The nodes of a chart that some query reads, marked by a number other than
    /// [`Chart::ABSENT`].
    fn read_nodes(&self, chart: usize, within: impl Fn(&Chart, [usize; 3]) -> bool) -> Vec<u32> {
        let shape = self.charts[chart].shape;
        let mut rows = vec![Chart::ABSENT; self.charts[chart].len()];
        // The patch that reads this chart as it stands; no patch reads it if another chart has the
        // same images.
        let Some(own) = (0..self.patches.len()).find(|&k| {
            self.patches[k].chart == chart && self.patches[k].turn.w.abs() > 1.0 - 1e-12
        }) else {
            return rows;
        };
        let cells = shape.map(|n| (n - 1).max(1));
        let around = |cell: usize, n: usize| cell.saturating_sub(1)..(cell + 3).min(n);
        for flat in 0..cells.iter().product() {
            let cell = [
                flat / (cells[1] * cells[2]),
                flat / cells[2] % cells[1],
                flat % cells[2],
            ];
            if !within(&self.charts[chart], cell) || !self.this_side_of_seams(own, cell) {
                continue;
            }
            for i in around(cell[0], shape[0]) {
                for j in around(cell[1], shape[1]) {
                    for k in around(cell[2], shape[2]) {
                        rows[(i * shape[1] + j) * shape[2] + k] = 0;
                    }
                }
            }
        }
        rows
    }

    /// True unless all of a cell of patch `own` lies beyond a seam and its blending zone. Samples a
    /// quarter cell from the corners; no point of the cell is further than `slack` from one.
    fn this_side_of_seams(&self, own: usize, cell: [usize; 3]) -> bool {
        if self.patches.len() == 1 {
            return true;
        }
        let chart = &self.charts[self.patches[own].chart];
        let half_step = 0.5 * self.step;
        let slack = 0.25 * 3f64.sqrt() * half_step;
        // A zone of one node to each side of a seam, where both half angles change by the way.
        let beyond = 2.0 * half_step + 2.0 * slack;
        let half_angle = |k, q| self.closeness(k, q).min(1.0).acos();
        (0..8).any(|corner| {
            let offset = DVec3::from_array(std::array::from_fn(|k| {
                if chart.shape[k] == 1 {
                    0.0
                } else {
                    0.25 + 0.5 * f64::from(corner >> k & 1)
                }
            }));
            let x = chart.coordinates(cell) + offset * half_step;
            let q = chart.rotation(x);
            let own_angle = half_angle(own, q);
            let nearest = (0..self.patches.len())
                .map(|k| half_angle(k, q))
                .fold(f64::INFINITY, f64::min);
            own_angle - nearest <= beyond
        })
    }
}
