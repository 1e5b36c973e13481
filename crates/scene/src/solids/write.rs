//! A draft as a scene file, and the meshes that it needs beside it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use sdf_grid::atomic::AtomicError;
use sdf_grid::{atomic, mesh_io};

use crate::solids::draft::SceneDraft;
use crate::solids::error::ImportError;
use crate::solids::solid_set::{InFile, PlacedSolid};

impl SceneDraft<'_> {
    /// Writes the scene file, and, for solids that a scene cannot read from the file (STEP, URDF,
    /// MJCF), their meshes into the folder `NAME-parts` beside it. Returns the meshes written.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, scene: &Path) -> Result<Vec<PathBuf>, ImportError> {
        let mut writer = Writer::new(self, scene);
        let text = writer.text()?;
        atomic::write(scene, text.as_bytes())?;
        Ok(writer.written)
    }

    /// Names of the parts that stay and the solids of each.
    fn fixed_parts(&self) -> Vec<(String, Vec<usize>)> {
        // No two parts may share a name.
        let mut names = BTreeSet::new();
        let parts = self.set.parts(&self.fixed, self.separate).into_iter();
        let named = parts.map(|list| {
            let name = unique_name(&mut names, &self.named(&list));
            (name, list)
        });
        named.collect()
    }

    /// What a part of these solids is called: the first of them, and how many more there are.
    fn named(&self, list: &[usize]) -> String {
        let groups: BTreeSet<usize> = list.iter().map(|&i| self.set.solids[i].group).collect();
        let first = self.set.called(list[0]);
        match groups.len() {
            1 => first,
            count => format!("{first} and {} more", count - 1),
        }
    }
}

/// `name`, or with a number after it if it is among `names`; the answer is added to them.
pub fn unique_name(names: &mut BTreeSet<String>, name: &str) -> String {
    let numbered = (2..).map(|n| format!("{name} {n}"));
    let mut candidates = std::iter::once(name.to_owned()).chain(numbered);
    // The candidates never end.
    let free = candidates.find(|c| !names.contains(c)).unwrap_or_default();
    names.insert(free.clone());
    free
}

/// What a file of something called `name` is called, without ending: letters, digits and hyphens, with
/// a number if it is among `names`; the answer is added to them.
pub(crate) fn file_name(names: &mut BTreeSet<String>, name: &str) -> String {
    let kept = |c: char| match c {
        c if c.is_alphanumeric() || c == '-' => c,
        _ => '_',
    };
    let name: String = name.chars().take(60).map(kept).collect();
    let name = match name.is_empty() {
        true => "solid".to_owned(),
        false => name,
    };
    unique_name(names, &name).replace(' ', "-")
}

struct Writer<'a> {
    draft: &'a SceneDraft<'a>,
    folder: PathBuf,
    parts: String,
    names: BTreeSet<String>,
    written: Vec<PathBuf>,
}

impl<'a> Writer<'a> {
    fn new(draft: &'a SceneDraft<'a>, scene: &Path) -> Self {
        let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
        Self {
            draft,
            folder: scene.parent().unwrap_or(Path::new("")).to_owned(),
            parts: format!("{stem}-parts"),
            names: BTreeSet::new(),
            written: Vec::new(),
        }
    }

    fn text(&mut self) -> Result<String, ImportError> {
        let draft = self.draft;
        let source = draft.set.path.file_name().unwrap_or_default();
        let mut text = format!(
            "# Made of {} by pegfit; docs/scene.md describes every key.\nunit = \"{}\"\n",
            source.to_string_lossy(),
            draft.unit
        );
        let parts = draft.fixed_parts();
        let heading = if parts.len() == 1 {
            "[fixed]"
        } else {
            "[[fixed]]"
        };
        for (name, solids) in &parts {
            text += &self.part(heading, name, solids)?;
        }
        let name = draft.named(&draft.moving);
        text += &self.part("[moving]", &name, &draft.moving)?;
        let metre = draft.unit.in_metres();
        let spacing = number(draft.spacing / metre);
        let half = number(draft.half_extent / metre);
        text += &format!(
            "\n[lattice]\nspacing = {spacing}  # finer for tight clearance; time grows with its cube\n\
             \n[window]\nhalf_extent = {half}  # half the longest side of what moves\n"
        );
        Ok(text)
    }

    /// A table of a part.
    fn part(&mut self, heading: &str, name: &str, solids: &[usize]) -> Result<String, ImportError> {
        let mut text = format!("\n{heading}\nname = {}\n", quoted(name));
        let draft = self.draft;
        if let [only] = solids {
            let keys = self.keys(&draft.set.solids[*only])?;
            text += &(keys.join("\n") + "\n");
            return Ok(text);
        }
        text += "meshes = [\n";
        for &i in solids {
            let keys = self.keys(&draft.set.solids[i])?;
            text += &format!("    {{ {} }},\n", keys.join(", "));
        }
        text += "]\n";
        Ok(text)
    }

    /// What names a solid and its place.
    fn keys(&mut self, solid: &PlacedSolid) -> Result<Vec<String>, ImportError> {
        let (path, chosen) = match &solid.in_file {
            Some(in_file) => (self.source(), in_file.clone()),
            None => (self.mesh(solid)?, InFile::Whole),
        };
        let mut keys = vec![format!("mesh = {}", quoted(&path))];
        match chosen {
            InFile::Whole => {}
            InFile::Named => keys.push(format!("solid = {}", quoted(&solid.name))),
            InFile::Number(n) => keys.push(format!("solid = {n}")),
        }
        if solid.pose != Pose::IDENTITY {
            let metre = self.draft.unit.in_metres();
            let position = (solid.pose.translation / metre).to_array();
            keys.push(format!("position = {position:?}"));
            keys.push(format!("rotation = {:?}", solid.pose.rotation.to_array()));
        }
        Ok(keys)
    }

    /// The file of solids, seen from the scene's folder where it lies in or below it.
    fn source(&self) -> String {
        let path = &self.draft.set.path;
        let here = match self.folder.as_os_str().is_empty() {
            true => Path::new("."),
            false => &self.folder,
        };
        let (Ok(folder), Ok(whole)) = (here.canonicalize(), path.canonicalize()) else {
            return path.display().to_string();
        };
        let shown = whole.strip_prefix(&folder).unwrap_or(&whole);
        shown.display().to_string()
    }

    /// Writes a solid's mesh beside the scene; its path from there.
    fn mesh(&mut self, solid: &PlacedSolid) -> Result<String, ImportError> {
        let name = file_name(&mut self.names, &solid.name);
        let folder = self.folder.join(&self.parts);
        std::fs::create_dir_all(&folder).map_err(|source| AtomicError {
            path: folder.clone(),
            source,
        })?;
        let file = folder.join(format!("{name}.obj"));
        mesh_io::write_obj_in(&file, &solid.mesh, self.draft.unit)?;
        self.written.push(file);
        Ok(format!("{}/{name}.obj", self.parts))
    }
}

/// A TOML string.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A length without the digits that a change of unit leaves.
fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.9e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}
