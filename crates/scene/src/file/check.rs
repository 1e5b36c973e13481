//! From the scene as written to the scene as used: ranges, defaults, metres and radians.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

use fft_correlate::{EnergyScale, LatticeStep, Pose, RotationDomain, ScoreModel};
use glam::DVec3;
use haptic::HapticConfig;
use sdf_grid::mesh_io::StepOptions;
use toml::Spanned;

use crate::error::SceneError;
use crate::file::raw::{
    OrPath, Preset, RawEnergy, RawFit, RawFixed, RawLattice, RawLoading, RawMesh, RawModel,
    RawPart, RawScene, RawSolid, RawWindow,
};
use crate::file::values::{Source, Values};
use crate::scene::{FitChoice, LatticeChoice, Loading, Part, PlacedMesh, Scene, WindowChoice};

/// Force that a scene without an energy scale peaks at, newtons: what a desktop device renders.
const DEFAULT_PEAK_FORCE: f64 = 5.0;

/// Newtons that may be asked for at the steepest place of an energy.
const LEAST_PEAK: f64 = 1e-9;
const GREATEST_PEAK: f64 = 1e9;

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

pub(super) fn scene(raw: RawScene, source: Source<'_>) -> Result<Scene, SceneError> {
    let values = Values {
        source,
        folder: source.path.parent().unwrap_or(Path::new("")).to_owned(),
        metres: raw.unit.in_metres(),
    };
    let (fixed, others) = fixed(&raw.fixed, &values)?;
    Ok(Scene {
        path: source.path.to_owned(),
        unit: raw.unit,
        fixed,
        others,
        moving: moving(&raw.moving, &values)?,
        model: model(&raw.model, &values)?,
        energy: energy(&raw.energy, &values)?,
        lattice: lattice(&raw.lattice, &values)?,
        window: window(&raw.window, &values)?,
        rotations_given: raw.rotations.is_some(),
        rotations: raw.rotations.unwrap_or(DEFAULT_ROTATIONS),
        fit: fit(&raw.fit, &values)?,
        device: device(raw.device, &values)?,
        loading: loading(&raw.loading, &values)?,
        cache: (values.folder).join(raw.cache.as_deref().unwrap_or(".pegfit-cache")),
    })
}

fn loading(raw: &RawLoading, values: &Values<'_>) -> Result<Loading, SceneError> {
    let memory = match &raw.memory_mib {
        // More than a double counts exactly is as good as no limit.
        Some(m) => Some((values.positive(m, "memory_mib")? * f64::from(1 << 20)) as u64),
        None => None,
    };
    let ahead = match &raw.ahead {
        Some(a) => Some(values.natural(a, "ahead")? * values.metres),
        None => None,
    };
    let watch = match &raw.watch_s {
        Some(w) => values.positive(w, "watch_s")?.clamp(0.01, 3600.0),
        None => DEFAULT_WATCH,
    };
    let turn_ahead = match &raw.turn_ahead_deg {
        Some(a) => values.natural(a, "turn_ahead_deg")?.min(360.0),
        None => DEFAULT_TURN_AHEAD,
    };
    Ok(Loading {
        memory,
        ahead,
        turn_ahead: turn_ahead.to_radians(),
        watch: Duration::from_secs_f64(watch),
    })
}

fn fit(raw: &RawFit, values: &Values<'_>) -> Result<FitChoice, SceneError> {
    let axis = match &raw.axis {
        None => None,
        Some(a) => Some(
            (values.finite(a, "axis")?.try_normalize())
                .ok_or_else(|| values.error(a.span(), "axis: expected a direction, found zero"))?,
        ),
    };
    Ok(FitChoice {
        depth: values.length(&raw.depth, "depth")?,
        assembled: values.pose(&raw.position, &raw.rotation)?,
        axis,
    })
}

fn device(
    raw: Option<Spanned<HapticConfig>>,
    values: &Values<'_>,
) -> Result<HapticConfig, SceneError> {
    let Some(table) = raw else {
        return Ok(HapticConfig::default());
    };
    (table.get_ref().validate()).map_err(|e| values.error(table.span(), format!("device: {e}")))?;
    Ok(table.into_inner())
}

/// One of a model's values.
type Value = fn(&mut ScoreModel) -> &mut f64;

fn model(raw: &RawModel, values: &Values<'_>) -> Result<ScoreModel, SceneError> {
    let mut model = match raw.preset {
        Preset::Paper => ScoreModel::PAPER,
        Preset::Guided => ScoreModel::GUIDED,
    };
    let given: [(_, Value); 4] = [
        (&raw.sigma, |m| &mut m.sigma),
        (&raw.lambda_exterior, |m| &mut m.lambda_exterior),
        (&raw.lambda_interior, |m| &mut m.lambda_interior),
        (&raw.separation_weight, |m| &mut m.separation_weight),
    ];
    // Each value is validated as it is set, so that an error can show the line it came from.
    for (value, place) in given {
        let Some(value) = value else { continue };
        *place(&mut model) = *value.get_ref();
        (model.validate()).map_err(|e| values.error(value.span(), e.to_string()))?;
    }
    Ok(model)
}

