//! Misuse that C compilers would warn of, and what a refused call leaves alone.

use std::ffi::CStr;

use pegfit_c::{
    PegfitPose, PegfitResponse, PegfitStatus, pegfit_status_message, pegfit_table_close,
    pegfit_table_query, pegfit_table_query_many,
};

use crate::table::{at, bake_spring, last_error, load};

const UNTOUCHED: PegfitResponse = PegfitResponse {
    energy: 7.0,
    torque: [7.0; 3],
    force: [7.0; 3],
    coverage: 7.0,
};

#[test]
fn pointers_that_are_not_aligned_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let table = load(&bake_spring(folder.path()));
    let poses = [at(0.0); 2];
    let askew = poses
        .as_ptr()
        .cast::<u8>()
        .wrapping_add(1)
        .cast::<PegfitPose>();
    let mut response = UNTOUCHED;
    // SAFETY: the first pose is not read, which is what is tested.
    let status = unsafe { pegfit_table_query(table, askew, &raw mut response) };
    assert_eq!(status, PegfitStatus::BadPointer);
    assert_eq!(last_error(), "pose: expected a pointer, found not aligned");
    assert_eq!(response, UNTOUCHED);
    assert_eq!(pegfit_table_close(table), PegfitStatus::Ok);
}

#[test]
fn a_bad_pose_among_many_is_named_and_ends_the_batch() {
    let folder = tempfile::tempdir().unwrap();
    let table = load(&bake_spring(folder.path()));
    let mut poses = [at(0.001), at(0.002), at(0.003)];
    poses[1].translation[2] = f64::INFINITY;
    let mut responses = [UNTOUCHED; 3];
    // SAFETY: three of each.
    let status = unsafe {
        pegfit_table_query_many(table, poses.as_ptr(), responses.as_mut_ptr(), poses.len())
    };
    assert_eq!(status, PegfitStatus::BadPose);
    assert!(last_error().starts_with("pose 1: "), "{}", last_error());
    assert!(responses[0].force[0] < 0.0);
    assert_eq!(responses[1..], [UNTOUCHED; 2]);
    assert_eq!(pegfit_table_close(table), PegfitStatus::Ok);
}

#[test]
fn every_number_has_a_message() {
    for status in -2..20 {
        // SAFETY: the texts are constants that end with a zero.
        let text = unsafe { CStr::from_ptr(pegfit_status_message(status)) };
        let known = (0..8).contains(&status);
        assert_eq!(text != c"unknown status", known, "{status}");
    }
}
