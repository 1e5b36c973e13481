//! Which nodes a rotation domain needs.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use glam::{DQuat, DVec3};

use crate::rotations::atlas::{Atlas, Cover, MARGIN, Patch};
use crate::rotations::chart::{Chart, Projection};
use crate::rotations::domain::{RotationError, check_range, direction, quaternion};
use crate::rotations::symmetry::Symmetry;

/// The largest number of nodes a chart may have, before any are left out: those take 370 MB.
pub(super) const MAX_NODES: u64 = 1 << 23;

pub(super) fn step(name: &'static str, degrees: f64) -> Result<f64, RotationError> {
    check_range(
        name,
        "0 < step <= 30 degrees",
        degrees,
        degrees > 0.0 && degrees <= 30.0,
    )
    .map(f64::to_radians)
}

fn check_size(found: f64) -> Result<(), RotationError> {
    let limit = MAX_NODES;
    if found <= limit as f64 {
        Ok(())
    } else {
        Err(RotationError::Size { found, limit })
    }
}

pub(super) fn list(rotations: &[[f64; 4]], margin_deg: f64) -> Result<Atlas, RotationError> {
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
    Ok(Atlas {
        nodes,
        places: Vec::new(),
        charts: vec![chart],
        patches: Vec::new(),
        symmetry: None,
        cover: Cover::List { margin },
        step: margin,
        fade: margin,
    })
}

pub(super) fn spin(
    center: [f64; 4],
    axis: [f64; 3],
    range_deg: Option<[f64; 2]>,
    step_deg: f64,
) -> Result<Atlas, RotationError> {
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
    Ok(Atlas {
        nodes: (0..chart.len()).map(|k| chart.node([0, 0, k])).collect(),
        places: (0..chart.len() as u32).map(|k| [0, k]).collect(),
        patches: vec![Patch {
            chart: 0,
            image: chart.center,
            turn: DQuat::IDENTITY,
        }],
        charts: vec![chart],
        symmetry: None,
        cover: Cover::Spin { margin: MARGIN },
        step: 2.0 * spacing,
        fade: MARGIN * 2.0 * spacing,
    })
}

/// The largest ball that is one chart, radians: beyond it the chart's nodes crowd.
const ONE_CHART: f64 = 2.0 * PI / 3.0;

pub(super) fn ball(
    center: [f64; 4],
    angle_deg: f64,
    step_deg: f64,
    symmetry: Option<Symmetry>,
) -> Result<Atlas, RotationError> {
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
    // Where the ball meets its images, the image further from a query is read too, within the
    // seam's blending zone: there it must be covered as well.
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

pub(super) fn full(
    center: DQuat,
    step: f64,
    symmetry: Option<Symmetry>,
) -> Result<Atlas, RotationError> {
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
) -> Atlas {
    let mut atlas = Atlas {
        nodes: Vec::new(),
        places: Vec::new(),
        patches: patches(&charts, symmetry.as_ref()),
        charts,
        symmetry,
        cover,
        step,
        fade: MARGIN * step,
    };
    for c in 0..atlas.charts.len() {
        let mut rows = read_nodes(&atlas, c, &within);
        for (flat, row) in rows.iter_mut().enumerate() {
            if *row != Chart::ABSENT {
                *row = atlas.nodes.len() as u32;
                atlas.places.push([c as u32, flat as u32]);
                atlas
                    .nodes
                    .push(atlas.charts[c].node(atlas.charts[c].unravel(flat)));
            }
        }
        atlas.charts[c].rows = rows;
    }
    atlas
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

/// The nodes of a chart that some query reads, marked by a number other than
/// [`Chart::ABSENT`].
fn read_nodes(
    atlas: &Atlas,
    chart: usize,
    within: impl Fn(&Chart, [usize; 3]) -> bool,
) -> Vec<u32> {
    let shape = atlas.charts[chart].shape;
    let mut rows = vec![Chart::ABSENT; atlas.charts[chart].len()];
    // The patch that reads this chart as it stands; no patch reads it if another chart has the
    // same images.
    let Some(own) = (0..atlas.patches.len())
        .find(|&k| atlas.patches[k].chart == chart && atlas.patches[k].turn.w.abs() > 1.0 - 1e-12)
    else {
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
        if !within(&atlas.charts[chart], cell) || !this_side_of_seams(atlas, own, cell) {
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
fn this_side_of_seams(atlas: &Atlas, own: usize, cell: [usize; 3]) -> bool {
    if atlas.patches.len() == 1 {
        return true;
    }
    let chart = &atlas.charts[atlas.patches[own].chart];
    let half_step = 0.5 * atlas.step;
    let slack = 0.25 * 3f64.sqrt() * half_step;
    // A zone of one node to each side of a seam, where both half angles change by the way.
    let beyond = 2.0 * half_step + 2.0 * slack;
    let half_angle = |k, q| atlas.closeness(k, q).min(1.0).acos();
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
        let nearest = (0..atlas.patches.len())
            .map(|k| half_angle(k, q))
            .fold(f64::INFINITY, f64::min);
        own_angle - nearest <= beyond
    })
}