fn energy(raw: &RawEnergy, values: &Values<'_>) -> Result<EnergyScale, SceneError> {
    match (&raw.gamma, &raw.peak_force) {
        (Some(_), Some(force)) => Err(values.error(
            force.span(),
            "energy: expected gamma or peak_force, found both",
        )),
        (Some(given), None) => {
            let gamma = *given.get_ref();
            let model = ScoreModel {
                gamma,
                ..ScoreModel::default()
            };
            (model.validate()).map_err(|e| values.error(given.span(), e.to_string()))?;
            Ok(EnergyScale::Gamma(gamma))
        }
        (None, Some(given)) => {
            let force = *given.get_ref();
            if !(LEAST_PEAK..=GREATEST_PEAK).contains(&force) {
                let message = format!(
                    "peak_force: expected {LEAST_PEAK:e} to {GREATEST_PEAK:e} N, found {force}"
                );
                return Err(values.error(given.span(), message));
            }
            Ok(EnergyScale::PeakForce(force))
        }
        (None, None) => Ok(EnergyScale::PeakForce(DEFAULT_PEAK_FORCE)),
    }
}

fn lattice(raw: &RawLattice, values: &Values<'_>) -> Result<LatticeChoice, SceneError> {
    let step = step(raw, values)?;
    let halo = values.length(&raw.halo, "halo")?;
    let field_tolerance = match &raw.field_tolerance {
        Some(t) if !(1e-5..=1e-2).contains(t.get_ref()) => {
            let found = t.get_ref();
            let message = format!("field_tolerance: expected 1e-5 to 1e-2, found {found}");
            return Err(values.error(t.span(), message));
        }
        Some(t) => *t.get_ref(),
        None => DEFAULT_TOLERANCE,
    };
    Ok(LatticeChoice {
        step,
        halo,
        field_tolerance,
    })
}

fn step(raw: &RawLattice, values: &Values<'_>) -> Result<LatticeStep, SceneError> {
    match (&raw.spacing, &raw.points) {
        (Some(_), Some(points)) => Err(values.error(
            points.span(),
            "lattice: expected spacing or points, found both",
        )),
        (Some(spacing), None) => {
            let spacing = values.positive(spacing, "spacing")? * values.metres;
            Ok(LatticeStep::Spacing(spacing))
        }
        (None, Some(n)) if *n.get_ref() < 4 => {
            let message = format!("points: expected at least 4, found {}", n.get_ref());
            Err(values.error(n.span(), message))
        }
        (None, Some(n)) => Ok(LatticeStep::Points(*n.get_ref())),
        (None, None) => Ok(LatticeStep::Automatic),
    }
}

fn window(raw: &RawWindow, values: &Values<'_>) -> Result<WindowChoice, SceneError> {
    let center = values.point(&raw.center, "center")?;
    let half_extent = match &raw.half_extent {
        None => None,
        Some(e) => {
            let v = e.get_ref().to_array();
            if !v.iter().all(|x| x.is_finite() && *x >= 0.0) {
                let message = format!("half_extent: expected finite numbers >= 0, found {v:?}");
                return Err(values.error(e.span(), message));
            }
            Some(DVec3::from_array(v) * values.metres)
        }
    };
    Ok(WindowChoice {
        center,
        half_extent,
    })
}

/// The first fixed part and the others.
pub(super) fn fixed(
    raw: &Spanned<RawFixed>,
    values: &Values<'_>,
) -> Result<(Part, Vec<Part>), SceneError> {
    let list = &raw.get_ref().0;
    let mut parts: Vec<Part> = Vec::new();
    for (index, item) in list.iter().enumerate() {
        // A part that is not in a list has the key's own place.
        let span = match item.span() {
            empty if empty.is_empty() => raw.span(),
            place => place,
        };
        let role = match list.len() {
            1 => "fixed".to_owned(),
            _ => format!("fixed part {}", index + 1),
        };
        let part = Written {
            raw: &item.get_ref().0,
            span: span.clone(),
            role: &role,
            values,
        }
        .part()?;
        if parts.iter().any(|p| p.name == part.name) {
            let message = format!(
                "{role}: expected a name of its own, found `{}` again",
                part.name
            );
            return Err(values.error(span, message));
        }
        parts.push(part);
    }
    let mut parts = parts.into_iter();
    match parts.next() {
        Some(first) => Ok((first, parts.collect())),
        None => Err(values.error(raw.span(), "fixed: expected at least one part, found none")),
    }
}

