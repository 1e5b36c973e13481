//! Mesh files dropped onto the page.

use std::path::Path;

use pegfit_scene::{FitSolids, FitVerdict, MeshVerdict};
use sdf_grid::LengthUnit;
use sdf_grid::mesh_io::{MeshFile, ReadOptions};
#[cfg(target_family = "wasm")]
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use crate::opened::NamedSolid;

/// Mesh files dropped onto the page, each with the verdict of `pegfit check`.
#[cfg_attr(target_family = "wasm", wasm_bindgen)]
#[derive(Debug)]
pub struct Meshes {
    unit: LengthUnit,
    usable: Vec<NamedSolid>,
    lines: Vec<String>,
}

#[cfg(target_family = "wasm")]
#[wasm_bindgen]
impl Meshes {
    /// No files yet; coordinates of those that state no unit are in `unit`.
    ///
    /// # Errors
    /// If there is no such unit.
    #[wasm_bindgen(constructor)]
    pub fn new(unit: &str) -> Result<Self, JsError> {
        Ok(Self::in_unit(unit.parse()?))
    }
}

#[cfg_attr(target_family = "wasm", wasm_bindgen)]
impl Meshes {
    /// Reads and checks a file; false if it cannot be used.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> bool {
        let options = ReadOptions {
            unit: self.unit,
            ..ReadOptions::default()
        };
        let file = MeshFile::from_bytes(name, bytes);
        let (verdict, mesh) = MeshVerdict::of_content(name, file, &options);
        self.lines.extend(verdict.lines(self.unit));
        let stem = Path::new(name).file_stem().unwrap_or_default();
        let name = stem.to_string_lossy().into_owned();
        let solid = mesh.map(|mesh| NamedSolid { name, mesh });
        self.usable.extend(solid);
        verdict.is_usable()
    }

    /// What `pegfit check` says of the files, and of the pair if two can be used.
    pub fn report(&self) -> String {
        let mut lines = self.lines.clone();
        if let Some([fixed, moving]) = self.pair() {
            let solids = FitSolids {
                name: fixed.name,
                fixed: fixed.mesh,
                moving: moving.mesh,
                scale: None,
            };
            lines.extend(FitVerdict::of(&solids, &moving.name, "scene.toml").lines());
        }
        lines.join("\n")
    }

    /// Whether there are two files, and both can be used.
    #[cfg_attr(target_family = "wasm", wasm_bindgen(js_name = isPair))]
    pub fn is_pair(&self) -> bool {
        self.pair().is_some()
    }
}

impl Meshes {
    fn in_unit(unit: LengthUnit) -> Self {
        Self {
            unit,
            usable: Vec::new(),
            lines: Vec::new(),
        }
    }

    /// The unit of files that state none.
    #[cfg(target_family = "wasm")]
    pub(crate) fn unit(&self) -> LengthUnit {
        self.unit
    }

    /// The part that stays, the larger one, and the part that moves.
    pub(crate) fn pair(&self) -> Option<[NamedSolid; 2]> {
        let [a, b] = &self.usable[..] else {
            return None;
        };
        let size = |solid: &NamedSolid| solid.mesh.bounds().diagonal();
        Some(match size(a) < size(b) {
            true => [b.clone(), a.clone()],
            false => [a.clone(), b.clone()],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box with corners at two points, or three of its six sides.
    fn cuboid(a: [f64; 3], b: [f64; 3], sides: usize) -> String {
        let corner = |i: usize| [0, 1, 2].map(|k| if i >> k & 1 == 1 { b[k] } else { a[k] });
        let quads = [
            [1, 3, 4, 2],
            [5, 6, 8, 7],
            [1, 2, 6, 5],
            [3, 7, 8, 4],
            [1, 5, 7, 3],
            [2, 4, 8, 6],
        ];
        let vertices = (0..8)
            .map(corner)
            .map(|[x, y, z]| format!("v {x} {y} {z}\n"));
        let faces = quads[..sides].iter();
        let faces = faces.map(|[a, b, c, d]| format!("f {a} {b} {c} {d}\n"));
        vertices.chain(faces).collect()
    }

    #[test]
    fn two_usable_meshes_are_a_pair_and_the_larger_one_stays() {
        let mut meshes = Meshes::in_unit(LengthUnit::Mm);
        let small = cuboid([0.0; 3], [5.0, 5.0, 10.0], 6);
        assert!(meshes.add("pin.obj", small.as_bytes()) && !meshes.is_pair());
        let open = cuboid([0.0; 3], [20.0; 3], 3);
        assert!(!meshes.add("open.obj", open.as_bytes()) && !meshes.is_pair());
        let large = cuboid([5.0, 0.0, 0.0], [30.0, 30.0, 10.0], 6);
        assert!(meshes.add("block.v2.obj", large.as_bytes()));
        let [fixed, moving] = meshes.pair().unwrap();
        assert_eq!((&*fixed.name, &*moving.name), ("block.v2", "pin"));
        assert!((moving.mesh.bounds().size().z - 0.01).abs() < 1e-12);
        let report = meshes.report();
        assert!(report.contains("open.obj: cannot be used\n"), "{report}");
        assert!(
            report.ends_with("pin in block.v2: they do not overlap"),
            "{report}"
        );
    }

    #[test]
    fn parts_that_overlap_are_told() {
        let mut meshes = Meshes::in_unit(LengthUnit::Cm);
        meshes.add("a.obj", cuboid([0.0; 3], [1.0; 3], 6).as_bytes());
        meshes.add(
            "b.obj",
            cuboid([0.5, 0.0, 0.0], [2.5, 1.0, 1.0], 6).as_bytes(),
        );
        let report = meshes.report();
        assert!(
            report.contains("a in b: they share 500.0000 mm³"),
            "{report}"
        );
    }
}
