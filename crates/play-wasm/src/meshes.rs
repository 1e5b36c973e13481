//! Mesh files dropped onto the page.

use std::path::Path;

use pegfit_scene::{FitSolids, FitVerdict, MeshVerdict};
use sdf_grid::LengthUnit;
use sdf_grid::mesh_io::{MeshFile, ReadOptions};
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use crate::opened::NamedSolid;

/// Mesh files dropped onto the page, each with the verdict of `pegfit check`.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Meshes {
    unit: LengthUnit,
    usable: Vec<NamedSolid>,
    lines: Vec<String>,
}

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
    #[wasm_bindgen(js_name = isPair)]
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
