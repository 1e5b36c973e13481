//! A small table whose energy differs at every rotation.
#![allow(dead_code, reason = "each test binary uses a part")]

use fft_correlate::testing::bake_files;
use fft_correlate::{
    NodeEnergies, PairProvenance, Placement, RotationDomain, ScoreModel, Share, Storage,
    TableFiles, TableSpec, TableStore,
};
use glam::{DQuat, DVec3};
use ndarray::ArrayViewMut3;
use sdf_grid::{Aabb, Lattice, Silent};

/// A spring about zero and a valley for every turn.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Valleys {
    /// Of the spring: joules per cell of the window squared.
    pub(crate) spring: f64,
    /// Depth of the valley, joules.
    pub(crate) depth: f64,
}

/// Where a part feels the table: its window and the margin in which it fades.
pub(crate) const REACH: Aabb = Aabb {
    min: DVec3::splat(-0.04),
    max: DVec3::splat(0.04),
};

impl NodeEnergies for Valleys {
    type Scratch = ();

    fn scratch(&self) {}

    fn energies(&self, rotation: DQuat, _: &mut (), mut out: ArrayViewMut3<'_, f32>) {
        let turn = rotation.to_scaled_axis();
        for ((i, j, k), e) in out.indexed_iter_mut() {
            let p = DVec3::new(i as f64, j as f64, k as f64) - 2.0;
            // Nothing at the corners of the window, where the table ends.
            let spring = self.spring * (p.length_squared() - 12.0);
            *e = (spring + self.depth * (5.0 * turn).dot(p).cos()) as f32;
        }
    }
}

impl Valleys {
    /// The table over turns of 60 degrees every 6, and displacements of 20 mm every 10.
    pub(crate) fn bake(self) -> TableFiles {
        let spec = TableSpec {
            provenance: PairProvenance::without_fields(ScoreModel::GUIDED, DVec3::ZERO),
            window: Lattice::new(DVec3::splat(-0.02), 0.01, [5; 3]).unwrap(),
            rotations: RotationDomain::ball(60.0, 6.0),
            symmetry: None,
            far_energy: 0.0,
            storage: Storage::default(),
            placement: Placement::IDENTITY,
            contact: None,
        };
        let files = TableFiles::in_memory("valleys");
        bake_files(&files, &spec, &self, Share::ALL, &Silent).unwrap();
        files
    }
}

pub(crate) fn open(files: &TableFiles) -> TableStore {
    TableStore::open_files(files).unwrap()
}
