//! The fast sum against the slow one.

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::contact_sum::{ContactSum, ContactSums};
use crate::contact::error::ContactError;
use crate::contact::reference::ContactSurface;
use crate::contact::samples::{SurfaceSample, surface_samples};
use crate::mesh::shapes::{self, PegInHole};
use crate::mesh::triangle_mesh::TriangleMesh;

/// About that of the default lattice of the pairs, metres.
const WIDTH: f64 = 0.82e-3;

#[derive(Clone, Copy)]
struct Pose(DQuat, DVec3);

/// The sum as it is written.
fn slow(surface: &ContactSurface, samples: &[SurfaceSample], at: Pose) -> ContactSums {
    let one = |s: &SurfaceSample| {
        let (lever, area) = (at.0 * s.position, at.0 * s.area);
        let flux = surface.flux(lever + at.1);
        let gradient = flux.slope.transpose() * area;
        ContactSums {
            value: area.dot(flux.value),
            gradient,
            moment: lever.cross(gradient) + area.cross(flux.value),
        }
    };
    samples
        .par_iter()
        .map(one)
        .reduce(ContactSums::default, |a, b| ContactSums {
            value: a.value + b.value,
            gradient: a.gradient + b.gradient,
            moment: a.moment + b.moment,
        })
}

/// A pair whose parts are turned and shifted in their own frames.
struct Moved {
    parts: [TriangleMesh; 2],
    frames: [Pose; 2],
}

impl Moved {
    fn new((a, b): (TriangleMesh, TriangleMesh)) -> Self {
        let turn = |x, y, z| DQuat::from_scaled_axis(DVec3::new(x, y, z));
        let frames = [
            Pose(turn(0.4, -0.7, 1.1), DVec3::new(0.031, -0.012, 0.044)),
            Pose(turn(-1.3, 0.2, 0.5), DVec3::new(-0.018, 0.027, 0.009)),
        ];
        let [f, g] = frames;
        Self {
            parts: [a.transformed(f.0, f.1), b.transformed(g.0, g.1)],
            frames,
        }
    }

    /// The pose that brings the parts where `at` brings those of the pair.
    fn pose(&self, at: Pose) -> Pose {
        let [a, b] = self.frames;
        let turn = a.0 * at.0 * b.0.inverse();
        Pose(turn, a.0 * at.1 + a.1 - turn * b.1)
    }

    /// About the origin of the sampled part as it was, not that of the world.
    fn moment(&self, at: Pose, sums: &ContactSums) -> DVec3 {
        sums.moment - (at.0 * self.frames[1].1).cross(sums.gradient)
    }
}

/// Pressed against walls and tilted, at several depths; `k` counts.
fn contact(k: u32, clearance: f64) -> Pose {
    let at = |i: f64| (f64::from(k) * i + 0.3 * i * i).sin();
    let lean = DQuat::from_scaled_axis(DVec3::new(at(1.1), at(2.3), at(3.1)) * 0.02);
    let aside = DVec3::new(at(1.7), at(2.9), 0.0) * (clearance + 2e-4);
    Pose(lean, aside + DVec3::Z * 0.012 * (1.1 + at(0.9)))
}

/// Forces and torques of pairs in contact, rms over poses, in units of their own rms.
fn off(pair: (TriangleMesh, TriangleMesh), clearance: f64, distance: f64, width: f64) -> [f64; 2] {
    let moved = Moved::new(pair);
    let [a, b] = &moved.parts;
    let fast = ContactSum::new(a, b, width, distance).unwrap();
    let surface = ContactSurface::new(a, width);
    let samples = surface_samples(b, 0.35e-3).unwrap();
    let (mut errors, mut all) = ([0.0; 2], [0.0; 2]);
    for k in 0..8 {
        let at = moved.pose(contact(k, clearance));
        let (found, expected) = (fast.sum(at.0, at.1), slow(&surface, &samples, at));
        let moments = [&found, &expected].map(|s| moved.moment(at, s));
        errors[0] += found.gradient.distance_squared(expected.gradient);
        errors[1] += moments[0].distance_squared(moments[1]);
        all[0] += expected.gradient.length_squared();
        all[1] += moments[1].length_squared();
    }
    [0, 1].map(|i| f64::sqrt(errors[i] / all[i]))
}

