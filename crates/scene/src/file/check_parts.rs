//! The parts of a scene: which meshes, where, under which name.

use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

use fft_correlate::Pose;
use sdf_grid::mesh_io::StepOptions;
use toml::Spanned;

use crate::error::SceneError;
use crate::file::raw::{OrPath, RawFixed, RawMesh, RawPart, RawSolid};
use crate::file::values::Values;
use crate::scene::{Part, PlacedMesh};

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
            (None, None) => Err(self.error(self.span.clone(), "missing field `mesh`")),
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
