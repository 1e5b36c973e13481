//! Parts that were put together, taken from their places and put together again.

use std::sync::Arc;

use fft_correlate::Pose;
use glam::{DQuat, DVec2, DVec3};
use pegfit_assemble::{AssemblyError, AssemblyRequest, AssemblySearch, LoosePart};
use pegfit_fixtures::stacked_rings;
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sdf_grid::{Bvh, Monitor, Silent, TriangleMesh, shapes};

/// Corners of a square, metres.
fn square(side: f64, x: f64) -> Vec<DVec2> {
    let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
    corners
        .map(|(u, v)| DVec2::new(x + side * u, side * v))
        .to_vec()
}

/// Corners of a triangle without symmetry, metres.
fn triangle(scale: f64) -> Vec<DVec2> {
    let corners = [(-5.0, -3.0), (7.0, -3.0), (-2.0, 6.0)];
    corners
        .map(|(x, y)| 1e-3 * scale * DVec2::new(x, y))
        .to_vec()
}

/// A shank as long as the plate is thick, and a head on it.
fn headed(plate: &TriangleMesh, shank: Vec<DVec2>, head: Vec<DVec2>) -> TriangleMesh {
    let [low, high] = [plate.bounds().min.z, plate.bounds().max.z];
    let rings = [
        (shank.clone(), low),
        (shank, high),
        (head.clone(), high),
        (head, high + 4e-3),
    ];
    stacked_rings(&rings).unwrap()
}

/// A plate with three holes, two equal pins for two of them, another one, and a ball for none.
fn parts() -> Vec<(&'static str, TriangleMesh)> {
    let outline = [(-30.0, -16.0), (32.0, -16.0), (32.0, 12.0), (-30.0, 12.0)];
    let outline = outline.map(|(x, y)| 1e-3 * DVec2::new(x, y));
    let holes = [square(8e-3, -0.02), square(8e-3, 0.02), triangle(1.0)];
    let plate = shapes::prism(&outline, &holes, 0.01).unwrap();
    let pin = |x: f64| headed(&plate, square(7.9e-3, x), square(12e-3, x));
    let other = headed(&plate, triangle(0.99), triangle(1.4));
    vec![
        ("plate", plate.clone()),
        ("pin", pin(-0.02)),
        ("key", other),
        ("other pin", pin(0.02)),
        ("ball", shapes::icosphere(9e-3, 2).unwrap()),
    ]
}

/// Parts anywhere, and from where they were to where they are.
fn scattered(seed: u64) -> (Vec<LoosePart>, Vec<Pose>) {
    let mut rng = SmallRng::seed_from_u64(seed);
    let mut numbers = move || std::array::from_fn(|_| rng.random_range(-1.0..1.0));
    let scatter = |(name, mesh): (&str, TriangleMesh)| {
        let rotation = DQuat::from_array(numbers()).normalize();
        let [x, y, z, _]: [f64; 4] = numbers();
        let motion = Pose::new(rotation, 0.2 * DVec3::new(x, y, z));
        let part = LoosePart {
            name: name.to_owned(),
            mesh: Arc::new(mesh.transformed(motion.rotation, motion.translation)),
        };
        (part, motion)
    };
    parts().into_iter().map(scatter).unzip()
}

fn request() -> AssemblyRequest {
    AssemblyRequest {
        fixed: Some(0),
        ..AssemblyRequest::default()
    }
}