/// Flat walls with edges and corners. What errs is the sampling: the slow sum's own is 0.4 %.
#[test]
fn flat_walls_push_as_in_the_slow_sum() {
    let clearance = 1e-4;
    let pair = PegInHole::Rectangular.pair(clearance).unwrap();
    let [force, torque] = off(pair, clearance, 1e-3, WIDTH);
    assert!(force < 0.008 && torque < 0.01, "{force} {torque}");
}

/// Round walls of flat facets, which the fast sum takes for a cylinder: facets stray from it by 0.7
/// % of the width, of which pressed parts feel 1 to 2 % at facets that are flush. The wider the
/// kernel, the less a wall resembles a plane when it is developed: walls of 3.8 widths' radius err
/// by 4 % where the parts are apart by half a width.
#[test]
fn round_walls_push_as_in_the_slow_sum() {
    let pairs = [
        (PegInHole::Circular, 1e-4),
        (PegInHole::Circular, 5e-4),
        (PegInHole::Combined, 1e-4),
    ];
    for (wider, bounds) in [
        (1.0, [0.02, 0.025]),
        (1.7, [0.03, 0.035]),
        (3.1, [0.05, 0.07]),
    ] {
        for (which, clearance) in pairs {
            let pair = which.pair(clearance).unwrap();
            let [force, torque] = off(pair, clearance, 1e-3 * wider, wider * WIDTH);
            let found = format!("{which:?} {clearance} {wider}: {force} {torque}");
            assert!(force < bounds[0] && torque < bounds[1], "{found}");
        }
    }
}

/// Walls and rounded edges that are bent more than that are taken as few flat faces: here by a pin
/// of 2.4 widths' radius, sampled more finely than walls are.
#[test]
fn narrow_bends_push_as_in_the_slow_sum() {
    let pin = |clearance: f64, segments: u32| {
        let peg = shapes::cylinder(0.002, 0.02, segments).unwrap();
        let hole: Vec<_> = (0..segments)
            .map(|i| f64::from(i) / f64::from(segments) * std::f64::consts::TAU)
            .map(|a| glam::DVec2::from_angle(a) * (0.002 + clearance))
            .collect();
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let block = corners.map(|(x, y)| glam::DVec2::new(x, y) * 0.006);
        let block = shapes::prism(&block, &[hole], 0.02).unwrap();
        (block, peg)
    };
    let bytes = [60, 240].map(|segments| {
        let pair = pin(1e-4, segments);
        let sum = ContactSum::new(&pair.0, &pair.1, WIDTH, 0.5e-3).unwrap();
        let [force, torque] = off(pair, 1e-4, 0.5e-3, WIDTH);
        assert!(
            force < 0.04 && torque < 0.04,
            "{segments}: {force} {torque}"
        );
        sum.bytes()
    });
    assert!(2 * bytes[1] < 3 * bytes[0], "{bytes:?}");
}

/// Where surfaces cross at any angle the sum is small beside that of walls that face each other,
/// and what samples miss of it is an eighth to a fifth, either way: the average over their extent
/// is neither more nor less than the middles', in all. Of the kink alone it would be less, by half
/// of the sum.
#[test]
fn samples_that_cross_a_surface_are_not_biased() {
    for section in PegInHole::ALL {
        let moved = Moved::new(section.pair(1e-4).unwrap());
        let [a, b] = &moved.parts;
        let sums = [1.7e-3, 0.4e-3].map(|d| ContactSum::new(a, b, WIDTH, d).unwrap());
        let poses = (0..200).into_par_iter().map(|k| {
            let at = |i: f64| (f64::from(k) * i + 0.3 * i * i).sin();
            let turn = DQuat::from_scaled_axis(DVec3::new(at(1.1), at(2.3), at(3.1)) * 0.7);
            let beside = DVec3::new(at(1.7), at(2.9), at(0.9)) * 6e-3;
            let at = moved.pose(Pose(turn, beside));
            [0, 1].map(|i| sums[i].sum(at.0, at.1).value)
        });
        let values: Vec<[f64; 2]> = poses.collect();
        let rms = (values.iter().map(|v| v[1] * v[1]).sum::<f64>() / 200.0).sqrt();
        let bias = values.iter().map(|v| v[0] - v[1]).sum::<f64>() / 200.0 / rms;
        let square: f64 = values.iter().map(|v| (v[0] - v[1]).powi(2)).sum();
        let off = (square / 200.0).sqrt() / rms;
        assert!(bias.abs() < 0.02 && off < 0.3, "{section:?}: {bias} {off}");
    }
}

