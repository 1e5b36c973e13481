//! Tables of closed-form energies against the closed form, and against themselves where that says
//! more: gradients, seams, symmetry, edges.

use std::f64::consts::{FRAC_PI_4, TAU};

use crate::common::*;
use fft_correlate::{AxisSymmetry, EnergyTable, Pose, RotationDomain, RotationGrid, Side, Twist};
use glam::{DQuat, DVec3};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

/// rms errors of energy, force and torque over random poses inside the table, relative to the rms
/// of the exact values.
fn errors(
    energy: &Gaussians,
    table: &EnergyTable,
    half: f64,
    mut rotation: impl FnMut(&mut SmallRng) -> DQuat,
) -> [f64; 3] {
    let mut rng = SmallRng::seed_from_u64(5);
    let pairs: Vec<_> = (0..2000)
        .map(|_| {
            let pose = pose(rotation(&mut rng), vector(&mut rng) * half);
            (energy.exact(&pose), table.respond(&pose))
        })
        .collect();
    assert!(pairs.iter().all(|(_, t)| (t.coverage - 1.0).abs() < 1e-12));
    [
        rms(pairs.iter().map(|(e, t)| e.energy - t.energy)) / rms(pairs.iter().map(|p| p.0.energy)),
        rms(pairs
            .iter()
            .map(|(e, t)| (e.wrench.force - t.wrench.force).length()))
            / rms(pairs.iter().map(|p| p.0.wrench.force.length())),
        rms(pairs
            .iter()
            .map(|(e, t)| (e.wrench.torque - t.wrench.torque).length()))
            / rms(pairs.iter().map(|p| p.0.wrench.torque.length())),
    ]
}

/// Splines err by the fourth power of the spacing in energy and the third in wrench; along
/// rotations, whose coefficients are not quite theirs, finer steps gain a little less. Half precision would end it: 2.4e-4 of
/// the energy, over a step in the wrench.
#[test]
fn error_shrinks_with_spacing_at_the_expected_order() {
    let energy = Gaussians::random(1);
    let within = |rng: &mut SmallRng| rotation_within(rng, 20f64.to_radians());
    let at = |step: f64| {
        let spec = spec(window(0.5, step / 80.0), RotationDomain::ball(20.0, step));
        errors(&energy, &table(&energy, spec), 0.5, within)
    };
    let (coarse, fine) = (at(20.0), at(10.0));
    println!("{coarse:?} -> {fine:?}");
    for (k, least) in [2.3, 2.3, 2.3].into_iter().enumerate() {
        let order = (coarse[k] / fine[k]).log2();
        assert!(order > least, "{k}: order {order}");
    }
}

/// Difference between the wrench and fourth-order central differences of the energy over random
/// poses, relative to the largest wrench met: 90th percentile and worst. Energies are sums in single
/// precision, 1e-7 of the range, over steps of 2e-3: 5e-5. The second
/// derivative jumps at cell faces, so the few differences taken across one err by that times the
/// step.
pub(crate) fn gradient_error(
    table: &EnergyTable,
    poses: usize,
    mut sample: impl FnMut(&mut SmallRng) -> Pose,
) -> [f64; 2] {
    let mut rng = SmallRng::seed_from_u64(9);
    let (mut errors, mut scale) = (Vec::new(), 0f64);
    for _ in 0..poses {
        let pose = sample(&mut rng);
        let wrench = table.respond(&pose).wrench;
        scale = scale.max(wrench.force.length()).max(wrench.torque.length());
        let direction = Twist {
            angular: vector(&mut rng),
            linear: vector(&mut rng),
        };
        let at = |s: f64| table.respond(&pose.perturbed(&(direction * s))).energy;
        let h = 2e-3;
        let slope = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
        errors.push((wrench.dot(&direction) + slope).abs());
    }
    errors.sort_by(f64::total_cmp);
    [errors[poses * 9 / 10] / scale, errors[poses - 1] / scale]
}

pub(crate) fn is_gradient([typical, worst]: [f64; 2]) -> bool {
    typical < 1e-4 && worst < 5e-3
}

