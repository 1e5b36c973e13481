//! A small table on disk.

use std::ffi::CString;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use fft_correlate::{
    NodeEnergies, PairProvenance, Placement, RotationDomain, ScoreModel, Share, TableSpec, bake,
};
use glam::{DQuat, DVec3};
use ndarray::ArrayViewMut3;
use pegfit_c::{PegfitPose, PegfitStatus, PegfitTable, pegfit_table_load};
use sdf_grid::{Lattice, Silent};

/// A spring to the origin: energy `STIFFNESS / 2 * |d|²`, whatever the rotation.
pub(crate) const STIFFNESS: f64 = 100.0;

struct Spring(Lattice);

impl NodeEnergies for Spring {
    type Scratch = ();

    fn scratch(&self) {}

    fn energies(&self, _: DQuat, (): &mut (), mut out: ArrayViewMut3<'_, f32>) {
        for ((i, j, k), energy) in out.indexed_iter_mut() {
            let d = self.0.position([i, j, k]);
            *energy = (STIFFNESS / 2.0 * d.length_squared()) as f32;
        }
    }
}

/// Bakes it below `folder` and returns its path for C.
pub(crate) fn bake_spring(folder: &Path) -> CString {
    bake_placed_spring(folder, Placement::IDENTITY)
}

/// The same for a scene that places the shapes.
pub(crate) fn bake_placed_spring(folder: &Path, placement: Placement) -> CString {
    let window = Lattice::new(DVec3::splat(-0.008), 0.002, [9; 3]).unwrap();
    let spec = TableSpec {
        provenance: PairProvenance::without_fields(ScoreModel::default(), DVec3::ZERO),
        window,
        rotations: RotationDomain::List {
            rotations: vec![[0.0, 0.0, 0.0, 1.0]],
            margin_deg: 10.0,
        },
        symmetry: None,
        far_energy: 0.0,
        storage: Default::default(),
        placement,
        contact: None,
    };
    let path = folder.join("spring.zarr");
    bake(&path, &spec, &Spring(window), Share::ALL, &Silent).unwrap();
    CString::new(path.as_os_str().as_bytes()).unwrap()
}

pub(crate) fn load(path: &CString) -> PegfitTable {
    let mut table = 0;
    // SAFETY: a string of ours and a place of ours.
    let status = unsafe { pegfit_table_load(path.as_ptr(), 0, &raw mut table) };
    assert_eq!(status, PegfitStatus::Ok, "{}", last_error());
    table
}

/// The text of this thread's last failure.
pub(crate) fn last_error() -> String {
    let mut text = [0u8; 1024];
    // SAFETY: as many bytes as said.
    let size = unsafe { pegfit_c::pegfit_last_error(text.as_mut_ptr().cast(), text.len()) };
    String::from_utf8_lossy(&text[..size.min(text.len()) - 1]).into_owned()
}

pub(crate) fn at(x: f64) -> PegfitPose {
    PegfitPose {
        translation: [x, 0.0, 0.0],
        rotation: [0.0, 0.0, 0.0, 1.0],
    }
}
