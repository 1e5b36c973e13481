//! Assemblies as trees, and pushed apart.

use std::sync::Arc;

use fft_correlate::Pose;
use fft_correlate::mating::{Joint, JointKind, Travel};
use glam::{DQuat, DVec3};
use pegfit_assemble::{Assembly, AssemblyRequest, AssemblySearch, LoosePart, Mate, PlacedPart};
use sdf_grid::Silent;
use sdf_grid::shapes::{PegInHole, cuboid};

fn mate(parts: [usize; 2], information: f64, joint: Joint) -> Mate {
    Mate {
        parts,
        information,
        area: 1e-4,
        overlap: 0.0,
        joint,
    }
}

fn placed(part: usize, turn: f64, x: f64) -> PlacedPart {
    let pose = Pose::new(DQuat::from_rotation_y(turn), DVec3::new(x, 0.0, 0.0));
    PlacedPart { part, pose }
}

fn screw() -> Joint {
    let travel = Travel {
        range: [-1.0, 3.0],
        blocked: [true, false],
    };
    Joint {
        kind: JointKind::Screw,
        axis: DVec3::X,
        point: DVec3::new(0.1, 0.2, 0.3),
        pitch: 0.001,
        turn: Some(travel),
        ..Joint::default()
    }
}

fn assembly(placed: Vec<PlacedPart>, mates: Vec<Mate>) -> Assembly {
    Assembly {
        placed,
        left_over: Vec::new(),
        mates,
        score: 0.0,
        shortfall: 0.0,
        disassembly: None,
    }
}

/// Each part hangs from its best mate before it, with the joint as that part sees it.
#[test]
fn parts_hang_from_their_best_mates() {
    let order = vec![
        placed(2, 0.0, 1.0),
        placed(0, 1.2, 2.0),
        placed(1, 0.4, 3.0),
        placed(3, 0.0, 4.0),
    ];
    let mates = vec![
        mate([2, 0], 9.0, screw()),
        // Better than the next one, but part 3 is no mate of anything placed before part 1.
        mate([1, 2], 5.0, screw()),
        mate([0, 1], 4.0, Joint::default()),
    ];
    let links = assembly(order.clone(), mates).links();
    let tree: Vec<_> = links.iter().map(|l| (l.part, l.parent)).collect();
    assert_eq!(tree, [(2, None), (0, Some(0)), (1, Some(0)), (3, None)]);
    for (link, placed) in links.iter().zip(&order) {
        let parent = link.parent.map_or(Pose::IDENTITY, |p| order[p].pose);
        let at = parent * link.pose;
        assert!(at.translation.distance(placed.pose.translation) < 1e-12);
        assert!(at.angle_to(&placed.pose) < 1e-7);
    }
    // Seen from part 2 (shifted by one metre) part 0 moves as the mate says; part 1, the larger one
    // of its mate, moves the other way.
    let [forth, back] = [&links[1].joint, &links[2].joint];
    assert!(forth.point.distance(DVec3::new(-0.9, 0.2, 0.3)) < 1e-12);
    assert_eq!(forth.turn.unwrap().range, [-1.0, 3.0]);
    assert_eq!(back.turn.unwrap().range, [-3.0, 1.0]);
    assert_eq!(back.turn.unwrap().blocked, [false, true]);
    assert_eq!((forth.pitch, back.pitch), (0.001, 0.001));
    assert_eq!(links[3].joint.kind, JointKind::Fixed);
}

/// A peg is pushed out along its hole until it is free; a part of no known way goes outwards.
#[test]
fn exploded_parts_go_the_way_they_are_taken_off() {
    let (hole, peg) = PegInHole::Combined.pair(1e-4).unwrap();
    let turn = DQuat::from_rotation_x(0.7);
    let part = |name: &str, mesh| LoosePart {
        name: name.into(),
        mesh: Arc::new(mesh),
    };
    let parts = vec![
        part("hole", hole.transformed(turn, DVec3::ZERO)),
        part("peg", peg.transformed(turn, DVec3::new(0.3, 0.0, 0.0))),
    ];
    let request = AssemblyRequest {
        fixed: Some(0),
        ..AssemblyRequest::default()
    };
    let found = AssemblySearch::new(parts.clone(), request).unwrap();
    let found = found.run(&Silent).unwrap();
    let best = &found.assemblies[0];
    let shifts = |exploded: &[PlacedPart], assembly: &Assembly| -> Vec<DVec3> {
        let pairs = exploded.iter().zip(&assembly.placed);
        pairs
            .map(|(e, p)| e.pose.translation - p.pose.translation)
            .collect()
    };
    let shift = shifts(&best.exploded(&parts), best);
    assert_eq!(shift[0], DVec3::ZERO);
    let axis = turn * DVec3::Z;
    let along = shift[1].dot(axis);
    assert!(along.abs() > 0.999 * shift[1].length(), "{}", shift[1]);
    // Both are 30 mm long or longer: out of the hole, with a gap, but not far away.
    assert!((0.03..0.12).contains(&along.abs()), "{along}");

    let cube = |x: f64| {
        cuboid(DVec3::splat(0.02))
            .unwrap()
            .transformed(DQuat::IDENTITY, DVec3::X * x)
    };
    let parts = vec![part("a", cube(0.0)), part("b", cube(0.02))];
    let touching = assembly(vec![placed(0, 0.0, 0.0), placed(1, 0.0, 0.0)], Vec::new());
    let shift = shifts(&touching.exploded(&parts), &touching);
    assert_eq!(shift[0], DVec3::ZERO);
    assert!(
        shift[1].x > 0.0 && shift[1].x < 0.01 && shift[1].y.abs() < 1e-12,
        "{}",
        shift[1]
    );
}
