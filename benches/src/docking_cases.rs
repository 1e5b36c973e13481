//! Pairs of parts of which docking is asked where they belong, with their right places.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use fft_correlate::Pose;
use fft_correlate::mating::Joint;
use glam::{DMat3, DQuat, DVec3};
use pegfit_fixtures::{Freedom, JOINT_COUNT, Motion, RightPlaces, joint, joint_names};
use sdf_grid::{LengthUnit, RepairOptions, TriangleMesh, mesh_io};
use serde_json::Value;

use crate::Outcome;
use crate::assemblies::Assembly;

/// Step between the right places of a part that slides, diagonals of its box.
const SLIDE_STEP: f64 = 0.01;

/// Two parts, and where the moving one belongs.
#[derive(Debug)]
pub struct Case {
    /// What it is one of.
    pub set: &'static str,
    /// What it is called.
    pub name: String,
    /// What it is counted with.
    pub group: String,
    /// Fixed and moving part.
    pub parts: [Arc<TriangleMesh>; 2],
    /// Where the moving part belongs, as motions of it as it lies.
    pub right: RightPlaces,
    /// The joint there, as the pair lies, if it is known.
    pub joint: Option<Freedom>,
    /// The pair whose fit is measured in millimetres and degrees.
    pub assembly: Option<Assembly>,
}

impl Case {
    /// A pair whose assembled pose is the identity.
    pub fn assembled(set: &'static str, pair: Assembly) -> Self {
        let step = SLIDE_STEP * pair.moving.bounds().diagonal();
        let [low, high] = pair.slide;
        let steps = ((high - low) / step).ceil() as usize;
        let along = |k: usize| low + (high - low) * k as f64 / steps.max(1) as f64;
        let places: Vec<Motion> = (0..=steps)
            .map(|k| (DQuat::IDENTITY, along(k) * DVec3::Z))
            .collect();
        Self {
            set,
            name: pair.name.clone(),
            group: pair.name.clone(),
            parts: [pair.fixed.clone(), pair.moving.clone()],
            right: RightPlaces::new(&pair.moving, &places),
            joint: None,
            assembly: Some(pair),
        }
    }
}

/// Joints of `pegfit_fixtures` whose names contain a text, one of `every` so many, with the sizes of
/// these seeds.
///
/// # Errors
/// If one cannot be made.
pub fn generated_joints(seeds: Range<u64>, only: &str, every: usize) -> Outcome<Vec<Case>> {
    let wanted: Vec<usize> = (joint_names().enumerate().step_by(every))
        .filter(|(_, name)| name.contains(only))
        .map(|(index, _)| index)
        .collect();
    debug_assert!(wanted.len() <= JOINT_COUNT);
    let case = |(seed, index): (u64, usize)| -> Outcome<Case> {
        let pair = joint(seed, index)?;
        Ok(Case {
            set: "joints",
            name: format!("{} {seed}", pair.name),
            group: pair.kind.name().into(),
            right: RightPlaces::new(&pair.moving, &pair.right),
            parts: [pair.fixed, pair.moving].map(Arc::new),
            joint: pair.joint,
            assembly: None,
        })
    };
    let all = seeds.flat_map(|seed| wanted.iter().map(move |index| (seed, *index)));
    all.map(case).collect()
}

/// Pairs in the folders of a folder, or in itself, whose names contain a text: `fixed.obj`,
/// `moving.obj` and `pair.json`, as `docs/docking.md` describes.
///
/// # Errors
/// If there are none, or a file cannot be read or says something else.
pub fn folder(folder: &Path, only: &str) -> Outcome<Vec<Case>> {
    let mut folders: Vec<PathBuf> = Vec::new();
    if folder.join("pair.json").is_file() {
        folders.push(folder.into());
    }
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.join("pair.json").is_file() {
            folders.push(path);
        }
    }
    if folders.is_empty() {
        return Err(format!("{}: no folder with a pair.json", folder.display()).into());
    }
    folders.sort();
    let named = folders.iter().map(|path| {
        let name = path.file_name().unwrap_or(path.as_os_str());
        (path, name.to_string_lossy().into_owned())
    });
    let named = named.filter(|(_, name)| name.contains(only));
    named.map(|(path, name)| described(path, name)).collect()
}