fn differences(sum: &ContactSum, at: Pose, h: f64) -> [DVec3; 2] {
    let value = |turn: DVec3, shift: DVec3| {
        sum.sum(DQuat::from_scaled_axis(turn) * at.0, at.1 + shift)
            .value
    };
    let lever = 0.05;
    let gradient = DVec3::AXES.map(|e| value(DVec3::ZERO, e * h) - value(DVec3::ZERO, -e * h));
    let moment = DVec3::AXES.map(|e| {
        let turn = e * (h / lever);
        value(turn, DVec3::ZERO) - value(-turn, DVec3::ZERO)
    });
    [
        DVec3::from(gradient) / (2.0 * h),
        DVec3::from(moment) * lever / (2.0 * h),
    ]
}

/// How far slopes are from differences over steps of these lengths for force and torque, rms over
/// poses, in units of their own rms.
fn off_differences(
    sum: &ContactSum,
    poses: impl Iterator<Item = Pose>,
    steps: [f64; 2],
) -> [f64; 2] {
    let (mut errors, mut all) = ([0.0; 2], [0.0; 2]);
    for at in poses {
        let found = sum.sum(at.0, at.1);
        let [gradient, moment] = [0, 1].map(|i| differences(sum, at, steps[i])[i]);
        errors[0] += gradient.distance_squared(found.gradient);
        errors[1] += moment.distance_squared(found.moment);
        all[0] += found.gradient.length_squared();
        all[1] += found.moment.length_squared();
    }
    [0, 1].map(|i| f64::sqrt(errors[i] / all[i]))
}

/// Steps of half a micrometre: rounding to single precision leaves 1e-4 of the slopes, and a sample
/// that crosses an edge meanwhile, where slopes have a ridge, up to 2e-3 of one pose's. At so many
/// poses clusters pass from one cell of the surface's lists to the next, and samples past the ends
/// of boundary edges.
#[test]
fn slopes_are_those_of_differences() {
    let pairs = PegInHole::ALL.map(|s| s.pair(2e-4).unwrap());
    let ball = shapes::icosphere(0.01, 16).unwrap();
    let round = [
        (pairs[0].0.clone(), ball.clone()),
        (ball, pairs[0].1.clone()),
    ];
    for (i, pair) in pairs.into_iter().chain(round).enumerate() {
        let moved = Moved::new(pair);
        let [a, b] = &moved.parts;
        let sum = ContactSum::new(a, b, 1.2 * WIDTH, 2e-3).unwrap();
        let poses = (0..400).map(|k| moved.pose(contact(k, 2e-4)));
        let [force, torque] = off_differences(&sum, poses, [5e-7; 2]);
        println!("{i}: {force:.2e} {torque:.2e}");
        // A ball is pushed by little, and is a torus that is found anew from each cell.
        let [most, turned] = if i < 3 { [6e-4; 2] } else { [6e-3, 1e-2] };
        assert!(force < most && torque < turned, "{i}: {force} {torque}");
    }
}

