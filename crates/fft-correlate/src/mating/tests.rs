//! Contact, seating and joints of shapes of which the answer is known.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use glam::{DQuat, DVec2, DVec3};
use pegfit_fixtures::{JointPair, PegInHole, joint, joint_names, stacked_rings};
use sdf_grid::shapes::construction::circle;
use sdf_grid::shapes::{cuboid, prism};
use sdf_grid::{Silent, SurfaceFeatures, TriangleMesh, symmetry};

use super::{
    HeldPose, Joint, JointKind, MatingContact, MatingSearch, MatingSearchOptions, SearchRegion,
};
use crate::geometry::se3::Pose;
use crate::rotations::search_rotations::symmetry_group;

fn contact(fixed: &TriangleMesh, moving: &TriangleMesh) -> MatingContact {
    let features = [fixed, moving].map(SurfaceFeatures::new);
    MatingContact::new([fixed, moving], features.each_ref(), None)
}

/// A peg in its hole, 0.1 mm between the walls, and how long it is, metres.
fn peg(which: PegInHole) -> (TriangleMesh, TriangleMesh, f64) {
    let (hole, peg) = which.pair(1e-4).unwrap();
    let long = peg.bounds().size().z;
    (hole, peg, long)
}

/// A box on another one that is twice as wide.
fn box_on_box() -> [TriangleMesh; 2] {
    let lower = cuboid(DVec3::new(0.06, 0.06, 0.01)).unwrap();
    let upper = cuboid(DVec3::new(0.03, 0.02, 0.01)).unwrap();
    let lift = lower.bounds().max.z - upper.bounds().min.z;
    let upper = upper.transformed(DQuat::IDENTITY, lift * DVec3::Z);
    [lower, upper]
}

fn named(name: &str) -> JointPair {
    let index = joint_names().position(|n| n == name).unwrap();
    joint(1, index).unwrap()
}

fn joint_of(fixed: &TriangleMesh, moving: &TriangleMesh) -> Joint {
    contact(fixed, moving).joint(&Pose::IDENTITY)
}

/// Motions that contact leaves free at the identity.
fn free_motions(contact: &MatingContact) -> Vec<[f64; 6]> {
    let gramian = contact.gramian(&Pose::IDENTITY, contact.clearance());
    let (values, vectors) = gramian.matrix.eigen();
    let free = values.iter().filter(|v| **v < 5e-4 * values[5]).count();
    vectors[..free].to_vec()
}

#[test]
fn contact_leaves_a_square_peg_one_motion_and_a_round_one_two() {
    let (hole, square, _) = peg(PegInHole::Rectangular);
    let free = free_motions(&contact(&hole, &square));
    assert!(free.len() == 1 && free[0][2].abs() > 0.9999, "{free:?}");
    let (hole, round, _) = peg(PegInHole::Circular);
    let free = free_motions(&contact(&hole, &round));
    assert_eq!(free.len(), 2, "{free:?}");
    for motion in free {
        // Along the axis and about it, however they are mixed.
        let along = motion[2].hypot(motion[5]);
        assert!(along > 0.9999, "{motion:?}");
    }
}

#[test]
fn a_part_on_a_plane_leaves_it_in_half_of_all_directions() {
    let [lower, upper] = box_on_box();
    let contact = contact(&lower, &upper);
    let on = contact.hold(&Pose::IDENTITY);
    assert!((0.5..0.6).contains(&on.escape), "{on:?}");
    assert!((on.share - 6.0 / 22.0).abs() < 0.01, "{on:?}");
    assert_eq!(on.interpenetration, 0.0);
    // Away from it in all of them; a peg in its hole in nearly none.
    let away = contact.hold(&Pose::from_translation(0.01 * DVec3::Z));
    assert_eq!((away.escape, away.share, away.information), (1.0, 0.0, 0.0));
    let (hole, square, _) = peg(PegInHole::Rectangular);
    let held = self::contact(&hole, &square).hold(&Pose::IDENTITY);
    assert!(held.escape < 0.1 && held.hold > on.hold, "{held:?}");
}

