//! The numbers of an energy well against energies whose wells are known, and the decisions of the
//! pair builder.

use fft_correlate::pair::{default_halo, default_spacing};
use fft_correlate::peak_force;
use fft_correlate::{
    EnergySource, PairBuildError, PairBuilder, Pose, Response, ScoreModel, Scratch, Well,
    WellError, WellOptions, Wrench,
};
use glam::{DQuat, DVec3};
use sdf_grid::{Lattice, shapes};

/// `-depth exp(-|d|² / (2 width²)) exp(-(1 - cos(turn)) sharpness)`, d from `centre`.
struct Bowl {
    depth: f64,
    width: f64,
    sharpness: f64,
    centre: DVec3,
}

impl EnergySource for Bowl {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let d = pose.translation - self.centre;
        // 1 - cos(turn) = 2 |v|² for the quaternion's vector part v = axis sin(turn / 2).
        let v = pose.rotation.xyz();
        let turned = (-2.0 * self.sharpness * v.length_squared()).exp();
        let energy =
            -self.depth * (-d.length_squared() / (2.0 * self.width.powi(2))).exp() * turned;
        Response {
            energy,
            wrench: Wrench {
                torque: energy * 2.0 * self.sharpness * pose.rotation.w * v,
                force: energy * d / self.width.powi(2),
            },
            coverage: 1.0,
        }
    }
}

const BOWL: Bowl = Bowl {
    depth: 2.0,
    width: 0.003,
    sharpness: 4.0,
    centre: DVec3::new(0.0002, -0.0004, 0.0001),
};

fn options() -> WellOptions {
    WellOptions {
        length: 1e-4,
        radius: 0.01,
        reach: 0.012,
        pivot: DVec3::ZERO,
        directions: vec![DVec3::X, DVec3::NEG_Z * 3.0],
    }
}

#[test]
fn a_bowl_has_the_numbers_of_its_formula() {
    let well = Well::analyse(&BOWL, &Pose::IDENTITY, &options()).expect("a well");
    let near = |found: f64, expected: f64, relative: f64, what: &str| {
        assert!(
            (found / expected - 1.0).abs() < relative,
            "{what}: {found}, not {expected}"
        );
    };
    let position = DVec3::from_array(well.position);
    assert!(position.distance(BOWL.centre) < 5e-6, "{position}");
    assert_eq!(well.far_energy, 0.0);
    near(well.depth, 2.0, 1e-5, "depth");
    for axis in well.translations {
        near(axis.stiffness, 2.0 / 0.003f64.powi(2), 1e-2, "stiffness");
        for side in axis.sides {
            // The force of a Gaussian peaks at its width; a scan steps by half the length.
            near(side.convex, 0.003, 0.03, "convex");
            near(side.peak, 2.0 / 0.003 * (-0.5f64).exp(), 1e-2, "peak");
            assert_eq!(side.attraction, 0.012);
        }
    }
    for axis in well.rotations {
        near(axis.stiffness, 2.0 * 4.0, 1e-2, "rotational stiffness");
    }
    for barrier in well.barriers {
        near(barrier.escape, 1.0, 1e-9, "escape");
        assert!(barrier.entry < 1e-9);
    }
}

/// A wall between two wells: the path out of the shallow one climbs, and finds a deeper place.
#[test]
fn a_wall_and_what_lies_behind_it_are_reported() {
    struct Walled;
    impl EnergySource for Walled {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }
        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            let bump = |height: f64, at: f64| {
                let d = pose.translation - DVec3::X * at;
                height * (-d.length_squared() / (2.0 * 0.001f64.powi(2))).exp()
            };
            Response {
                energy: bump(-1.0, 0.0) + bump(0.5, 0.005) + bump(-1.2, 0.010),
                ..Response::default()
            }
        }
    }
    let well = Well::analyse(&Walled, &Pose::IDENTITY, &options()).expect("a well");
    let [out, down] = [well.barriers[0], well.barriers[1]];
    assert!((out.escape - 1.5).abs() < 0.01, "{out:?}");
    assert!((out.escape_at - 0.005).abs() < 2e-4, "{out:?}");
    assert!((out.beyond + 0.2).abs() < 0.01, "{out:?}");
    // On the path in from +x the second well comes first: out of it and over the wall.
    assert!((out.entry - 1.7).abs() < 0.01, "{out:?}");
    assert!(
        (down.escape - 1.0).abs() < 0.01 && down.entry < 0.01,
        "{down:?}"
    );
}

#[test]
fn wells_that_are_not_there_are_refused() {
    let hill = Bowl {
        depth: -1.0,
        centre: DVec3::ZERO,
        ..BOWL
    };
    let far = Pose::from_translation(DVec3::splat(1.0));
    for (source, pose) in [(&hill, Pose::IDENTITY), (&BOWL, far)] {
        let refused = Well::analyse(source, &pose, &options());
        assert!(
            matches!(refused, Err(WellError::NoWell { .. })),
            "{refused:?}"
        );
    }
    let bad = WellOptions {
        reach: f64::NAN,
        ..options()
    };
    let refused = Well::analyse(&BOWL, &Pose::IDENTITY, &bad);
    assert!(matches!(
        refused,
        Err(WellError::Option { name: "reach", .. })
    ));
}

