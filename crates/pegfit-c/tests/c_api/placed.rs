//! A table of a scene that places its parts.

use fft_correlate::{Placement, Pose};
use glam::{DQuat, DVec3};
use pegfit_c::{
    PegfitPose, PegfitResponse, PegfitStatus, PegfitTableInfo, pegfit_table_close,
    pegfit_table_info, pegfit_table_query,
};

use crate::table::{STIFFNESS, at, bake_placed_spring, load};

#[test]
fn a_table_answers_in_the_scene_it_was_baked_for() {
    let folder = tempfile::tempdir().unwrap();
    let placement = Placement {
        fixed: Pose::new(DQuat::from_rotation_x(0.8), DVec3::new(1.0, -2.0, 0.5)),
        moving: Pose::new(DQuat::from_rotation_z(-2.0), DVec3::new(0.1, 0.2, 0.3)),
    };
    let table = load(&bake_placed_spring(folder.path(), placement));
    let there = placement.to_scene(&Pose::from_translation(DVec3::Y * 0.002));
    let pose = PegfitPose {
        translation: there.translation.to_array(),
        rotation: there.rotation.to_array(),
    };
    let zero = PegfitResponse {
        energy: 0.0,
        torque: [0.0; 3],
        force: [0.0; 3],
        coverage: 0.0,
    };
    let mut found = zero;
    // SAFETY: one pose and one response of ours.
    let status = unsafe { pegfit_table_query(table, &raw const pose, &raw mut found) };
    assert_eq!(status, PegfitStatus::Ok);
    let expected = placement.fixed.rotation * DVec3::Y * (-STIFFNESS * 0.002);
    // Half precision of the stored energies.
    assert!((DVec3::from_array(found.force) - expected).length() < 0.02);
    assert_eq!(found.coverage, 1.0);
    let mut info = PegfitTableInfo {
        pivot: [0.0; 3],
        window_min: [0.0; 3],
        window_max: [0.0; 3],
        rotations: 0,
        bytes: 0,
        fixed: at(0.0),
        moving: at(0.0),
    };
    // SAFETY: a place of ours.
    let status = unsafe { pegfit_table_info(table, &raw mut info) };
    assert_eq!(status, PegfitStatus::Ok);
    assert_eq!(info.fixed.translation, [1.0, -2.0, 0.5]);
    assert_eq!(info.moving.translation, [0.1, 0.2, 0.3]);
    assert_eq!(pegfit_table_close(table), PegfitStatus::Ok);
}