#[test]
fn wrench_is_the_energys_gradient_inside_across_edges_and_seams() {
    let energy = Gaussians::random(2);
    let w = window(0.6, 0.15);
    let domains = [
        RotationDomain::ball(110.0, 15.0),
        RotationDomain::full(22.5),
        RotationDomain::Spin {
            center: DQuat::from_rotation_x(0.4).to_array(),
            axis: [0.1, 0.2, 0.7],
            range_deg: None,
            step_deg: 12.0,
        },
        RotationDomain::Spin {
            center: [0.0, 0.0, 0.0, 1.0],
            axis: [0.0, 0.0, 1.0],
            range_deg: Some([-60.0, 20.0]),
            step_deg: 10.0,
        },
    ];
    for domain in domains {
        let mut spec = spec(w, domain.clone());
        spec.far_energy = 0.3;
        let table = table(&energy, spec);
        // Up to 2 nodes beyond every edge, so the fading margins are met too.
        let error = gradient_error(&table, 1500, |rng| {
            let q = match &domain {
                RotationDomain::Spin { center, axis, .. } => {
                    let axis = DVec3::from_array(*axis).normalize();
                    rotation_within(rng, 0.3)
                        * DQuat::from_axis_angle(axis, rng.random_range(0.0..TAU))
                        * DQuat::from_array(*center)
                }
                RotationDomain::Ball { angle_deg, .. } => {
                    rotation_within(rng, (angle_deg + 20.0).to_radians())
                }
                _ => rotation(rng),
            };
            pose(q, vector(rng) * 0.9)
        });
        println!("{domain:?}: {error:?}");
        assert!(is_gradient(error), "{domain:?}: {error:?}");
    }
}

#[test]
fn symmetric_tables_agree_with_the_closed_form_everywhere_and_stay_conservative() {
    for part in [Side::Moving, Side::Fixed] {
        for order in [0, 3, 4] {
            let symmetry = symmetry(part, order);
            let energy = Gaussians::symmetric(3, &symmetry);
            let half = 0.25;
            // Both domains for any turn, one for each of the finite orders.
            let domains = [RotationDomain::ball(50.0, 10.0), RotationDomain::full(22.5)];
            let chosen = match order {
                0 => 0..2,
                3 => 1..2,
                _ => 0..1,
            };
            for domain in domains[chosen].iter().cloned() {
                let full_set = matches!(domain, RotationDomain::Full { .. });
                let plain = RotationGrid::new(&domain, None).unwrap().nodes().len();
                let mut spec = spec(window(0.75, 0.25), domain);
                spec.symmetry = Some(symmetry);
                let table = table(&energy, spec);
                let turn = |rng: &mut SmallRng| {
                    let angle = match order {
                        0 => rng.random_range(0.0..TAU),
                        n => TAU * f64::from(rng.random_range(0..n)) / f64::from(n),
                    };
                    DQuat::from_axis_angle(DVec3::from_array(symmetry.axis).normalize(), angle)
                };
                let images = |rng: &mut SmallRng| {
                    let q = if full_set {
                        rotation(rng)
                    } else {
                        rotation_within(rng, 0.85)
                    };
                    match part {
                        Side::Moving => q * turn(rng),
                        Side::Fixed => turn(rng) * q,
                    }
                };
                // The fold moves the pivot by up to twice its distance from the axis, 0.13, and turns
                // displacements of up to 0.43.
                let error = errors(&energy, &table, half, images);
                let slope = gradient_error(&table, 400, |rng| {
                    let q = images(rng);
                    pose(q, vector(rng) * half)
                });
                let nodes = table.grid().nodes().len();
                println!(
                    "{part:?} C{order} full {full_set}: {nodes} of {plain} nodes, \
                     errors {error:?}, gradient {slope:?}"
                );
                // Steps of 10 and 22.5 degrees against energies 0.8 wide at radius 1.7: the plain
                // table's own error at this step, measured 2 % in energy and 8 % in wrench.
                assert!(error[0] < 0.03 && error[1] < 0.1 && error[2] < 0.15);
                // Energies of all the copies add up while their wrenches mostly cancel, so rounding
                // weighs three times as much as in the tables without symmetry.
                assert!(is_gradient(slope.map(|s| s / 3.0)));
            }
        }
    }
}

/// At a step as fine as contact needs, a symmetry of order n leaves about one node in n (nodes beyond
/// the seams cost the rest), a body of revolution only a surface.
#[test]
fn symmetry_leaves_nodes_out() {
    let nodes = |domain: RotationDomain, symmetry: Option<AxisSymmetry>| {
        RotationGrid::new(&domain, symmetry.as_ref())
            .unwrap()
            .nodes()
            .len() as f64
    };
    for (domain, orders) in [
        (RotationDomain::full(6.0), vec![4, 8]),
        (RotationDomain::ball(90.0, 6.0), vec![]),
    ] {
        let plain = nodes(domain.clone(), None);
        for part in [Side::Moving, Side::Fixed] {
            for &order in &orders {
                let share = nodes(domain.clone(), Some(symmetry(part, order))) / plain;
                println!("{domain:?} {part:?} C{order}: {share:.2} of {plain}");
                assert!(share < 0.35 + 1.0 / f64::from(order));
            }
            assert!(nodes(domain.clone(), Some(symmetry(part, 0))) < 0.04 * plain);
        }
    }
}