/// Where boxes cross at any angle, samples are softened at boundary edges that they do not lie
/// along. Steps are as short as single precision bears: contact is small here, and rotations by as
/// much move all less.
#[test]
fn slopes_at_crossing_edges_are_those_of_differences() {
    let small = shapes::cuboid(DVec3::new(0.010, 0.012, 0.009)).unwrap();
    let large = shapes::cuboid(DVec3::new(0.018, 0.014, 0.016)).unwrap();
    let moved = Moved::new((large, small));
    let [a, b] = &moved.parts;
    let sum = ContactSum::new(a, b, 0.6 * WIDTH, 1e-3).unwrap();
    let poses = (0..60).map(|k| {
        let at = |i: f64| (f64::from(k) * i + 0.3 * i * i).sin();
        let turn = DQuat::from_scaled_axis(DVec3::new(at(1.1), at(2.3), at(3.1)) * 0.3);
        let beside = DVec3::new(3e-4 * at(1.7), 1e-3 * at(2.9), -6e-4 * at(0.9));
        moved.pose(Pose(turn, DVec3::X * 0.0135 + beside))
    });
    let [force, torque] = off_differences(&sum, poses, [1e-6, 4e-6]);
    assert!(force < 1.5e-3 && torque < 2.5e-3, "{force} {torque}");
}

/// A finely cut hole is the same cylinder, and not slower in kind: as many patches are visible.
#[test]
fn facets_are_forgotten() {
    let hole = |segments: u32| {
        let circle: Vec<_> = (0..segments)
            .map(|i| f64::from(i) / f64::from(segments) * std::f64::consts::TAU)
            .map(|a| glam::DVec2::from_angle(a) * 0.0101)
            .collect();
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let block = corners.map(|(x, y)| glam::DVec2::new(x, y) * 0.02);
        shapes::prism(&block, &[circle], 0.03).unwrap()
    };
    let peg = PegInHole::Circular.pair(0.0).unwrap().1;
    let sums = [128, 256].map(|n| ContactSum::new(&hole(n), &peg, 1.2 * WIDTH, 2e-3).unwrap());
    assert!(sums[1].bytes() < 2 * sums[0].bytes());
    for k in 0..6 {
        let at = contact(k, 1e-4);
        let [a, b] = [&sums[0], &sums[1]].map(|s| s.sum(at.0, at.1));
        let (off, all) = (a.gradient.distance(b.gradient), b.gradient.length());
        assert!(off < 0.02 * all, "{k}: {off} of {all}");
    }
}

/// Where walls are flush, rounding would put each sample on one side or the other; what is given is
/// the mean of the slopes to both sides, in any frame. Facets of round walls are micrometres apart
/// from the cylinder that they stand for: steps are longer there, and more of them may be off, most
/// of it where walls end.
#[test]
fn flush_walls_give_the_mean_of_both_slopes() {
    let motions = [
        (DQuat::IDENTITY, DVec3::ZERO),
        (DQuat::IDENTITY, DVec3::new(0.317e-3, 4.1, -0.73e-3)),
        (
            DQuat::from_scaled_axis(DVec3::new(0.3, -0.8, 0.5)),
            DVec3::new(-0.02, 0.013, 0.31),
        ),
    ];
    for (which, width, step, allowed) in [
        (PegInHole::Rectangular, 1.1, 1e-6, 1e-3),
        (PegInHole::Combined, 0.7, 1e-5, 0.03),
        (PegInHole::Circular, 0.7, 2e-5, 0.01),
    ] {
        let (hole, peg) = which.pair(0.0).unwrap();
        for (turn, shift) in motions {
            let moved = hole.transformed(turn, shift);
            let sum = ContactSum::new(&moved, &peg, width * WIDTH, 2e-3).unwrap();
            for k in 0..4 {
                // Along the hole walls stay flush.
                let place = DVec3::Z * (1.7e-3 * f64::from(k));
                let at = |d: DVec3| sum.sum(turn, turn * (place + d) + shift).gradient;
                for step in [DVec3::X * step, DVec3::Y * step] {
                    let (a, b, middle) = (at(step), at(-step), at(DVec3::ZERO));
                    let off = middle.distance(0.5 * (a + b));
                    assert!(
                        off < allowed * a.distance(b),
                        "{which:?} {k}: {off} {a} {b}"
                    );
                }
            }
        }
    }
}

