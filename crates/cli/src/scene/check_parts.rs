//! The parts of a scene: which meshes, where, under which name.

use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use sdf_grid::mesh_io::StepOptions;
use toml::Spanned;

use super::raw::{RawFixed, RawMesh, RawPart, RawSolid};
use super::source::Source;
use super::types::{Part, PlacedMesh};
use super::values::pose;
use crate::error::CommandError;

/// The first fixed part and the others.
pub(super) fn fixed(
    raw: &Spanned<RawFixed>,
    folder: &Path,
    metres: f64,
    source: &Source<'_>,
) -> Result<(Part, Vec<Part>), CommandError> {
    let list = &raw.get_ref().0;
    let mut parts = Vec::new();
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
        let part = part(item.get_ref(), span.clone(), &role, folder, metres, source)?;
        if parts.iter().any(|p: &Part| p.name == part.name) {
            return Err(source.error(
                span,
                format!(
                    "{role}: expected a name of its own, found `{}` again",
                    part.name
                ),
            ));
        }
        parts.push(part);
    }
    let mut parts = parts.into_iter();
    match parts.next() {
        Some(first) => Ok((first, parts.collect())),
        None => Err(source.error(raw.span(), "fixed: expected at least one part, found none")),
    }
}

pub(super) fn moving(
    raw: &Spanned<RawPart>,
    folder: &Path,
    metres: f64,
    source: &Source<'_>,
) -> Result<Part, CommandError> {
    let moving = part(raw.get_ref(), raw.span(), "moving", folder, metres, source)?;
    match &raw.get_ref().table {
        Some(table) => Err(source.error(
            table.span(),
            "moving: expected `table` with a fixed part, found it here",
        )),
        None => Ok(moving),
    }
}

fn part(
    raw: &RawPart,
    span: std::ops::Range<usize>,
    role: &str,
    folder: &Path,
    metres: f64,
    source: &Source<'_>,
) -> Result<Part, CommandError> {
    let mut meshes = meshes(raw, &span, role, folder, metres, source)?;
    let Some(first) = meshes.first() else {
        return Err(source.error(
            span,
            format!("{role}: expected at least one mesh, found none"),
        ));
    };
    let stem = first
        .path
        .file_stem()
        .map(|s| s.to_string_lossy().into_owned());
    let name = raw
        .name
        .clone()
        .or(first.solid.clone())
        .or(stem)
        .unwrap_or(role.to_owned());
    let mut placed = pose(&raw.position, &raw.rotation, metres, source)?;
    // A shape is what is read: where its only mesh lies is where the shape is put.
    if let [only] = &mut meshes[..]
        && only.pose != Pose::IDENTITY
    {
        placed = placed * std::mem::take(&mut only.pose);
    }
    Ok(Part {
        name,
        pose: placed,
        table: raw.table.as_ref().map(|t| folder.join(t.get_ref())),
        meshes,
    })
}

/// The mesh files of a part.
fn meshes(
    raw: &RawPart,
    span: &std::ops::Range<usize>,
    role: &str,
    folder: &Path,
    metres: f64,
    source: &Source<'_>,
) -> Result<Vec<PlacedMesh>, CommandError> {
    match (&raw.mesh, &raw.meshes) {
        (None, Some(meshes)) if raw.solid.is_some() || raw.segments_per_turn.is_some() => {
            Err(source.error(
                meshes.span(),
                format!("{role}: expected `solid` and `segments_per_turn` in each of the meshes"),
            ))
        }
        (Some(_), Some(meshes)) => Err(source.error(
            meshes.span(),
            format!("{role}: expected mesh or meshes, found both"),
        )),
        (None, None) => Err(source.error(span.clone(), format!("{role}: missing field `mesh`"))),
        (Some(mesh), None) => Ok(vec![PlacedMesh {
            path: path(mesh, span, role, folder, source)?,
            solid: raw.solid.as_ref().map(RawSolid::to_text),
            segments_per_turn: segments(&raw.segments_per_turn, source)?,
            pose: Pose::IDENTITY,
        }]),
        (None, Some(list)) => {
            let place = |m: &RawMesh| {
                Ok(PlacedMesh {
                    path: path(&m.mesh, &list.span(), role, folder, source)?,
                    solid: m.solid.as_ref().map(RawSolid::to_text),
                    segments_per_turn: segments(&m.segments_per_turn, source)?,
                    pose: pose(&m.position, &m.rotation, metres, source)?,
                })
            };
            list.get_ref().iter().map(place).collect()
        }
    }
}

/// Edges around a full turn that a converter of STEP files makes.
fn segments(raw: &Option<Spanned<u32>>, source: &Source<'_>) -> Result<u32, CommandError> {
    let Some(value) = raw else {
        return Ok(StepOptions::default().segments_per_turn);
    };
    let count = *value.get_ref();
    if (6..=1000).contains(&count) {
        return Ok(count);
    }
    let message = format!("segments_per_turn: expected 6 to 1000, found {count}");
    Err(source.error(value.span(), message))
}

fn path(
    file: &str,
    span: &std::ops::Range<usize>,
    role: &str,
    folder: &Path,
    source: &Source<'_>,
) -> Result<PathBuf, CommandError> {
    match file.is_empty() {
        false => Ok(folder.join(file)),
        true => Err(source.error(
            span.clone(),
            format!("{role}: expected a mesh path, found an empty string"),
        )),
    }
}
