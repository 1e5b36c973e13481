//! The energy and its slope along one translation or rotation through the fit (figure 6).

use fft_correlate::DirectOptions;
use glam::DVec3;
use pegfit_pictures::{AXES, LineChart, PictureError, Series};
use pegfit_scene::{Assembly, Motion, ProfilePoint};

use crate::error::CommandError;

/// Poses on a curve.
const SAMPLES: usize = 241;

/// One degree of freedom through the assembled pose, by the number of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::commands) enum Along {
    /// Along an axis of the fixed part, as the window lies.
    Axis(usize),
    /// About such an axis through the pivot.
    About(usize),
}

impl Along {
    /// Reads `x`, `y`, `z`, `rx`, `ry` or `rz`; x if there is none.
    pub(super) fn parse(text: Option<&str>) -> Result<Self, CommandError> {
        let Some(text) = text else {
            return Ok(Self::Axis(0));
        };
        let axis = |name: &str| AXES.iter().position(|a| *a == name);
        match (axis(text), text.strip_prefix('r').and_then(axis)) {
            (Some(a), _) => Ok(Self::Axis(a)),
            (None, Some(a)) => Ok(Self::About(a)),
            _ => Err(CommandError::option(
                "--along",
                "x, y, z, rx, ry or rz",
                text,
            )),
        }
    }
}

/// Energy above, force or torque below.
pub(in crate::commands) fn curve(
    assembly: &Assembly,
    along: Along,
) -> Result<Vec<u8>, CommandError> {
    let source = assembly.direct(&DirectOptions::FULL)?;
    let (motion, reach) = match along {
        Along::Axis(axis) => (
            Motion::Translation(DVec3::AXES[axis]),
            assembly.setup.parts.reach()[axis],
        ),
        Along::About(axis) => (Motion::Rotation(DVec3::AXES[axis]), std::f64::consts::PI),
    };
    let amounts = pegfit_pictures::samples([-reach, reach], SAMPLES);
    let points = assembly.profile(&source, motion, &amounts);
    Ok(draw(assembly, along, &points)?)
}

fn draw(
    assembly: &Assembly,
    along: Along,
    points: &[ProfilePoint],
) -> Result<Vec<u8>, PictureError> {
    let unit = assembly.setup.display_unit();
    let (name, scale, horizontal, load) = match along {
        Along::Axis(a) => (
            format!("along {}", AXES[a]),
            1.0 / unit.in_metres(),
            format!("displacement along {} ({unit})", AXES[a]),
            format!("force along {} (N)", AXES[a]),
        ),
        Along::About(a) => (
            format!("about {}", AXES[a]),
            180.0 / std::f64::consts::PI,
            format!("turn about {} (degrees)", AXES[a]),
            format!("torque about {} (N·m)", AXES[a]),
        ),
    };
    // So that ripples look small: the energy's axis spans at least half of its size, the slope's
    // at least what takes it to nothing within half the range.
    let size = points
        .iter()
        .map(|p| p.response.energy.abs())
        .fold(0.0, f64::max);
    let reach = points.last().map_or(1.0, |p| p.amount);
    let chart = |title: String,
                 vertical: &str,
                 least_span: f64,
                 value: &dyn Fn(&ProfilePoint) -> f64| LineChart {
        least_span,
        title,
        horizontal: horizontal.clone(),
        vertical: vertical.to_owned(),
        series: vec![Series {
            points: points
                .iter()
                .map(|p| (scale * p.amount, value(p)))
                .collect(),
            ..Series::default()
        }],
        ..LineChart::default()
    };
    let energy = chart(
        format!("Energy of {} {name}", assembly.scene().moving.name),
        "energy (mJ)",
        1e3 * 0.5 * size,
        &|p| 1e3 * p.response.energy,
    );
    let slope = chart(String::new(), &load, 2.0 * size / reach, &|p| p.load);
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
        assert_eq!(Along::parse(Some("y")).unwrap(), Along::Axis(1));
        assert_eq!(Along::parse(Some("rz")).unwrap(), Along::About(2));
        for bad in ["", "r", "rr", "xy", "w"] {
            assert!(Along::parse(Some(bad)).is_err(), "{bad}");
        }
    }
}