#[test]
fn seating_brings_a_displaced_and_tilted_peg_back() {
    let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
    let contact = contact(&hole, &peg);
    let (size, middle) = (peg.bounds().diagonal(), peg.bounds().center());
    let third = contact.clearance() / 3.0;
    let tilt = third / (0.5 * PegInHole::HEIGHT);
    for (axis, along) in [
        (DVec3::X, DVec3::X),
        (DVec3::Y, DVec3::X),
        (DVec3::Z, DVec3::new(0.7, 0.7, 0.0)),
        (DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.6, -0.8, 0.0)),
    ] {
        let turn = DQuat::from_axis_angle(axis, tilt);
        let start = Pose::new(turn, middle + third * along - turn * middle);
        let (pose, hold) = contact.seat(&start);
        // Along the hole it may lie anywhere.
        let away = (pose.apply(middle) - middle).truncate().length();
        let angle = pose.angle_to(&Pose::IDENTITY);
        assert!(
            away < 1e-3 * size && angle < 1e-3,
            "{axis}: {away} m, {angle} rad"
        );
        assert!(hold > contact.hold(&start).hold, "{axis}");
    }
}

#[test]
fn simple_shapes_have_the_joints_that_they_look_like() {
    let (hole, square, _) = peg(PegInHole::Rectangular);
    let prismatic = joint_of(&hole, &square);
    assert_eq!(prismatic.kind, JointKind::Prismatic);
    let (hole, round, _) = peg(PegInHole::Circular);
    let cylindrical = joint_of(&hole, &round);
    assert_eq!(cylindrical.kind, JointKind::Cylindrical);
    let [lower, upper] = box_on_box();
    let planar = joint_of(&lower, &upper);
    assert_eq!(planar.kind, JointKind::Planar);
    for joint in [prismatic, cylindrical, planar] {
        let off = joint.axis.cross(DVec3::Z).length();
        assert!(off < 1e-3, "{joint:?}");
    }
    // Far away a part may do anything.
    let far = Pose::from_translation(DVec3::Z);
    let anything = contact(&lower, &upper).joint(&far).kind;
    assert_eq!(anything, JointKind::Undetermined(6));
}

/// Kind, axis and point as the fixture states them.
#[test]
fn joints_of_machines_are_told_apart() {
    for name in [
        "mortise-blind",
        "drawer-wood",
        "box-lip-inside",
        "d-shaft-in-lever",
        // A small joint of a large part.
        "hexagon-key-in-screw",
        "dovetail-open",
        // Guided, at a stop.
        "dovetail-stop",
        "t-block-in-slot-stop",
        "carriage-on-rail",
        "bearing-in-housing",
        "key-woodruff",
        "cone-plug",
        "taper-1-to-20",
        "pin-plain-through",
        "nut-left-hand",
        "cap-on-jar",
        "ball-in-cup",
    ] {
        let pair = named(name);
        let (found, stated) = (joint_of(&pair.fixed, &pair.moving), pair.joint.unwrap());
        assert_eq!(found.kind.name(), stated.name(), "{name}: {found:?}");
        if let Some(axis) = stated.axis() {
            let off = axis.cross(found.axis).length();
            assert!(off < 8.7e-3, "{name}: {found:?}");
        }
        if let Some(point) = stated.point() {
            let away = point - found.point;
            let across = away - away.dot(found.axis) * found.axis;
            assert!(across.length() < 2e-4, "{name}: {found:?}");
        }
        if let pegfit_fixtures::Freedom::Screw { pitch, .. } = stated {
            let error = found.pitch / pitch - 1.0;
            // The thread has facets.
            assert!(
                error.abs() < 0.05,
                "{name}: {} m, not {pitch} m",
                found.pitch
            );
        }
    }
}

#[test]
fn a_peg_travels_until_a_tenth_of_its_contact_is_left_or_a_plate_blocks_it() {
    let (hole, square, long) = peg(PegInHole::Rectangular);
    let through = joint_of(&hole, &square).slide.unwrap();
    assert_eq!(through.blocked, [false, false]);
    for reached in through.range {
        let error = reached.abs() / long - 0.9;
        assert!(error.abs() < 0.04, "{through:?}");
    }
    // A plate 5 mm below.
    let plate = cuboid(DVec3::new(0.04, 0.04, 0.005)).unwrap();
    let down = hole.bounds().min.z - plate.bounds().max.z - 0.005;
    let plate = plate.transformed(DQuat::IDENTITY, down * DVec3::Z);
    let joint = joint_of(&TriangleMesh::joined([&hole, &plate]), &square);
    let stopped = joint.slide.unwrap();
    let down = usize::from(joint.axis.z < 0.0);
    assert!(stopped.blocked[down] && !stopped.blocked[1 - down]);
    assert!(
        (4.3e-3..5.5e-3).contains(&stopped.range[down].abs()),
        "{stopped:?}"
    );
}

