//! Assemblies whose order is known: boxes in a tray, a lid over one, a spool that nothing takes off, a
//! burr.

use std::sync::Arc;
use std::time::Duration;

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use pegfit_fixtures as shapes;
use pegfit_path::{
    AssemblyPart, DisassemblyRequest, DisassemblyResult, DisassemblySearch, DisassemblyTries,
    PathError,
};
use rand::SeedableRng;
use rand::rngs::SmallRng;
use sdf_grid::{Bvh, Monitor, Silent, TriangleMesh};

use crate::common::random_pose;

/// Cells from `low` to before `high`, without those of `holes`, each such a box itself.
fn cells(low: [i32; 3], high: [i32; 3], holes: &[[[i32; 3]; 2]]) -> Vec<[i32; 3]> {
    let mut all = Vec::new();
    for x in low[0]..high[0] {
        for y in low[1]..high[1] {
            for z in low[2]..high[2] {
                let cell = [x, y, z];
                let within =
                    |[a, b]: &[[i32; 3]; 2]| (0..3).all(|k| (a[k]..b[k]).contains(&cell[k]));
                if !holes.iter().any(within) {
                    all.push(cell);
                }
            }
        }
    }
    all
}

const EDGE: f64 = 0.004;

fn block(cells: &[[i32; 3]], clearance: f64) -> TriangleMesh {
    shapes::blocks(cells, EDGE, clearance).unwrap()
}

/// All parts turned and shifted alike, and where they were put.
fn placed(parts: Vec<(&str, TriangleMesh)>, seed: u64) -> (Vec<AssemblyPart>, Pose) {
    let pose = random_pose(&mut SmallRng::seed_from_u64(seed));
    let part = |(name, mesh): (&str, TriangleMesh)| AssemblyPart {
        name: name.to_owned(),
        mesh: Arc::new(mesh.transformed(pose.rotation, pose.translation)),
    };
    (parts.into_iter().map(part).collect(), pose)
}

fn options() -> DisassemblyRequest {
    DisassemblyRequest {
        time_limit: Duration::from_secs(300),
        ..DisassemblyRequest::default()
    }
}

/// Taken apart; every path is checked by winding numbers at vertices and begins where it should.
fn apart(parts: &[AssemblyPart], options: DisassemblyRequest) -> DisassemblyResult {
    let search = DisassemblySearch::new(parts.to_vec(), options).unwrap();
    let found = search.run(&Silent).unwrap();
    for step in &found.steps {
        let path = &step.path;
        assert!(path.is_free() && path.poses[0].length == 0.0);
        let first = &path.poses[0].pose;
        assert!(first.translation.length() < 1e-9);
        assert!(first.rotation.angle_between(DQuat::IDENTITY) < 1e-7);
        let solids: Vec<Bvh> = step
            .rest
            .iter()
            .map(|p| Bvh::build(&parts[*p].mesh))
            .collect();
        for at in &path.poses {
            let moved = step.parts.iter().flat_map(|p| parts[*p].mesh.vertices());
            for p in moved {
                let p = at.pose.apply(*p);
                let apart = solids.iter().map(|s| s.signed_distance(p));
                let least = apart.fold(f64::INFINITY, f64::min);
                assert!(least > -1.01 * path.tolerance, "{:?}: {least}", step.parts);
            }
        }
    }
    found
}

#[test]
fn boxes_come_out_of_a_tray_each_by_itself() {
    for (seed, clearance) in [(1, 5e-5), (2, 3e-4)] {
        let pockets = [1, 4, 7].map(|x| [[x, 1, 1], [x + 2, 3, 3]]);
        let tray = block(&cells([0; 3], [10, 4, 3], &pockets), clearance);
        let names = ["left", "middle", "right"];
        let boxes = names.iter().zip(&pockets);
        let boxes = boxes.map(|(n, [a, b])| (*n, block(&cells(*a, *b, &[]), clearance)));
        let parts = std::iter::once(("tray", tray)).chain(boxes).collect();
        let (parts, place) = placed(parts, seed);
        let found = apart(&parts, options());
        assert_eq!((found.steps.len(), found.tries), (3, 3));
        assert!(found.locked.is_empty());
        for (i, step) in found.steps.iter().enumerate() {
            assert_eq!(step.parts, [i + 1]);
            let out = place.rotation.conjugate() * DVec3::from_array(step.path.motions[0].axis);
            assert!(out.z > 0.99, "{out}");
        }
        assert_eq!(found.steps[2].rest, [0]);
    }
}

/// The lid slides in a groove over the box: it comes off first, though it is tried last, and the box
/// goes up and out by where the lid was.
#[test]
fn a_box_under_a_lid_waits_for_it() {
    let clearance = 1e-4;
    let pocket = [[1, 1, 1], [4, 4, 2]];
    let slit = [[1, 2, 3], [6, 3, 4]];
    let housing = cells([0; 3], [5, 5, 4], &[pocket, [[1, 1, 2], [5, 4, 3]], slit]);
    let lid = cells([1, 1, 2], [5, 4, 3], &[]);
    let parts = vec![
        ("housing", block(&housing, clearance)),
        ("box", block(&cells(pocket[0], pocket[1], &[]), clearance)),
        ("lid", block(&lid, clearance)),
    ];
    let (parts, place) = placed(parts, 3);
    let found = apart(&parts, options());
    let order: Vec<&[usize]> = found.steps.iter().map(|s| &s.parts[..]).collect();
    assert_eq!(order, [&[2][..], &[1]]);
    assert!(found.locked.is_empty() && found.tries == 3);
    let own = |m: &pegfit_path::Motion| place.rotation.conjugate() * DVec3::from_array(m.axis);
    let [lid] = &found.steps[0].path.motions[..] else {
        panic!("{:?}", found.steps[0].path.motions);
    };
    assert!(own(lid).x > 0.99);
    let last = found.steps[1].path.motions.last().unwrap();
    assert!(own(last).x > 0.9, "{:?}", found.steps[1].path.motions);
}