pub(super) fn moving(
    raw: &Spanned<OrPath<RawPart>>,
    values: &Values<'_>,
) -> Result<Part, SceneError> {
    let written = Written {
        raw: &raw.get_ref().0,
        span: raw.span(),
        role: "moving",
        values,
    };
    let moving = written.part()?;
    match &written.raw.table {
        Some(table) => Err(values.error(
            table.span(),
            "moving: expected `table` with a fixed part, found it here",
        )),
        None => Ok(moving),
    }
}

/// A part as written, where, and what messages call it.
struct Written<'a> {
    raw: &'a RawPart,
    span: Range<usize>,
    role: &'a str,
    values: &'a Values<'a>,
}

impl Written<'_> {
    fn part(&self) -> Result<Part, SceneError> {
        let (raw, values) = (self.raw, self.values);
        let mut meshes = self.meshes()?;
        let Some(first) = meshes.first() else {
            return Err(self.error(self.span.clone(), "expected at least one mesh, found none"));
        };
        let stem = first.path.file_stem();
        let name = (raw.name.clone())
            .or(first.solid.clone())
            .or(stem.map(|s| s.to_string_lossy().into_owned()))
            .unwrap_or(self.role.to_owned());
        let mut pose = values.pose(&raw.position, &raw.rotation)?;
        // A shape is what is read: where its only mesh lies is where the shape is put.
        if let [only] = &mut meshes[..]
            && only.pose != Pose::IDENTITY
        {
            pose = pose * std::mem::take(&mut only.pose);
        }
        Ok(Part {
            name,
            pose,
            table: (raw.table.as_ref()).map(|t| values.folder.join(t.get_ref())),
            meshes,
        })
    }

    /// The mesh files of the part.
    fn meshes(&self) -> Result<Vec<PlacedMesh>, SceneError> {
        let raw = self.raw;
        match (&raw.mesh, &raw.meshes) {
            (None, Some(meshes))
                if raw.solid.is_some()
                    || raw.segments_per_turn.is_some()
                    || raw.step_time_limit.is_some()
                    || raw.lossy.is_some() =>
            {
                Err(self.error(
                    meshes.span(),
                    "expected `solid`, `segments_per_turn`, `step_time_limit` and `lossy` in each \
                     of the meshes",
                ))
            }
            (Some(_), Some(meshes)) => {
                Err(self.error(meshes.span(), "expected mesh or meshes, found both"))
            }
            (None, None) => Err(self.error(self.span.clone(), "missing key `mesh`")),
            (Some(mesh), None) => Ok(vec![PlacedMesh {
                path: self.path(mesh, &self.span)?,
                solid: raw.solid.as_ref().map(RawSolid::to_text),
                segments_per_turn: self.segments(&raw.segments_per_turn)?,
                step_time_limit: self.time_limit(&raw.step_time_limit)?,
                lossy: raw.lossy.unwrap_or(false),
                pose: Pose::IDENTITY,
            }]),
            (None, Some(list)) => {
                let place = |OrPath(m): &OrPath<RawMesh>| {
                    Ok(PlacedMesh {
                        path: self.path(&m.mesh, &list.span())?,
                        solid: m.solid.as_ref().map(RawSolid::to_text),
                        segments_per_turn: self.segments(&m.segments_per_turn)?,
                        step_time_limit: self.time_limit(&m.step_time_limit)?,
                        lossy: m.lossy.unwrap_or(false),
                        pose: self.values.pose(&m.position, &m.rotation)?,
                    })
                };
                list.get_ref().iter().map(place).collect()
            }
        }
    }

    /// Edges around a full turn that a converter of STEP files makes.
    fn segments(&self, raw: &Option<Spanned<u32>>) -> Result<u32, SceneError> {
        let Some(value) = raw else {
            return Ok(StepOptions::default().segments_per_turn);
        };
        let count = *value.get_ref();
        if (6..=1000).contains(&count) {
            return Ok(count);
        }
        let message = format!("segments_per_turn: expected 6 to 1000, found {count}");
        Err(self.values.error(value.span(), message))
    }

    /// Processor time of a converter of STEP files.
    fn time_limit(&self, raw: &Option<Spanned<u32>>) -> Result<Duration, SceneError> {
        let Some(value) = raw else {
            return Ok(StepOptions::default().time_limit);
        };
        let seconds = *value.get_ref();
        if (1..=86400).contains(&seconds) {
            return Ok(Duration::from_secs(seconds.into()));
        }
        let message = format!("step_time_limit: expected 1 to 86400 s, found {seconds}");
        Err(self.values.error(value.span(), message))
    }

    fn path(&self, file: &str, span: &Range<usize>) -> Result<PathBuf, SceneError> {
        match file.is_empty() {
            false => Ok(self.values.folder.join(file)),
            true => Err(self.error(span.clone(), "expected a mesh path, found an empty string")),
        }
    }

    fn error(&self, span: Range<usize>, message: &str) -> SceneError {
        self.values.error(span, format!("{}: {message}", self.role))
    }
}
