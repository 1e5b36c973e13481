//! From the scene as written to the scene as used: ranges, defaults, metres and radians.

use std::path::Path;
use std::time::Duration;

use fft_correlate::{EnergyScale, LatticeStep, RotationDomain, ScoreModel};
use glam::DVec3;
use haptic::HapticConfig;
use sdf_grid::Sampling;
use toml::Spanned;

use super::check_parts::{fixed, moving};
use super::raw::{
    Preset, RawEnergy, RawFit, RawLattice, RawLoading, RawModel, RawSampling, RawScene, RawWindow,
};
use super::source::Source;
use super::types::{FitChoice, LatticeChoice, Loading, Scene, WindowChoice};
use super::values::{finite, natural, pose, positive};
use crate::error::CommandError;

/// Force that a scene without an energy scale peaks at, newtons: what a desktop device renders.
const DEFAULT_PEAK_FORCE: f64 = 5.0;

/// Relative L2 error of a field unless the scene asks for another.
const DEFAULT_TOLERANCE: f64 = 1e-3;

/// Degrees to which rotations of a table are loaded ahead: a hand that turns by 5 rad/s, as fast as
/// hands do, takes 35 ms for it, in which the loader looks, reads and shows what it has read.
const DEFAULT_TURN_AHEAD: f64 = 10.0;

/// Seconds between two looks at a scene's files unless it asks for another.
const DEFAULT_WATCH: f64 = 0.5;

/// Rotations of a scene that names none: a ball about the mesh's own orientation.
const DEFAULT_ROTATIONS: RotationDomain = RotationDomain::Ball {
    center: [0.0, 0.0, 0.0, 1.0],
    angle_deg: 20.0,
    step_deg: 5.0,
};

pub(super) fn scene(raw: RawScene, source: &Source<'_>) -> Result<Scene, CommandError> {
    let folder = source.path.parent().unwrap_or(Path::new("")).to_owned();
    let metres = raw.unit.in_metres();
    let (fixed, others) = fixed(&raw.fixed, &folder, metres, source)?;
    Ok(Scene {
        path: source.path.to_owned(),
        unit: raw.unit,
        fixed,
        others,
        moving: moving(&raw.moving, &folder, metres, source)?,
        model: model(&raw.model, source)?,
        energy: energy(&raw.energy, source)?,
        lattice: lattice(&raw.lattice, metres, source)?,
        window: window(&raw.window, metres, source)?,
        rotations_given: raw.rotations.is_some(),
        rotations: raw.rotations.unwrap_or(DEFAULT_ROTATIONS),
        fit: fit(&raw.fit, metres, source)?,
        device: device(raw.device, source)?,
        loading: loading(&raw.loading, metres, source)?,
        cache: folder.join(raw.cache.as_deref().unwrap_or(".pegfit-cache")),
    })
}

fn loading(raw: &RawLoading, metres: f64, source: &Source<'_>) -> Result<Loading, CommandError> {
    let memory = match &raw.memory_mib {
        // More than a double counts exactly is as good as no limit.
        Some(m) => Some((positive(m, "memory_mib", source)? * f64::from(1 << 20)) as u64),
        None => None,
    };
    let ahead = match &raw.ahead {
        Some(a) => Some(natural(a, "ahead", source)? * metres),
        None => None,
    };
    let watch = match &raw.watch_s {
        Some(w) => positive(w, "watch_s", source)?.clamp(0.01, 3600.0),
        None => DEFAULT_WATCH,
    };
    let turn_ahead = match &raw.turn_ahead_deg {
        Some(a) => natural(a, "turn_ahead_deg", source)?
            .min(360.0)
            .to_radians(),
        None => DEFAULT_TURN_AHEAD.to_radians(),
    };
    Ok(Loading {
        memory,
        ahead,
        turn_ahead,
        watch: Duration::from_secs_f64(watch),
    })
}

fn fit(raw: &RawFit, metres: f64, source: &Source<'_>) -> Result<FitChoice, CommandError> {
    let axis = match &raw.axis {
        None => None,
        Some(a) => Some(
            finite(a, "axis", source)?
                .try_normalize()
                .ok_or_else(|| source.error(a.span(), "axis: expected a direction, found zero"))?,
        ),
    };
    let depth = match &raw.depth {
        None => None,
        Some(d) => Some(positive(d, "depth", source)? * metres),
    };
    Ok(FitChoice {
        assembled: pose(&raw.position, &raw.rotation, metres, source)?,
        axis,
        depth,
    })
}