fn spool_in_plate(clearance: f64) -> Vec<(&'static str, TriangleMesh)> {
    let plate = cells([-2, -2, 0], [3, 3, 1], &[[[0, 0, 0], [1, 1, 1]]]);
    let flange = |z: i32| cells([-1, -1, z], [2, 2, z + 1], &[]);
    let spool = [flange(-1), flange(1), vec![[0, 0, 0]]].concat();
    vec![
        ("plate", block(&plate, clearance)),
        ("spool", block(&spool, clearance)),
    ]
}

#[test]
fn a_spool_does_not_leave_its_hole() {
    let (parts, _) = placed(spool_in_plate(1e-4), 4);
    let found = apart(&parts, options());
    assert!(found.steps.is_empty());
    assert_eq!(found.locked.len(), 1);
    assert_eq!(found.locked[0].parts, [0, 1]);
    assert!(found.locked[0].exhausted);
}

/// What was tried in vain is not tried again, unless with more time; what comes off is.
#[test]
fn a_disassembly_goes_on_where_it_ended() {
    let box_beside = block(&cells([5, 5, 5], [7, 7, 7], &[]), 1e-4);
    let with_box = [spool_in_plate(1e-4), vec![("box", box_beside)]].concat();
    let (parts, _) = placed(with_box, 7);
    let search = |seconds: f64| {
        let options = DisassemblyRequest {
            time_limit: Duration::from_secs_f64(seconds),
            ..DisassemblyRequest::default()
        };
        DisassemblySearch::new(parts.clone(), options).unwrap()
    };
    let mut tried = DisassemblyTries::default();
    let run = |seconds: f64, tried: &mut DisassemblyTries| {
        let found = search(seconds).run_from(tried, &Silent).unwrap();
        *tried = serde_json::from_str(&serde_json::to_string(tried).unwrap()).unwrap();
        found
    };
    // No time for anything: each part in both rounds, then none of them again.
    let hasty = run(1e-6, &mut tried);
    assert_eq!((hasty.tries, hasty.steps.len(), tried.count()), (6, 0, 6));
    assert!(!hasty.locked[0].exhausted);
    assert_eq!(run(1e-6, &mut tried).tries, 0);
    let patient = run(300.0, &mut tried);
    assert!(patient.tries > 1);
    let again = run(300.0, &mut tried);
    assert_eq!(again.tries, 1);
    for found in [patient, again] {
        assert_eq!(found.steps.len(), 1);
        assert_eq!(found.steps[0].parts, [2]);
        assert_eq!(found.locked[0].parts, [0, 1]);
        assert!(found.locked[0].exhausted);
    }
    let mut others = parts.clone();
    others.swap(0, 1);
    let others = DisassemblySearch::new(others, options()).unwrap();
    let refused = others.run_from(&mut tried, &Silent);
    assert!(matches!(refused, Err(PathError::Visited { .. })));
}

/// Only the key can be taken first, by a push, however much its play would let it lean. It is tried
/// last.
#[test]
fn a_burr_opens_by_its_key() {
    let [a, key, b, c, d, e] = shapes::burr(EDGE, 2e-4).unwrap();
    let names = ["a", "b", "c", "d", "e", "key"];
    let parts = names.into_iter().zip([a, b, c, d, e, key]).collect();
    let (parts, place) = placed(parts, 7);
    let found = apart(&parts, options());
    assert_eq!(found.steps[0].parts, [5]);
    let [motion] = &found.steps[0].path.motions[..] else {
        panic!("not one: {:?}", found.steps[0].path.motions);
    };
    let axis = DVec3::from_array(motion.axis);
    assert!(motion.turn == 0.0 && (place.rotation.conjugate() * axis).x.abs() > 0.999);
    assert!(
        found.tries >= 5 && found.locked.is_empty(),
        "{:?}",
        found.locked
    );
    let off: usize = found.steps.iter().map(|s| s.parts.len()).sum();
    assert!(found.steps.len() == 5 && off >= 5);
}

#[test]
fn what_is_no_assembly_is_refused_by_name() {
    let search = |parts, options| DisassemblySearch::new(parts, options).err();
    let (parts, _) = placed(spool_in_plate(1e-4), 6);
    let few = search(parts[..1].to_vec(), options());
    assert!(matches!(few, Some(PathError::Option { name: "parts", .. })));
    for options in [
        DisassemblyRequest {
            largest_group: 0,
            ..options()
        },
        DisassemblyRequest {
            tolerance: Some(-1.0),
            ..options()
        },
    ] {
        let refused = search(parts.clone(), options);
        assert!(matches!(refused, Some(PathError::Option { .. })));
    }
    let mut sunk = parts;
    let mesh = &sunk[1].mesh;
    sunk[1].mesh = Arc::new(mesh.transformed(DQuat::IDENTITY, DVec3::splat(3e-4)));
    let Some(PathError::PartsOverlap { parts, depth, .. }) = search(sunk.clone(), options()) else {
        panic!("not refused");
    };
    assert_eq!(parts, ["plate", "spool"]);
    assert!((5e-5..6e-4).contains(&depth), "{depth}");
    let allowed = DisassemblyRequest {
        allow_overlap: true,
        ..options()
    };
    struct Impatient;
    impl Monitor for Impatient {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let found = DisassemblySearch::new(sunk, allowed)
        .unwrap()
        .run(&Impatient);
    assert!(matches!(found, Err(PathError::Cancelled)));
}