/// Slivers, parts that are one another, flush, far away from the origin or touching in a line or a
/// point, and poses of any size.
#[test]
fn everything_is_finite() {
    let far = DVec3::new(1e4, -3e4, 2e4);
    let cube = shapes::cuboid(DVec3::splat(0.01)).unwrap();
    let sliver = shapes::cuboid(DVec3::new(0.02, 1e-7, 3e-5)).unwrap();
    let round = shapes::icosphere(0.006, 4).unwrap();
    let bodies = [&cube, &sliver, &round];
    for (i, a) in bodies.into_iter().enumerate() {
        let shifted = a.transformed(DQuat::IDENTITY, far);
        for b in [&cube, bodies[i]] {
            let sums = [(a, DVec3::ZERO), (&shifted, far)]
                .map(|(a, at)| (ContactSum::new(a, b, 1e-3, 2e-3).unwrap(), at));
            for (sum, origin) in &sums {
                for k in 0..300 {
                    let step = |n: u32| f64::from(k / n % 5) * 0.0025 - 0.005;
                    let turn = match k % 3 {
                        0 => DQuat::IDENTITY,
                        1 => DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4),
                        _ => DQuat::from_scaled_axis(DVec3::splat(f64::from(k))),
                    };
                    let shift = DVec3::new(step(1), step(5), step(25));
                    for shift in [shift, shift * 1e300, -shift * 1e-300] {
                        let found = sum.sum(turn, *origin + shift);
                        let finite = found.gradient.is_finite() && found.moment.is_finite();
                        assert!(finite && found.value.is_finite(), "{i} {k} {shift}");
                    }
                }
                let nowhere = sum.sum(DQuat::IDENTITY, DVec3::NAN);
                assert_eq!(nowhere, ContactSums::default());
            }
        }
    }
}

/// Two hundred thousand pieces of a bend, each in reach of some hundred places.
#[test]
fn a_long_shaft_in_fine_cells_pushes_as_a_short_one() {
    let width = 0.25e-3;
    let block = shapes::cuboid(DVec3::splat(4e-3)).unwrap();
    let turn = DQuat::from_scaled_axis(DVec3::new(0.1, 0.2, -0.3));
    let [long, short] = [90e-3, 14e-3].map(|length| {
        let shaft = shapes::cylinder(10e-3, length, 400).unwrap();
        let at = shaft.bounds().center() + DVec3::new(12.4e-3, 0.2e-3, 0.0);
        let sum = ContactSum::new(&shaft, &block, width, 2.0 * width).unwrap();
        sum.sum(turn, at)
    });
    println!("{long:?} {short:?}");
    assert!(short.gradient.x.abs() > 1e-8, "in contact");
    assert!((long.value - short.value).abs() < 1e-4 * short.value.abs());
    let off = long.gradient - short.gradient;
    assert!(off.length() < 1e-4 * short.gradient.length());
    let off = long.moment - short.moment;
    assert!(off.length() < 1e-4 * short.moment.length());
}

#[test]
fn what_cannot_be_summed_is_refused() {
    let cube = shapes::cuboid(DVec3::ONE).unwrap();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let width = ContactSum::new(&cube, &cube, bad, 0.1).err();
        assert!(matches!(width, Some(ContactError::Width { .. })), "{bad}");
        let distance = ContactSum::new(&cube, &cube, 0.1, bad).err();
        assert!(
            matches!(distance, Some(ContactError::Distance { .. })),
            "{bad}"
        );
    }
    for small in [1e-7, 1e-300] {
        let many = ContactSum::new(&cube, &cube, 0.1, small).err();
        assert!(
            matches!(many, Some(ContactError::TooMany { .. })),
            "{small}"
        );
    }
    assert!(ContactSum::new(&cube, &cube, 1e-300, 0.3).is_ok());
    assert!(ContactSum::new(&cube, &cube, 1e300, 0.3).is_ok());
}

