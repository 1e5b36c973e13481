use super::*;

/// A field of its own, along x.
struct Field<F: Fn(f64) -> (f64, f64) + Send + Sync>(F);

impl<F: Fn(f64) -> (f64, f64) + Send + Sync> EnergySource for Field<F> {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _scratch: &mut Scratch) -> Response {
        let (energy, force) = (self.0)(pose.translation.x);
        Response {
            energy,
            wrench: Wrench {
                force: DVec3::new(force, 0.0, 0.0),
                ..Wrench::ZERO
            },
            coverage: 1.0,
        }
    }
}

const DT: f64 = 1e-3;

/// A ball that steps as a simulation steps it: position and velocity along x, and the greatest sum
/// of its energies over the first.
fn run(
    source: &dyn EnergySource,
    mass: f64,
    start: [f64; 2],
    pull: f64,
    steps: usize,
) -> ([f64; 2], f64) {
    let mut force = BodyForce::new(source.scratch());
    let mut mobility = [[0.0; 6]; 6];
    for (k, row) in mobility.iter_mut().enumerate() {
        row[k] = if k < 3 { 1e5 / mass } else { 1.0 / mass };
    }
    let [mut x, mut v] = start;
    let along = |v: f64| Twist {
        angular: DVec3::ZERO,
        linear: DVec3::new(v, 0.0, 0.0),
    };
    let (mut first, mut rise): (Option<f64>, f64) = (None, 0.0);
    for _ in 0..steps {
        let held = source.evaluate(
            &Pose::from_translation(DVec3::new(x, 0.0, 0.0)),
            &mut source.scratch(),
        );
        let total = held.energy + 0.5 * mass * v * v - pull * mass * x;
        rise = rise.max(total - *first.get_or_insert(total));
        let step = force.step(
            source,
            &BodyState {
                part: Pose::from_translation(DVec3::new(x, 0.0, 0.0)),
                center: DVec3::ZERO,
                twist: along(v),
                free: along(v + pull * DT),
                mobility,
                dt: DT,
                elapsed: DT,
            },
        );
        v += (step.wrench.force.x / mass + pull) * DT;
        x += v * DT;
        let there = source.evaluate(
            &Pose::from_translation(DVec3::new(x, 0.0, 0.0)),
            &mut source.scratch(),
        );
        assert!((there.energy - step.energy).abs() < 1e-9);
    }
    ([x, v], rise)
}

#[test]
fn a_body_of_any_mass_stays_in_a_kink() {
    let kink = Field(|x: f64| (5.0 * x.abs(), -5.0 * x.signum()));
    for mass in [0.001, 0.02, 1.0] {
        let ([x, v], rise) = run(&kink, mass, [2e-3, 0.0], 0.0, 3000);
        assert!(
            x.abs() < 1e-5 && v.abs() < 1e-2,
            "{mass} kg: {x} m, {v} m/s"
        );
        assert!(rise < 1e-9, "{mass} kg: {rise} J");
    }
}

/// A field that bends down, as beside a funnel, where the implicit step alone gains.
#[test]
fn no_energy_is_made_where_the_field_bends_down() {
    let wave = Field(|x: f64| {
        let a = 1500.0 * x;
        (4e-3 * a.cos(), 6.0 * a.sin())
    });
    for mass in [0.001, 0.005, 0.02, 0.1] {
        for start in [[1e-5, 0.0], [3e-4, 0.3], [-2e-3, 1.7]] {
            let ([_, v], rise) = run(&wave, mass, start, 0.0, 2000);
            assert!(
                rise < 1e-9 && v.is_finite(),
                "{mass} kg, {start:?}: {rise} J"
            );
        }
    }
}

#[test]
fn nothing_is_felt_where_the_energy_is_level() {
    let step = Field(|x: f64| if x < 0.0 { (-1e-2, 0.0) } else { (0.0, 0.0) });
    let ([x, v], rise) = run(&step, 0.1, [0.5, 0.0], 9.81, 1000);
    assert!((v - 9.81).abs() < 1e-9 && x > 5.0 && rise < 1e-1);
}

/// 20 g that hang in a well of 2 kN/m lie where weight and slope balance.
#[test]
fn a_weight_hangs_where_the_slope_carries_it() {
    let well = Field(|x: f64| (1000.0 * x * x, -2000.0 * x));
    let ([x, v], _) = run(&well, 0.02, [0.0, 0.0], 9.81, 4000);
    let expected = 0.02 * 9.81 / 2000.0;
    assert!(
        (x - expected).abs() < 1e-3 * expected && v.abs() < 1e-6,
        "{x} {v}"
    );
}

/// A body that was put somewhere else owes nothing for it.
#[test]
fn a_body_that_was_moved_by_hand_is_not_braked() {
    let slope = Field(|x: f64| (2.0 * x, -2.0));
    let mut force = BodyForce::new(slope.scratch());
    let mut mobility = [[0.0; 6]; 6];
    for (k, row) in mobility.iter_mut().enumerate() {
        row[k] = 10.0;
    }
    let mut at = |x: f64, v: f64| {
        let twist = Twist {
            angular: DVec3::ZERO,
            linear: DVec3::new(v, 0.0, 0.0),
        };
        let body = BodyState {
            part: Pose::from_translation(DVec3::new(x, 0.0, 0.0)),
            center: DVec3::ZERO,
            twist,
            free: twist,
            mobility,
            dt: DT,
            elapsed: DT,
        };
        force.step(&slope, &body).wrench.force.x
    };
    at(0.0, 0.1);
    let found = at(0.5, 0.1);
    assert!((found + 2.0).abs() < 1e-6, "{found}");
}