#[test]
fn the_peak_force_of_a_bowl_is_found_where_it_is() {
    let bowl = Bowl {
        centre: DVec3::ZERO,
        ..BOWL
    };
    let window = DVec3::splat(0.010);
    let exact = 2.0 / 0.003 * (-0.5f64).exp();
    let (peak, place) = peak_force(&bowl, &Pose::IDENTITY, window);
    assert!((peak / exact - 1.0).abs() < 1e-3, "{peak} is not {exact}");
    assert!((place.length() - 0.003).abs() < 1e-4, "{place}");
    let far = Pose::from_translation(DVec3::splat(1.0));
    assert_eq!(peak_force(&bowl, &far, window).0, 0.0);
}

#[test]
fn plans_cover_both_parts_and_stay_affordable() {
    let block = shapes::cuboid(DVec3::new(0.04, 0.04, 0.03)).expect("a block");
    let peg = shapes::cuboid(DVec3::new(0.02, 0.02, 0.03)).expect("a peg");
    let peg = peg.transformed(DQuat::IDENTITY, DVec3::new(0.0, 0.0, 0.0123));
    let model = ScoreModel::GUIDED;
    let plan = PairBuilder::default()
        .plan(&block, &peg, &model)
        .expect("a plan");
    let (a, b) = (block.bounds(), peg.bounds());
    let halo = default_halo(&model, &block, &peg);
    assert!((halo - 0.375 * b.diagonal()).abs() < 1e-12);
    assert_eq!(plan.density.halo, halo);
    assert_eq!(plan.spacing(), default_spacing(&block, &peg, halo));
    // A twenty-fourth of 20 mm, however both lie.
    assert_eq!(plan.spacing(), 8.3e-4);
    let turned = [(0.7, -1.9, 0.4), (-0.3, 0.5, 1.4)].map(|v| DQuat::from_scaled_axis(v.into()));
    let [block_turned, peg_turned] = [(&block, turned[0]), (&peg, turned[1])]
        .map(|(part, turn)| part.transformed(turn, DVec3::new(0.3, 0.01, -0.2)));
    assert_eq!(default_spacing(&block_turned, &peg_turned, halo), 8.3e-4);
    // What moves does not matter, but which is smaller.
    assert_eq!(default_spacing(&peg, &block, halo), 8.3e-4);
    // As fine as the sheet is thin, as far as memory goes.
    let sheet = shapes::plate(0.03, 4e-4).expect("a sheet");
    let fine = default_spacing(&block, &sheet, 0.01);
    let grown = [&block, &sheet].map(|part| part.bounds().grown(0.01).size().element_product());
    let nodes = (grown[0] + grown[1]) / fine.powi(3);
    assert!((5e6..=6e6).contains(&nodes), "{fine}: {nodes}");
    let covers = |lattice: &Lattice, bounds: sdf_grid::Aabb| {
        let cells = lattice.node_bounds().grown(0.5 * lattice.spacing());
        let wanted = bounds.grown(halo - 1e-9);
        cells.contains(wanted.min) && cells.contains(wanted.max)
    };
    assert!(covers(&plan.fixed_lattice, a) && covers(&plan.moving_lattice, b));
    let nodes = plan.fixed_lattice.len() + plan.moving_lattice.len();
    assert!((100_000..8_000_000).contains(&nodes), "{nodes}");
    let corner = plan.pivot / plan.spacing();
    assert!((corner - corner.round()).length() < 1e-9);
    assert!(plan.pivot.distance(b.center()) < plan.spacing());
    assert!(default_halo(&ScoreModel::PAPER, &block, &peg) == 0.04);
}

#[test]
fn plans_that_cannot_be_are_refused_before_allocating() {
    let block = shapes::cuboid(DVec3::splat(0.04)).expect("a block");
    let plan = |builder: PairBuilder| builder.plan(&block, &block, &ScoreModel::GUIDED);
    let small = plan(PairBuilder {
        memory_limit: Some(1_000_000),
        ..PairBuilder::default()
    });
    assert!(
        matches!(small, Err(PairBuildError::Memory { needed, limit: 1_000_000, .. }) if needed > 1_000_000)
    );
    for spacing in [0.0, -1.0, f64::NAN, 1e-12] {
        let refused = plan(PairBuilder {
            spacing: Some(spacing),
            ..PairBuilder::default()
        });
        assert!(matches!(
            refused,
            Err(PairBuildError::Lattice { part: "fixed", .. })
        ));
    }
    let no_halo = plan(PairBuilder {
        halo: Some(0.0),
        ..PairBuilder::default()
    });
    assert!(matches!(no_halo, Err(PairBuildError::Density { .. })));
}
