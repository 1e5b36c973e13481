//! The energy and its slope along one translation or rotation through the fit (figure 6).

use fft_correlate::{DirectOptions, EnergySource, Pose, Response};
use glam::{DQuat, DVec3};
use pegfit_pictures::{AXES, LineChart, PictureError, Series};
use rayon::prelude::*;

use crate::error::CommandError;
use crate::scene::Assembly;

/// Poses on a curve.
const SAMPLES: usize = 241;

/// One degree of freedom through the assembled pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::commands) enum Motion {
    /// Along an axis of the fixed part, as the window lies.
    Translation(usize),
    /// About such an axis through the pivot.
    Rotation(usize),
}

impl Motion {
    /// Reads `x`, `y`, `z`, `rx`, `ry` or `rz`; x if there is none.
    pub(super) fn parse(text: Option<&str>) -> Result<Self, CommandError> {
        let Some(text) = text else {
            return Ok(Self::Translation(0));
        };
        let axis = |name: &str| AXES.iter().position(|a| *a == name);
        match (axis(text), text.strip_prefix('r').and_then(axis)) {
            (Some(a), _) => Ok(Self::Translation(a)),
            (None, Some(a)) => Ok(Self::Rotation(a)),
            _ => Err(CommandError::option(
                "--along",
                "x, y, z, rx, ry or rz",
                text,
            )),
        }
    }

    /// The assembled pose moved by `amount` metres or radians.
    fn apply(self, assembly: &Assembly, amount: f64) -> Pose {
        let assembled = assembly.setup.assembled;
        let middle = assembly.pair.displacement(&assembled);
        match self {
            Self::Translation(axis) => Pose {
                translation: assembled.translation + amount * DVec3::AXES[axis],
                ..assembled
            },
            Self::Rotation(axis) => {
                let turn = DQuat::from_axis_angle(DVec3::AXES[axis], amount);
                assembly
                    .pair
                    .pose((turn * assembled.rotation).normalize(), middle)
            }
        }
    }

    /// Minus the slope of the energy along the motion: a force, or a torque about the pivot.
    fn load(self, assembly: &Assembly, pose: &Pose, response: &Response) -> f64 {
        match self {
            Self::Translation(axis) => response.wrench.force[axis],
            Self::Rotation(axis) => {
                let arm = pose.rotation * assembly.pair.pivot();
                response.wrench.about(arm).torque[axis]
            }
        }
    }
}

/// Energy above, force or torque below.
pub(in crate::commands) fn curve(
    assembly: &Assembly,
    motion: Motion,
) -> Result<Vec<u8>, CommandError> {
    let source = assembly.direct(&DirectOptions::FULL)?;
    let reach = match motion {
        Motion::Translation(axis) => assembly.setup.reach()[axis],
        Motion::Rotation(_) => std::f64::consts::PI,
    };
    let rows: Vec<(f64, Response, f64)> = pegfit_pictures::samples([-reach, reach], SAMPLES)
        .into_par_iter()
        .map_init(
            || source.scratch(),
            |scratch, amount| {
                let pose = motion.apply(assembly, amount);
                let response = source.evaluate(&pose, scratch);
                (amount, response, motion.load(assembly, &pose, &response))
            },
        )
        .collect();
    Ok(draw(assembly, motion, &rows)?)
}

fn draw(
    assembly: &Assembly,
    motion: Motion,
    rows: &[(f64, Response, f64)],
) -> Result<Vec<u8>, PictureError> {
    let unit = assembly.display_unit();
    let (name, scale, horizontal, load) = match motion {
        Motion::Translation(a) => (
            format!("along {}", AXES[a]),
            1.0 / unit.in_metres(),
            format!("displacement along {} ({unit})", AXES[a]),
            format!("force along {} (N)", AXES[a]),
        ),
        Motion::Rotation(a) => (
            format!("about {}", AXES[a]),
            180.0 / std::f64::consts::PI,
            format!("turn about {} (degrees)", AXES[a]),
            format!("torque about {} (N·m)", AXES[a]),
        ),
    };
    // So that ripples look small: the energy's axis spans at least half of its size, the slope's
    // at least what takes it to nothing within half the range.
    let size = rows.iter().map(|r| r.1.energy.abs()).fold(0.0, f64::max);
    let reach = rows.last().map_or(1.0, |r| r.0);
    let chart = |title: String,
                 vertical: &str,
                 least_span: f64,
                 value: &dyn Fn(&(f64, Response, f64)) -> f64| LineChart {
        least_span,
        title,
        horizontal: horizontal.clone(),
        vertical: vertical.to_owned(),
        series: vec![Series {
            points: rows.iter().map(|r| (scale * r.0, value(r))).collect(),
            ..Series::default()
        }],
        ..LineChart::default()
    };
    let energy = chart(
        format!("Energy of {} {name}", assembly.scene.moving.name),
        "energy (mJ)",
        1e3 * 0.5 * size,
        &|r| 1e3 * r.1.energy,
    );
    let slope = chart(String::new(), &load, 2.0 * size / reach, &|r| r.2);
    pegfit_pictures::png("energy curve", (1200, 1100), |sheet| {
        let (top, bottom) = sheet.split_vertically(sheet.dim_in_pixel().1 / 2);
        energy.draw(&top)?;
        slope.draw(&bottom)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_have_names() {
        assert_eq!(Motion::parse(Some("y")).unwrap(), Motion::Translation(1));
        assert_eq!(Motion::parse(Some("rz")).unwrap(), Motion::Rotation(2));
        for bad in ["", "r", "rr", "xy", "w"] {
            assert!(Motion::parse(Some(bad)).is_err(), "{bad}");
        }
    }
}