fn device(
    raw: Option<Spanned<HapticConfig>>,
    source: &Source<'_>,
) -> Result<HapticConfig, CommandError> {
    let Some(table) = raw else {
        return Ok(HapticConfig::default());
    };
    table
        .get_ref()
        .validate()
        .map_err(|e| source.error(table.span(), format!("device: {e}")))?;
    Ok(table.into_inner())
}

fn model(raw: &RawModel, source: &Source<'_>) -> Result<ScoreModel, CommandError> {
    let mut model = match raw.preset {
        Preset::Paper => ScoreModel::PAPER,
        Preset::Guided => ScoreModel::GUIDED,
    };
    // Each value is validated as it is set, so that an error can show the line it came from.
    let values = [
        (&raw.sigma, 0),
        (&raw.lambda_exterior, 1),
        (&raw.lambda_interior, 2),
        (&raw.separation_weight, 3),
    ];
    for (value, which) in values {
        let Some(value) = value else { continue };
        let place = match which {
            0 => &mut model.sigma,
            1 => &mut model.lambda_exterior,
            2 => &mut model.lambda_interior,
            _ => &mut model.separation_weight,
        };
        *place = *value.get_ref();
        model
            .validate()
            .map_err(|e| source.error(value.span(), e.to_string()))?;
    }
    Ok(model)
}

fn energy(raw: &RawEnergy, source: &Source<'_>) -> Result<EnergyScale, CommandError> {
    match (&raw.gamma, &raw.peak_force) {
        (Some(_), Some(force)) => Err(source.error(
            force.span(),
            "energy: expected gamma or peak_force, found both",
        )),
        (Some(gamma), None) => Ok(EnergyScale::Gamma(positive(gamma, "gamma", source)?)),
        (None, Some(force)) => Ok(EnergyScale::PeakForce(positive(
            force,
            "peak_force",
            source,
        )?)),
        (None, None) => Ok(EnergyScale::PeakForce(DEFAULT_PEAK_FORCE)),
    }
}

fn lattice(
    raw: &RawLattice,
    metres: f64,
    source: &Source<'_>,
) -> Result<LatticeChoice, CommandError> {
    let step = match (&raw.spacing, &raw.points) {
        (Some(_), Some(points)) => {
            return Err(source.error(
                points.span(),
                "lattice: expected spacing or points, found both",
            ));
        }
        (Some(h), None) => LatticeStep::Spacing(positive(h, "spacing", source)? * metres),
        (None, Some(n)) if *n.get_ref() < 4 => {
            return Err(source.error(
                n.span(),
                format!("points: expected at least 4, found {}", n.get_ref()),
            ));
        }
        (None, Some(n)) => LatticeStep::Points(*n.get_ref()),
        (None, None) => LatticeStep::Automatic,
    };
    let halo = match &raw.halo {
        Some(h) => Some(positive(h, "halo", source)? * metres),
        None => None,
    };
    let field_tolerance = match &raw.field_tolerance {
        Some(t) if !(1e-5..=1e-2).contains(t.get_ref()) => {
            return Err(source.error(
                t.span(),
                format!(
                    "field_tolerance: expected 1e-5 to 1e-2, found {}",
                    t.get_ref()
                ),
            ));
        }
        Some(t) => *t.get_ref(),
        None => DEFAULT_TOLERANCE,
    };
    let sampling = match raw.sampling {
        Some(RawSampling::Point) => Sampling::Point,
        Some(RawSampling::CellAverage) | None => Sampling::CellAverage,
    };
    let deaverage = match &raw.deaverage {
        Some(d) if *d.get_ref() && sampling == Sampling::Point => {
            return Err(source.error(
                d.span(),
                "deaverage: expected with sampling = \"cell-average\", found with \"point\"",
            ));
        }
        d => d.as_ref().is_some_and(|d| *d.get_ref()),
    };
    Ok(LatticeChoice {
        step,
        halo,
        field_tolerance,
        sampling,
        deaverage,
    })
}

fn window(raw: &RawWindow, metres: f64, source: &Source<'_>) -> Result<WindowChoice, CommandError> {
    let center = match &raw.center {
        Some(c) => finite(c, "center", source)? * metres,
        None => DVec3::ZERO,
    };
    let half_extent = match &raw.half_extent {
        None => None,
        Some(e) => {
            let v = e.get_ref().to_array();
            if !v.iter().all(|x| x.is_finite() && *x >= 0.0) {
                return Err(source.error(
                    e.span(),
                    format!("half_extent: expected finite numbers >= 0, found {v:?}"),
                ));
            }
            Some(DVec3::from_array(v) * metres)
        }
    };
    Ok(WindowChoice {
        center,
        half_extent,
    })
}