#[test]
fn a_round_peg_turns_all_around() {
    let (hole, round, _) = peg(PegInHole::Circular);
    let turn = joint_of(&hole, &round).turn.unwrap();
    let half = std::f64::consts::PI;
    assert_eq!((turn.range, turn.blocked), ([-half, half], [false; 2]));
}

/// A box without a lid, its floor at z = 0, its mouth at `height`.
fn tray(outside: DVec2, height: f64, wall: f64) -> TriangleMesh {
    let ring = |size: DVec2| {
        [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
            .map(|corner| DVec2::from_array(corner) * size)
            .to_vec()
    };
    let inside = outside - 2.0 * wall;
    stacked_rings(&[
        (ring(outside), 0.0),
        (ring(outside), height),
        (ring(inside), height),
        (ring(inside), wall),
    ])
    .unwrap()
}

fn search(fixed: &TriangleMesh, moving: &TriangleMesh, present: Option<Pose>) -> Vec<HeldPose> {
    let options = MatingSearchOptions {
        top: 10,
        present,
        ..MatingSearchOptions::default()
    };
    MatingSearch::new(fixed, moving, options).run(&[], &Silent)
}

#[test]
fn a_lid_goes_over_the_mouth_though_the_bottom_holds_it_better() {
    let outside = DVec2::new(0.06, 0.04);
    let box_ = tray(outside, 0.025, 1.5e-3);
    let lid = tray(outside + 2.0 * 1.3e-3, 8e-3, 1.2e-3);
    let found = search(&box_, &lid, None);
    let up = |p: &HeldPose| (p.pose.rotation * DVec3::Z).z;
    let (mouth, bottom) = (&found[0], found.iter().find(|p| up(p) > 0.99));
    assert!(up(mouth) < -0.99 && mouth.enclosed > 2e-5, "{mouth:?}");
    let bottom = bottom.expect("the lid fits below, too");
    assert!(bottom.enclosed < 1e-6, "{bottom:?}");
    assert!(bottom.hold.hold > mouth.hold.hold, "{bottom:?}");
}

#[test]
fn a_part_that_may_turn_is_shown_as_it_lies_or_with_planes_parallel() {
    // A round peg with a square head.
    let radius = 0.01;
    let round = circle(radius, 48);
    let square = |p: &DVec2| *p * (1.5 / p.abs().max_element() * radius);
    let square: Vec<DVec2> = round.iter().map(square).collect();
    let peg = stacked_rings(&[
        (round.clone(), 0.0),
        (round, 0.02),
        (square.clone(), 0.02),
        (square, 0.03),
    ])
    .unwrap();
    // A block with a round hole.
    let hole = circle(radius + 1e-4, 48);
    let block = [[-0.03, -0.03], [0.03, -0.03], [0.03, 0.03], [-0.03, 0.03]];
    let block = block.map(DVec2::from_array);
    let block = prism(&block, &[hole], 0.02).unwrap();
    let block = block.transformed(DQuat::IDENTITY, 0.01 * DVec3::Z);
    let about_z = |pose: &Pose| pose.rotation.to_scaled_axis().z;
    let parallel = &search(&block, &peg, None)[0];
    assert_eq!(parallel.joint.kind, JointKind::Revolute, "{parallel:?}");
    let spin = about_z(&parallel.pose);
    let off = (spin / FRAC_PI_2 - (spin / FRAC_PI_2).round()) * FRAC_PI_2;
    assert!(off.abs() < 5e-3, "{spin}");
    // As it lies, though its planes are not parallel.
    let present = Pose::new(DQuat::from_rotation_z(0.6 * FRAC_PI_4), DVec3::ZERO);
    let shown = &search(&block, &peg, Some(present))[0];
    let off = shown.pose.angle_to(&present);
    assert!(off < 0.02, "{off}");
}

/// A key with round ends in a groove that is open at both ends: nothing says where along it.
#[test]
fn a_round_ended_key_is_found_in_an_open_groove() {
    let section = [
        [-12.0, -8.0],
        [12.0, -8.0],
        [12.0, 6.0],
        [4.05, 6.0],
        [4.05, 0.0],
        [-4.05, 0.0],
        [-4.05, 6.0],
        [-12.0, 6.0],
    ];
    let section = section.map(|p| 1e-3 * DVec2::from_array(p));
    let groove = prism(&section, &[], 0.06).unwrap();
    // Ends of eight facets, and flanks of 10 mm.
    let end = |k: usize| 4e-3 * DVec2::from_angle(PI * k as f64 / 8.0);
    let flank = DVec2::new(0.0, 5e-3);
    let outline = (0..=8)
        .map(|k| end(k) + flank)
        .chain((0..=8).map(|k| -end(k) - flank));
    let key = prism(&outline.collect::<Vec<_>>(), &[], 0.007).unwrap();
    // Its flat side on the bottom of the groove, wherever along it.
    let home = |pose: &Pose| {
        let up = pose.rotation * DVec3::Z;
        let along = pose.rotation * DVec3::Y;
        let place = pose.translation - 3.5e-3 * DVec3::Y;
        up.y.abs() > 0.999
            && along.z.abs() > 0.999
            && place.x.abs() < 1e-4
            && place.y.abs() < 1e-4
            && place.z.abs() < 0.025
    };
    for turn in [DVec3::ZERO, DVec3::new(0.7, -0.2, 1.9)] {
        let turn = Pose::new(DQuat::from_scaled_axis(turn), 0.1 * turn);
        let [fixed, moving] = [(&groove, turn), (&key, turn.inverse())]
            .map(|(mesh, pose)| mesh.transformed(pose.rotation, pose.translation));
        let found = search(&fixed, &moving, None);
        let best = turn.inverse() * found[0].pose * turn.inverse();
        assert!(home(&best), "{best:?} {:?}", found[0].hold);
    }
}

/// A gear has more flanks than directions that are tried: the walls of its keyway are among them.
#[test]
fn a_key_is_found_in_the_keyway_of_a_gear() {
    for seed in [3, 4] {
        let known = pegfit_fixtures::known_assembly(seed, "gearbox");
        let known = known.unwrap().unwrap();
        let part = |name: &str| known.parts.iter().find(|p| p.name == name).unwrap();
        let [gear, key] = ["gear", "key"].map(|name| &part(name).mesh);
        let there = contact(gear, key).hold(&Pose::IDENTITY).hold;
        let turned = |mesh: &TriangleMesh, by: f64| {
            let turn = DQuat::from_scaled_axis(by * DVec3::new(0.7, -1.1, 0.4));
            mesh.transformed(turn, 0.02 * DVec3::new(by, 1.0, -by))
        };
        let found = search(&turned(gear, 1.0), &turned(key, -1.7), None);
        assert!(found[0].rank > there - 1.0, "{there} {:?}", found[0].hold);
    }
}

#[test]
fn a_part_ends_in_the_middle_of_its_play() {
    let (hole, peg) = PegInHole::Rectangular.pair(4e-4).unwrap();
    let contact = contact(&hole, &peg);
    for aside in [DVec3::X, DVec3::Y, DVec3::new(0.7, -0.7, 0.0)] {
        let start = Pose::from_translation(1.5e-4 * aside);
        let hold = contact.hold(&start).hold;
        let (pose, there) = contact.centred((start, hold));
        let off = pose.apply(peg.bounds().center()) - peg.bounds().center();
        assert!(off.truncate().length() < 2e-5, "{aside}: {off}");
        assert!(there > hold - 0.5, "{aside}: {there} for {hold} nats");
    }
}

#[test]
fn a_part_that_leans_in_its_play_is_set_straight() {
    let (hole, peg) = PegInHole::Rectangular.pair(4e-4).unwrap();
    let contact = contact(&hole, &peg);
    let middle = peg.bounds().center();
    let lean = DQuat::from_rotation_x(0.03);
    let leaning = Pose::new(lean, middle - lean * middle);
    let hold = contact.hold(&leaning).hold;
    let quarter = DQuat::from_rotation_z(FRAC_PI_2);
    let (straight, better) = contact.straightened((leaning, hold), &[quarter, DQuat::IDENTITY]);
    assert!(straight.angle_to(&Pose::IDENTITY) < 2e-3 && better > hold);
    // Not to a rotation far away.
    let same = contact.straightened((leaning, hold), &[quarter]);
    assert_eq!(same, (leaning, hold));
}

/// A spur gear with straight flanks about the z axis, a tooth in the x direction, bored for a shaft.
fn gear(teeth: u32, module: f64, bore: f64) -> TriangleMesh {
    let radius = 0.5 * module * f64::from(teeth);
    // Radii, and half the widths there, as shares of half a tooth.
    let flank = [
        (radius - 1.2 * module, 0.66),
        (radius, 0.47),
        (radius + module, 0.24),
    ];
    let side = |sign: f64| move |(r, w): &(f64, f64)| (*r, sign * w);
    let tooth: Vec<(f64, f64)> = (flank.iter().map(side(-1.0)))
        .chain(flank.iter().rev().map(side(1.0)))
        .collect();
    let half = PI / f64::from(teeth);
    let outline: Vec<DVec2> = (0..teeth)
        .flat_map(|k| {
            let middle = 2.0 * half * f64::from(k);
            let corner = move |(r, w): &(f64, f64)| *r * DVec2::from_angle(middle + w * half);
            tooth.iter().map(corner).collect::<Vec<_>>()
        })
        .collect();
    prism(&outline, &[circle(bore, 48)], 6e-3).unwrap()
}

#[test]
fn a_gear_meshes_on_its_shaft() {
    const TEETH: [u32; 2] = [20, 15];
    let (module, bore) = (1.5e-3, 3e-3);
    let [fixed, moving] = TEETH.map(|teeth| gear(teeth, module, bore));
    let apart = 0.5 * module * f64::from(TEETH[0] + TEETH[1]) + 5e-5;
    let shaft = prism(&circle(bore - 2e-5, 48), &[], 0.024).unwrap();
    let shaft = shaft.transformed(DQuat::IDENTITY, apart * DVec3::X);
    // Anywhere.
    let away = Pose::new(
        DQuat::from_scaled_axis(DVec3::new(0.7, -1.1, 0.4)),
        DVec3::new(0.03, -0.05, 0.02),
    );
    let moving = moving.transformed(away.rotation, away.translation);
    let symmetries = symmetry_group(&symmetry::detect(&moving, 1e-6));
    let run = |fixed: &TriangleMesh, axis: Option<(DVec3, DVec3)>| {
        let options = MatingSearchOptions {
            top: 3,
            axis,
            symmetries: symmetries.clone(),
            ..MatingSearchOptions::default()
        };
        let found = MatingSearch::new(fixed, &moving, options).run(&[], &Silent);
        found.into_iter().next().unwrap()
    };
    // With the shaft, and with the axis only.
    let axis = (DVec3::new(apart, 0.0, 0.1), -2.0 * DVec3::Z);
    let together = TriangleMesh::joined([&fixed, &shaft]);
    for found in [run(&together, None), run(&fixed, Some(axis))] {
        let placed = found.pose * away;
        let off = placed.translation - apart * DVec3::X;
        assert!(off.truncate().length() < 3e-5, "{off}");
        assert!(off.z.abs() < 3e-4 && found.overlap < 1e-3, "{found:?}");
        let direction = placed.rotation * DVec3::Z;
        assert!(direction.truncate().length() < 2e-3, "{direction}");
        // A gap of the moving gear lies where a tooth of the fixed one does.
        let tooth = placed.rotation * DVec3::X;
        let pitch = TAU / f64::from(TEETH[1]);
        let phase = (tooth.y.atan2(tooth.x) - PI) / pitch - 0.5;
        assert!((phase - phase.round()).abs() < 0.05, "{phase}");
        assert_eq!(found.joint.kind, JointKind::Prismatic, "{found:?}");
    }
}

/// Of poses that the moving part's symmetry makes equal, those in the region are found.
#[test]
fn a_limited_region_holds_any_of_equal_poses() {
    let (hole, peg) = PegInHole::Rectangular.pair(2e-4).unwrap();
    let symmetries = symmetry_group(&symmetry::detect(&peg, 1e-6));
    assert!(symmetries.len() > 1);
    for turn in &symmetries {
        let region = SearchRegion {
            near: Some((*turn, 3e-3, 0.3)),
            ..SearchRegion::default()
        };
        let options = MatingSearchOptions {
            top: 1,
            region,
            symmetries: symmetries.clone(),
            ..MatingSearchOptions::default()
        };
        let found = MatingSearch::new(&hole, &peg, options).run(&[], &Silent);
        let first = found.first().expect("the fit");
        assert!(first.pose.angle_to(turn) < 0.3, "{turn:?} {first:?}");
        assert_eq!(first.joint.kind, JointKind::Prismatic, "{first:?}");
    }
}