/// Every part comes to its place or that of its twin, the pins from either side of the plate, the ball
/// is left over, and it comes apart.
#[test]
fn loose_parts_are_put_together() {
    let (loose, motions) = scattered(7);
    let found = AssemblySearch::new(loose, request()).unwrap();
    let found = found.run(&Silent).unwrap();
    assert!(found.shapes.contains(&vec![1, 3]), "{:?}", found.shapes);
    let best = &found.assemblies[0];
    assert_eq!(best.left_over, [4]);
    assert_eq!(best.placed.len(), 4);
    let truth = parts();
    let over = DQuat::from_rotation_x(std::f64::consts::PI);
    let middle = truth[0].1.bounds().center().z * DVec3::Z;
    let turned = |mesh: &TriangleMesh| mesh.transformed(over, middle - over * middle);
    for placed in &best.placed {
        // In the plate's own frame, as it was before.
        let pose = motions[0].inverse() * placed.pose * motions[placed.part];
        let bounds = truth[placed.part].1.bounds();
        let equal = match placed.part {
            1 | 3 => vec![truth[1].1.clone(), truth[3].1.clone()],
            only => vec![truth[only].1.clone()],
        };
        let pin = [1, 3].contains(&placed.part);
        let below: Vec<TriangleMesh> = equal.iter().filter(|_| pin).map(turned).collect();
        let off = |there: &TriangleMesh| {
            let there = Bvh::build(there);
            let vertices = truth[placed.part].1.vertices().iter();
            let far = vertices.map(|v| there.nearest(pose.apply(*v)).distance);
            far.fold(0.0, f64::max)
        };
        let nearest = equal
            .iter()
            .chain(&below)
            .map(off)
            .fold(f64::INFINITY, f64::min);
        assert!(
            nearest < 0.02 * bounds.diagonal(),
            "{}: {nearest}",
            placed.part
        );
    }
    let apart = best.disassembly.as_ref().unwrap();
    assert!(apart.locked.is_empty() && apart.steps.len() == 3);
    // On the plate, and on nothing else.
    assert!(
        best.mates
            .iter()
            .all(|m| m.parts[0] == 0 && m.overlap < 1e-3)
    );
    assert_eq!(best.mates.len(), 3);
}

/// What is known is kept: a part that is placed elsewhere stays there, and its twin takes the other
/// hole.
#[test]
fn placed_parts_stay() {
    let (loose, motions) = scattered(8);
    let home = motions[0] * motions[3].inverse();
    let request = AssemblyRequest {
        placed: vec![(0, Pose::IDENTITY), (3, home)],
        path_time: std::time::Duration::ZERO,
        fixed: None,
        ..request()
    };
    let found = AssemblySearch::new(loose, request).unwrap().run(&Silent);
    let best = &found.unwrap().assemblies[0];
    let pose = |part| best.placed.iter().find(|p| p.part == part).unwrap().pose;
    assert!(pose(3).translation.distance(home.translation) < 1e-12);
    assert!(pose(3).angle_to(&home) < 1e-6);
    let other = motions[0] * motions[1].inverse();
    assert!(pose(1).translation.distance(other.translation) < 1e-3);
    assert!(pose(1).angle_to(&other) < 0.02);
    assert!(best.disassembly.is_none());
}

/// Bad requests are refused, and a search ends when it shall.
#[test]
fn refusals_and_cancelling() {
    struct Stop;
    impl Monitor for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let (loose, _) = scattered(9);
    let new = |parts: &[LoosePart], request| AssemblySearch::new(parts.to_vec(), request);
    let error = new(&loose[..1], AssemblyRequest::default()).unwrap_err();
    assert!(matches!(error, AssemblyError::PartCount { found: 1, .. }));
    let error = new(
        &loose,
        AssemblyRequest {
            fixed: Some(9),
            ..AssemblyRequest::default()
        },
    );
    assert!(matches!(
        error,
        Err(AssemblyError::NoSuchPart { found: 9, .. })
    ));
    let twice = vec![(1, Pose::IDENTITY), (1, Pose::IDENTITY)];
    let error = new(
        &loose,
        AssemblyRequest {
            placed: twice,
            ..AssemblyRequest::default()
        },
    );
    assert!(matches!(error, Err(AssemblyError::PlacedTwice { .. })));
    let search = new(&loose, AssemblyRequest::default()).unwrap();
    assert_eq!(search.run(&Stop).unwrap_err(), AssemblyError::Cancelled);
    // A ball on a ball is held by nothing.
    let balls = [loose[4].clone(), loose[4].clone()];
    let search = new(&balls, AssemblyRequest::default()).unwrap();
    assert_eq!(search.run(&Silent).unwrap_err(), AssemblyError::NothingFits);
}
