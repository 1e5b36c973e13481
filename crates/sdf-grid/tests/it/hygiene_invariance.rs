//! What hygiene does not depend on: order, scale, place, how often it is done; and that no input
//! breaks it.

use crate::common::bare::{clean, faulty, raw};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use rand::SeedableRng;
use rand::rngs::SmallRng;
use rand::seq::SliceRandom;
use sdf_grid::{RepairOptions, RepairReport, TriangleMesh};

use crate::common::assert_close;

/// Faces as sorted sets of positions, each running from its lowest corner.
fn face_set(mesh: &TriangleMesh) -> Vec<[[u64; 3]; 3]> {
    let mut faces: Vec<_> = mesh
        .faces()
        .map(|f| {
            let ring = f.map(|p| p.to_array().map(f64::to_bits));
            let first = (0..3).min_by_key(|&i| ring[i]).unwrap_or(0);
            std::array::from_fn(|i| ring[(first + i) % 3])
        })
        .collect();
    faces.sort_unstable();
    faces
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn hygiene_is_idempotent(seed in any::<u64>()) {
        let (vertices, triangles) = faulty(seed);
        let (once, _) = clean(vertices, triangles).expect("repairable");
        let (twice, report) = clean(raw(&once).0, raw(&once).1).expect("clean");
        prop_assert_eq!(&once, &twice);
        prop_assert_eq!(report.flipped_faces + report.duplicate_faces + report.zero_area_faces, 0);
        prop_assert_eq!(report.welded_vertices, 0);
        prop_assert_eq!(once.hash(), twice.hash());
    }

    #[test]
    fn the_order_of_triangles_does_not_matter(seed in any::<u64>()) {
        let (vertices, triangles) = faulty(seed);
        let mut shuffled = triangles.clone();
        shuffled.shuffle(&mut SmallRng::seed_from_u64(!seed));
        let (a, report_a) = clean(vertices.clone(), triangles).expect("repairable");
        let (b, report_b) = clean(vertices, shuffled).expect("repairable");
        prop_assert_eq!(face_set(&a), face_set(&b));
        prop_assert_eq!(report_a.cavities, report_b.cavities);
    }

    #[test]
    fn rigid_motion_keeps_volume_area_and_report(
        axis in prop::array::uniform3(-1.0f64..1.0),
        angle in -3.0f64..3.0,
        offset in prop::array::uniform3(-100.0f64..100.0),
    ) {
        let (vertices, triangles) = faulty(1);
        let (mesh, report) = clean(vertices.clone(), triangles.clone()).expect("repairable");
        let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::X);
        let (rotation, offset) = (DQuat::from_axis_angle(axis, angle), DVec3::from_array(offset));
        let elsewhere = vertices.iter().map(|&v| rotation * v + offset).collect();
        let (moved, moved_report) = clean(elsewhere, triangles).expect("repairable");
        prop_assert_eq!(moved_report.flipped_faces, report.flipped_faces);
        prop_assert_eq!(moved_report.cavities, report.cavities);
        // Coordinates near 100 hold 1e-14 of absolute rounding on a part of size 8.
        prop_assert!((moved.volume() / mesh.volume() - 1.0).abs() < 1e-11);
        prop_assert!((moved.area() / mesh.area() - 1.0).abs() < 1e-11);
        let carried = mesh.transformed(rotation, offset);
        prop_assert!((carried.volume() / mesh.volume() - 1.0).abs() < 1e-11);
        prop_assert!(carried.centroid().distance(rotation * mesh.centroid() + offset) < 1e-11);
        prop_assert_ne!(carried.hash(), mesh.hash());
    }

    #[test]
    fn any_soup_is_cleaned_or_refused(
        coordinates in prop::collection::vec(prop::array::uniform3(-2i8..=2), 1..12),
        faces in prop::collection::vec(prop::array::uniform3(0u32..12), 0..30),
    ) {
        let vertices: Vec<_> = coordinates.iter().map(|c| DVec3::from_array(c.map(f64::from))).collect();
        let options = RepairOptions { max_open_fraction: 1.0, ..RepairOptions::default() };
        if let Ok((mesh, report)) = TriangleMesh::clean("soup", vertices, faces, &options) {
            prop_assert!((0.0..=1.0).contains(&report.open_area_fraction));
            prop_assert!(!report.watertight || report.open_edges == 0);
            let (again, _) = TriangleMesh::clean("soup", raw(&mesh).0, raw(&mesh).1, &options)
                .expect("what hygiene made is accepted");
            prop_assert_eq!(mesh, again);
        }
    }
}

#[test]
fn neither_scale_nor_place_changes_what_is_found() {
    let (vertices, triangles) = faulty(5);
    let (_, here) = clean(vertices.clone(), triangles.clone()).expect("repairable");
    for (scale, offset) in [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6), (1e-6, 1.0)] {
        let elsewhere = vertices.iter().map(|v| scale * *v + offset).collect();
        let (mesh, report) = clean(elsewhere, triangles.clone()).expect("repairable");
        let counts = |r: &RepairReport| {
            [
                r.vertices,
                r.triangles,
                r.flipped_faces,
                r.components,
                r.cavities,
                r.open_edges,
            ]
        };
        assert_eq!(counts(&report), counts(&here));
        // At 1e6 sizes from the origin a coordinate holds 1e-10 of the size.
        let expected = here.volume * scale.powi(3);
        assert_close(mesh.volume(), expected, 1e-8);
    }
}
