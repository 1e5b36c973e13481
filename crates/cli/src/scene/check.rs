//! From the scene as written to the scene as used: ranges, defaults, metres and radians.

use std::path::{Path, PathBuf};

use fft_correlate::{Pose, RotationDomain, ScoreModel};
use glam::{DQuat, DVec3};
use haptic::HapticConfig;
use sdf_grid::Sampling;
use toml::Spanned;

use super::raw::{
    Preset, RawEnergy, RawFit, RawLattice, RawModel, RawPart, RawSampling, RawScene, RawWindow,
};
use super::{
    EnergyScale, FitChoice, LatticeChoice, LatticeStep, Part, Scene, Source, WindowChoice,
};
use crate::error::CommandError;

/// Force that a scene without an energy scale peaks at, newtons: what a desktop device renders.
const DEFAULT_PEAK_FORCE: f64 = 5.0;

/// Relative L2 error of a field unless the scene asks for another.
const DEFAULT_TOLERANCE: f64 = 1e-3;

/// Rotations of a scene that names none: a ball about the mesh's own orientation.
const DEFAULT_ROTATIONS: RotationDomain = RotationDomain::Ball {
    center: [0.0, 0.0, 0.0, 1.0],
    angle_deg: 20.0,
    step_deg: 5.0,
};

/// How far a quaternion may be from unit length and still be taken as a rotation.
pub(crate) const QUATERNION_SLACK: f64 = 1e-3;

pub(super) fn scene(raw: RawScene, source: &Source<'_>) -> Result<Scene, CommandError> {
    let folder = source.path.parent().unwrap_or(Path::new("")).to_owned();
    let metres = raw.unit.in_metres();
    Ok(Scene {
        path: source.path.to_owned(),
        unit: raw.unit,
        fixed: part(&raw.fixed, "fixed", &folder, metres, source)?,
        moving: part(&raw.moving, "moving", &folder, metres, source)?,
        model: model(&raw.model, source)?,
        energy: energy(&raw.energy, source)?,
        lattice: lattice(&raw.lattice, metres, source)?,
        window: window(&raw.window, metres, source)?,
        rotations: raw.rotations.unwrap_or(DEFAULT_ROTATIONS),
        fit: fit(&raw.fit, metres, source)?,
        device: device(raw.device, source)?,
        cache: folder.join(raw.cache.as_deref().unwrap_or(".pegfit-cache")),
    })
}

fn part(
    raw: &Spanned<RawPart>,
    role: &str,
    folder: &Path,
    metres: f64,
    source: &Source<'_>,
) -> Result<Part, CommandError> {
    let table = raw.get_ref();
    if table.mesh.is_empty() {
        return Err(source.error(
            raw.span(),
            format!("{role}: expected a mesh path, found an empty string"),
        ));
    }
    let mesh: PathBuf = folder.join(&table.mesh);
    let stem = mesh.file_stem().map(|s| s.to_string_lossy().into_owned());
    Ok(Part {
        name: table.name.clone().or(stem).unwrap_or(role.to_owned()),
        mesh,
        pose: pose(&table.position, &table.rotation, metres, source)?,
    })
}

fn pose(
    position: &Option<Spanned<[f64; 3]>>,
    rotation: &Option<Spanned<[f64; 4]>>,
    metres: f64,
    source: &Source<'_>,
) -> Result<Pose, CommandError> {
    let translation = match position {
        Some(p) => finite(p, "position", source)? * metres,
        None => DVec3::ZERO,
    };
    let rotation = match rotation {
        Some(q) => quaternion(*q.get_ref())
            .map_err(|found| source.error(q.span(), not_a_rotation("rotation", &found)))?,
        None => DQuat::IDENTITY,
    };
    Ok(Pose::new(rotation, translation))
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

fn positive(value: &Spanned<f64>, name: &str, source: &Source<'_>) -> Result<f64, CommandError> {
    let v = *value.get_ref();
    if v.is_finite() && v > 0.0 {
        Ok(v)
    } else {
        Err(source.error(
            value.span(),
            format!("{name}: expected a positive number, found {v}"),
        ))
    }
}

fn finite(
    value: &Spanned<[f64; 3]>,
    name: &str,
    source: &Source<'_>,
) -> Result<DVec3, CommandError> {
    let v = DVec3::from_array(*value.get_ref());
    if v.is_finite() {
        Ok(v)
    } else {
        Err(source.error(
            value.span(),
            format!("{name}: expected finite numbers, found {v}"),
        ))
    }
}

/// A rotation from `x, y, z, w`, normalized if nearly of unit length.
///
/// # Errors
/// The length found, as text, if it is further than [`QUATERNION_SLACK`] from 1.
pub(crate) fn quaternion(xyzw: [f64; 4]) -> Result<DQuat, String> {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    if length.is_finite() && (length - 1.0).abs() <= QUATERNION_SLACK {
        Ok(q.normalize())
    } else {
        Err(format!("length {length}"))
    }
}

fn not_a_rotation(name: &str, found: &str) -> String {
    format!(
        "{name}: expected a unit quaternion x, y, z, w (within {QUATERNION_SLACK}), found {found}"
    )
}