/// Energy and wrench do not jump: two poses 1e-9 apart, on both sides of every kind of face there
/// is, differ by single-precision rounding (1e-7 of the range times the sum's condition).
#[test]
fn energy_and_wrench_are_continuous_across_seams_and_faces() {
    let energy = Gaussians::random(4);
    let table = table(
        &energy,
        spec(window(0.45, 0.15), RotationDomain::full(22.5)),
    );
    let mut rng = SmallRng::seed_from_u64(6);
    let half_step = FRAC_PI_4 / 4.0;
    let centers = [
        DQuat::IDENTITY,
        DQuat::from_rotation_x(TAU / 2.0),
        DQuat::from_rotation_y(TAU / 2.0),
        DQuat::from_rotation_z(TAU / 2.0),
    ];
    let (mut low, mut high, mut wrench, mut jump, mut turn) = (0f64, 0f64, 0f64, 0f64, 0f64);
    for n in 0..100_000 {
        // A face of a cell: a seam, an edge of its blending zone, or between two cells.
        let faces = [4.0, 3.0, 5.0, rng.random_range(-4..=4) as f64];
        let face = faces[n % 4] * half_step;
        let axis = n % 3;
        let mut x = [0f64; 3].map(|_| rng.random_range(-1.0..1.0) * FRAC_PI_4);
        let center = centers[rng.random_range(0..4)];
        let displacement = vector(&mut rng) * 0.5;
        let mut at = |offset: f64| {
            x[axis] = face + offset;
            let u = x.map(f64::tan);
            let q = DQuat::from_xyzw(u[0], u[1], u[2], 1.0).normalize() * center;
            table.respond(&pose(q, displacement))
        };
        let (a, b) = (at(-1e-9), at(1e-9));
        (low, high) = (low.min(a.energy), high.max(a.energy));
        wrench = wrench.max(a.wrench.force.length().max(a.wrench.torque.length()));
        jump = jump.max((a.energy - b.energy).abs());
        let change = a.wrench - b.wrench;
        turn = turn.max(change.force.length().max(change.torque.length()));
    }
    println!(
        "jumps: energy {:.1e}, wrench {:.1e}",
        jump / (high - low),
        turn / wrench
    );
    assert!(jump < 1e-6 * (high - low));
    // Slopes per node are larger than the wrench by the sum's condition; within the window alone
    // it is 2e-6.
    assert!(turn < 5e-6 * wrench);
}

/// Work around closed loops through cells, seams and margins: the trapezoidal rule on a smooth loop
/// with a once differentiable force errs by the square of the step, nothing else is left.
#[test]
fn work_around_closed_loops_vanishes() {
    let energy = Gaussians::random(7);
    let table = table(
        &energy,
        spec(window(0.45, 0.15), RotationDomain::ball(40.0, 8.0)),
    );
    let mut rng = SmallRng::seed_from_u64(8);
    for _ in 0..10 {
        let (a, b, c) = (vector(&mut rng), vector(&mut rng), vector(&mut rng));
        let steps = 4000;
        let at = |i: usize| {
            let s = TAU * i as f64 / steps as f64;
            let turn = 0.5 * (a * s.cos() + b * (2.0 * s).sin());
            pose(
                DQuat::from_scaled_axis(turn),
                0.5 * (b * s.sin() + c * (s.cos() - 0.5)),
            )
        };
        let (mut work, mut total) = (0.0, 0.0);
        for i in 0..steps {
            let (p, q) = (at(i), at(i + 1));
            let mean = (table.respond(&p).wrench + table.respond(&q).wrench) * 0.5;
            let part = mean.dot(&p.twist_to(&q));
            work += part;
            total += part.abs();
        }
        println!("loop work {work:.1e} of {total:.1e}");
        assert!(work.abs() < 1e-5 * total);
    }
}

#[test]
fn a_list_answers_at_its_rotations_and_fades_away_from_them() {
    let energy = Gaussians::random(14);
    let rotations = [DQuat::IDENTITY, DQuat::from_rotation_x(1.0)];
    let domain = RotationDomain::List {
        rotations: rotations.map(|q| q.to_array()).to_vec(),
        margin_deg: 10.0,
    };
    let table = table(&energy, spec(window(0.6, 0.1), domain));
    for q in rotations {
        let p = pose(q, DVec3::new(0.03, -0.12, 0.21));
        let (exact, found) = (energy.exact(&p), table.respond(&p));
        assert!((exact.energy - found.energy).abs() < 2e-3 * exact.energy.abs().max(1.0));
        assert!((exact.wrench.force - found.wrench.force).length() < 0.02);
        // No torque about the pivot: the nodes say nothing about turning.
        let about_pivot = found.wrench.about(q * PIVOT);
        assert!(about_pivot.torque.length() < 1e-9);
        assert_eq!(found.coverage, 1.0);
        let turned = pose(DQuat::from_rotation_z(5f64.to_radians()) * q, DVec3::ZERO);
        assert!((table.respond(&turned).coverage - 0.5).abs() < 1e-9);
    }
    let error = gradient_error(&table, 500, |rng| {
        pose(rotation_within(rng, 0.2), vector(rng) * 0.7)
    });
    assert!(is_gradient(error), "{error:?}");
}