/// To the last bit, whoever comes first: poses one by one, poses on all threads, or a box ahead of
/// them, which holds less than all; and where nothing may be kept.
#[test]
fn what_was_prepared_and_when_changes_no_sum() {
    for section in PegInHole::ALL {
        let moved = Moved::new(section.pair(1e-4).unwrap());
        let [a, b] = &moved.parts;
        let mut sums = [(); 5].map(|()| ContactSum::new(a, b, WIDTH, 1e-3).unwrap());
        let poses: Vec<Pose> = (0..24).map(|k| moved.pose(contact(k, 3e-4))).collect();
        let of = |sum: &ContactSum, at: &Pose| sum.sum(at.0, at.1);
        let expected: Vec<_> = poses.iter().map(|at| of(&sums[0], at)).collect();
        assert!(expected.iter().any(|sums| sums.value != 0.0));
        let at_once: Vec<_> = (poses.par_iter().rev())
            .map(|at| of(&sums[1], at))
            .collect();
        assert!(at_once.iter().rev().eq(&expected));
        let placed = |at: &Pose| b.transformed(at.0, at.1).bounds();
        sums[2].prepare(Some(&placed(&poses[0])));
        sums[3].prepare(None);
        let [asked, near, all] = [0, 2, 3].map(|i| sums[i].bytes());
        assert!(asked < all && near < all, "{asked} {near} {all}");
        assert_eq!(of(&sums[2], &poses[0]), expected[0]);
        // Nothing was left to prepare.
        assert_eq!(sums[2].bytes(), near);
        let prepared: Vec<_> = poses.iter().map(|at| of(&sums[3], at)).collect();
        assert_eq!(prepared, expected);
        assert_eq!(sums[3].bytes(), all);
        let least = sums[4].bytes();
        sums[4].visible.most_kept = 0;
        let passing: Vec<_> = poses.iter().map(|at| of(&sums[4], at)).collect();
        assert_eq!(passing, expected);
        assert_eq!(sums[4].bytes(), least);
    }
}

/// Along the insertion path samples pass the hole's rim. Those that pass together make ripple in the
/// force along the path, which is small beside that across: of points in rows along the rim whose middles
/// alone count, the round pair's errs by 0.23 of itself, and by 0.11 from one step to the next.
#[test]
fn the_force_along_the_insertion_path_has_no_ripple() {
    let spacing = WIDTH / 0.985;
    for section in PegInHole::ALL {
        let moved = Moved::new(section.pair(0.0).unwrap());
        let [a, b] = &moved.parts;
        let of = |distance: f64| ContactSum::new(a, b, WIDTH, distance).unwrap();
        let sums = [of(2.0 * spacing), of(0.4 * spacing)];
        let along = moved.frames[0].0 * DVec3::Z;
        for (aside, lean) in [(1e-4, 0.0), (4e-4, 0.0), (1e-4, 0.03)] {
            let lean = DQuat::from_scaled_axis(DVec3::new(lean, 0.4 * lean, 0.3 * lean));
            let forces = (0..200).into_par_iter().map(|i| {
                let aside = DVec3::new(aside, 0.5 * aside, 1e-4 * f64::from(i) - 4e-3);
                let at = moved.pose(Pose(lean, aside));
                [0, 1].map(|k| sums[k].sum(at.0, at.1).gradient.dot(along))
            });
            let forces: Vec<[f64; 2]> = forces.collect();
            let errors: Vec<f64> = forces.iter().map(|f| f[0] - f[1]).collect();
            let square: f64 = errors.iter().map(|e| e * e).sum();
            let all: f64 = forces.iter().map(|f| f[1] * f[1]).sum();
            let variation: f64 = errors.windows(2).map(|e| (e[1] - e[0]).abs()).sum();
            let total: f64 = forces.iter().map(|f| f[1].abs()).sum();
            let [error, ripple] = [(square / all).sqrt(), variation / total];
            println!("{section:?}: {error:.3} of the force, {ripple:.4} a step");
            assert!(
                error < 0.075 && ripple < 0.03,
                "{section:?}: {error} {ripple}"
            );
        }
    }
}