/// The pair of a folder.
fn described(folder: &Path, name: String) -> Outcome<Case> {
    let file = folder.join("pair.json");
    let wrong = |what: &str| format!("{}: {what}", file.display());
    let pair: Value = serde_json::from_slice(&std::fs::read(&file)?)
        .map_err(|error| wrong(&error.to_string()))?;
    let unit = pair["unit"].as_str().ok_or_else(|| wrong("no unit"))?;
    let unit: LengthUnit = unit.parse()?;
    let right = pair["right"]
        .as_array()
        .ok_or_else(|| wrong("no right places"))?;
    let place = |m: &Value| motion(m, unit.in_metres());
    let right: Option<Vec<Motion>> = right.iter().map(place).collect();
    let right = right.ok_or_else(|| wrong("a right place is no matrix of 4 rows"))?;
    let read = |part: &str| -> Outcome<Arc<TriangleMesh>> {
        let path = folder.join(format!("{part}.obj"));
        let options = RepairOptions::default();
        Ok(Arc::new(mesh_io::read(path, unit, &options)?.0))
    };
    let parts = [read("fixed")?, read("moving")?];
    Ok(Case {
        set: "folder",
        group: pair["kind"].as_str().unwrap_or(&name).to_owned(),
        name,
        right: RightPlaces::new(&parts[1], &right),
        parts,
        joint: None,
        assembly: None,
    })
}

/// A matrix by rows as a motion; lengths times a factor.
fn motion(matrix: &Value, factor: f64) -> Option<Motion> {
    let row = |i: usize| -> Option<[f64; 4]> {
        Some([
            matrix[i][0].as_f64()?,
            matrix[i][1].as_f64()?,
            matrix[i][2].as_f64()?,
            matrix[i][3].as_f64()?,
        ])
    };
    let [a, b, c] = [row(0)?, row(1)?, row(2)?];
    let turn = |r: [f64; 4]| DVec3::new(r[0], r[1], r[2]);
    let turn = DMat3::from_cols(turn(a), turn(b), turn(c)).transpose();
    let rotation = DQuat::from_mat3(&turn).normalize();
    Some((rotation, factor * DVec3::new(a[3], b[3], c[3])))
}

/// How far the axis (or centre) of a joint is from that of a freedom which a motion carries to where
/// the joint is: radians, metres.
pub fn axis_error(freedom: &Freedom, to: &Pose, joint: &Joint) -> (f64, f64) {
    let angle = freedom.axis().map_or(0.0, |axis| {
        let cosine = (to.rotation * axis).dot(joint.axis).abs();
        cosine.min(1.0).acos()
    });
    let distance = freedom.point().map_or(0.0, |point| {
        let away = to.apply(point) - joint.point;
        let along = freedom.axis().map_or(0.0, |a| away.dot(to.rotation * a));
        (away.length_squared() - along * along).max(0.0).sqrt()
    });
    (angle, distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_holds_a_pair_in_its_unit() {
        let folder_of_pairs = std::env::temp_dir().join(format!("pairs-{}", std::process::id()));
        let place = folder_of_pairs.join("peg");
        std::fs::create_dir_all(&place).unwrap();
        let part = sdf_grid::shapes::cuboid(DVec3::new(3.0, 2.0, 1.0)).unwrap();
        for name in ["fixed.obj", "moving.obj"] {
            mesh_io::write_obj(place.join(name), &part).unwrap();
        }
        let text = r#"{"unit": "mm", "kind": "peg",
            "right": [[[0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]]}"#;
        std::fs::write(place.join("pair.json"), text).unwrap();
        let cases = folder(&folder_of_pairs, "eg").unwrap();
        assert_eq!(cases[0].group, "peg");
        let (turn, shift) = cases[0].right.places()[0];
        assert!((turn * DVec3::X).distance(DVec3::Y) < 1e-12 && shift == 5e-3 * DVec3::X);
        assert!(folder(&folder_of_pairs, "nut").unwrap().is_empty());
        std::fs::remove_dir_all(&folder_of_pairs).unwrap();
    }
}
