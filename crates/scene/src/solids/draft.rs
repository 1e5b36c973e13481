//! Which solids move, which stay, and numbers that fit their sizes.

use fft_correlate::pair::default_spacing;
use sdf_grid::{Aabb, LengthUnit, MeshError, TriangleMesh};

use crate::setup::parts::joined;
use crate::solids::error::ImportError;
use crate::solids::solid_set::SolidSet;

/// No farther than the default halo of what moves, whatever it meets: a share of its diagonal.
const REACH: f64 = 0.375;

/// A scene of some of a file's solids, before it is written.
///
/// See the example of [`SolidSet`](crate::SolidSet).
#[derive(Debug, Clone)]
pub struct SceneDraft<'a> {
    /// The file's solids.
    pub set: &'a SolidSet,
    /// Indices of the solids that move together.
    pub moving: Vec<usize>,
    /// Indices of the solids that stay: those asked for, or those in reach of what moves.
    pub fixed: Vec<usize>,
    /// Indices of the others.
    pub left_out: Vec<usize>,
    /// Whether each thing that stays is a part of its own; else they are one.
    pub separate: bool,
    /// Unit of the scene's lengths.
    pub unit: LengthUnit,
    /// Distance between lattice nodes, metres.
    pub spacing: f64,
    /// Half the sides of the box of displacements, metres.
    pub half_extent: f64,
}

impl SolidSet {
    /// A scene in which the solids called `moving` (names, or numbers from 1) move together and those
    /// called `fixed` stay; of none, all others that are in reach. The pose in the file is the fit.
    ///
    /// # Errors
    /// If a name stands for none or several, nothing that stays is in reach, or several solids do not
    /// make one mesh.
    pub fn draft(
        &self,
        moving: &[String],
        fixed: &[String],
        separate: bool,
    ) -> Result<SceneDraft<'_>, ImportError> {
        let mut moves = Vec::new();
        for name in moving {
            moves.extend(self.chosen("--moving", name)?);
        }
        moves.sort_unstable();
        moves.dedup();
        let mut stays = Vec::new();
        for name in fixed {
            stays.extend(self.chosen("--fixed", name)?);
        }
        let bounds: Vec<Aabb> = self.solids.iter().map(|s| s.placed().bounds()).collect();
        let around = |list: &[usize]| {
            let boxes = list.iter().map(|&i| &bounds[i]);
            boxes.fold(Aabb::EMPTY, |all, b| all.union(b))
        };
        let moving_box = around(&moves);
        let reach = REACH * moving_box.diagonal();
        let (mut near, mut far) = (Vec::new(), Vec::new());
        for (i, found) in bounds.iter().enumerate() {
            let stays = match stays.is_empty() {
                true => found.overlaps(&moving_box.grown(reach)),
                false => stays.contains(&i),
            };
            match moves.contains(&i) {
                true => {}
                false if stays => near.push(i),
                false => far.push(i),
            }
        }
        if near.is_empty() {
            return Err(ImportError::Alone {
                path: self.path.clone(),
                moving: moving.join(", "),
                reach,
            });
        }
        self.divided([moves, near, far], separate)
    }

    /// A scene of all solids: one moves, every other one is a part that stays.
    ///
    /// # Errors
    /// If a mesh is unusable.
    pub fn all_but(&self, moving: usize) -> Result<SceneDraft<'_>, ImportError> {
        let stays = (0..self.solids.len()).filter(|i| *i != moving);
        self.divided([vec![moving], stays.collect(), Vec::new()], true)
    }

    /// Solids that move, stay, and are left out.
    fn divided(
        &self,
        [moving, fixed, left_out]: [Vec<usize>; 3],
        separate: bool,
    ) -> Result<SceneDraft<'_>, ImportError> {
        let what_moves = self.together(&moving)?;
        let reach = REACH * what_moves.bounds().diagonal();
        let mut spacing = f64::INFINITY;
        for part in self.parts(&fixed, separate) {
            spacing = spacing.min(default_spacing(&self.together(&part)?, &what_moves, reach));
        }
        Ok(SceneDraft {
            set: self,
            spacing,
            half_extent: 0.5 * what_moves.bounds().size().max_element(),
            moving,
            fixed,
            left_out,
            separate,
            unit: self.unit,
        })
    }

    /// Solids that stay, by parts: one, or one for each thing.
    pub(super) fn parts(&self, fixed: &[usize], separate: bool) -> Vec<Vec<usize>> {
        let mut parts: Vec<Vec<usize>> = Vec::new();
        for &i in fixed {
            let same = |list: &[usize]| self.solids[list[0]].group == self.solids[i].group;
            match parts.last_mut() {
                Some(list) if !separate || same(list) => list.push(i),
                _ => parts.push(vec![i]),
            }
        }
        parts
    }

    /// One mesh of several solids, as the scene reads them.
    fn together(&self, solids: &[usize]) -> Result<TriangleMesh, MeshError> {
        let meshes = solids.iter().map(|&i| self.solids[i].placed());
        Ok(joined(&self.called(solids[0]), meshes.collect())?.0)
    }

    /// What a group of solids is called: their name, or their number in the file.
    pub fn called(&self, index: usize) -> String {
        let solid = &self.solids[index];
        match solid.name.trim() {
            "" => format!("solid {}", solid.group + 1),
            name => name.to_owned(),
        }
    }
}
