//! What the simulated operator intends: the paper's two tests ("Haptic Experiments") and a free
//! wander.

use fft_correlate::{EnergySource, Pose};
use glam::{DQuat, DVec3};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::TriangleMesh;

/// Seconds from one push to the next.
const PUSH_PERIOD: f64 = 2.0;

/// Seconds from one release near the fit to the next.
const SNAP_PERIOD: f64 = 1.0;

/// Fractions of a snap period: wander until the first, approach until the second, then let go.
const SNAP_PHASES: (f64, f64) = (0.35, 0.55);

/// Strength of an operator that has let go.
const LOOSE: f64 = 0.02;

/// What the operator tries.
///
/// ```
/// use fft_correlate::Pose;
/// use glam::DVec3;
/// use haptic::{Geometry, Script};
///
/// let (seated, axis) = (Pose::IDENTITY, -DVec3::Z);
/// let geometry = Geometry { seated, axis, depth: 0.03, radius: 0.01, tilt: 0.08 };
/// // The intent after 1.5 s of 10 s; the same seed gives the same one.
/// let at = |seed| Script::Free.intent(&geometry, 1.5, 10.0, 0.002, seed);
/// assert_eq!(at(7).pose, at(7).pose);
/// assert_ne!(at(7).pose, at(8).pose);
/// assert!((0.0..=1.0).contains(&at(7).grip));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Script {
    /// Holds the part in the fit and pushes it about every two seconds in a random direction
    /// against the walls.
    Collision,
    /// Moves carelessly around the entrance, brings the part near the fit about every second and
    /// lets go. Stays let go after its last full second.
    Snap,
    /// Wanders around the entrance for ever.
    Free,
}

/// Where the fit is, in the scene.
///
/// See the example of [`Script`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    /// Pose of the moving part when assembled.
    pub seated: Pose,
    /// Unit direction in which the moving part travels to seat.
    pub axis: DVec3,
    /// Travel from the entrance to the seat, metres.
    pub depth: f64,
    /// Half width of the moving part across the axis, metres: how far the operator strays.
    pub radius: f64,
    /// How far the operator tilts the part when it is careless, radians.
    pub tilt: f64,
}

/// Where the operator wants the moving part, and how firmly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intent {
    /// Wanted pose of the moving part, scene frame.
    pub pose: Pose,
    /// 1 is a firm grip, 0 none.
    pub grip: f64,
}

impl Script {
    /// The intent `time` seconds after the start; the same seed gives the same intents. `reach` is
    /// how far the operator aims beyond a wall (metres, scene); `duration` is the script's length.
    pub fn intent(
        self,
        geometry: &Geometry,
        time: f64,
        duration: f64,
        reach: f64,
        seed: u64,
    ) -> Intent {
        match self {
            Self::Collision => collision(geometry, time, reach, seed),
            Self::Snap => snap(geometry, time, duration, seed),
            Self::Free => free(geometry, time, seed),
        }
    }
}

fn event_rng(seed: u64, index: f64) -> SmallRng {
    // A negative or huge index saturates; any value is a valid seed.
    SmallRng::seed_from_u64(seed ^ (index as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15))
}

/// A random direction, uniform on the sphere.
fn direction(rng: &mut SmallRng) -> DVec3 {
    let z: f64 = rng.random_range(-1.0..1.0);
    let angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
    let flat = (1.0 - z * z).sqrt();
    DVec3::new(flat * angle.cos(), flat * angle.sin(), z)
}

fn smooth(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * u * (u * (6.0 * u - 15.0) + 10.0)
}

fn collision(geometry: &Geometry, time: f64, reach: f64, seed: u64) -> Intent {
    let index = (time / PUSH_PERIOD).floor();
    let mut rng = event_rng(seed, index);
    let phase = time / PUSH_PERIOD - index;
    // Pushes rise and fall over three quarters of the period, at rest before and after.
    let push = (std::f64::consts::PI * ((phase - 0.2) / 0.75).clamp(0.0, 1.0)).sin();
    let mut pose = geometry.seated;
    pose.translation += direction(&mut rng) * (reach * push * push);
    Intent { pose, grip: 1.0 }
}

/// A careless place about the entrance.
fn careless_pose(geometry: &Geometry, rng: &mut SmallRng) -> Pose {
    random_pose(geometry, rng, 0.7..1.1, 1.0)
}

fn random_pose(
    geometry: &Geometry,
    rng: &mut SmallRng,
    withdrawn: std::ops::Range<f64>,
    careless: f64,
) -> Pose {
    let side = direction(rng).reject_from_normalized(geometry.axis) * geometry.radius;
    let back = geometry.axis * (geometry.depth * rng.random_range(withdrawn));
    let tilt = direction(rng) * (geometry.tilt * rng.random_range(0.0..1.0) * careless);
    Pose {
        rotation: DQuat::from_scaled_axis(tilt) * geometry.seated.rotation,
        translation: geometry.seated.translation + side * careless - back,
    }
}

fn snap(geometry: &Geometry, time: f64, duration: f64, seed: u64) -> Intent {
    let last = ((duration / SNAP_PERIOD).floor() - 1.0).max(0.0);
    let index = (time / SNAP_PERIOD).floor().clamp(0.0, last);
    let phase = time / SNAP_PERIOD - index;
    let near = |index| random_pose(geometry, &mut event_rng(seed, index), 0.05..0.3, 0.2);
    let far = careless_pose(geometry, &mut event_rng(!seed, index));
    let to = near(index);
    let (wander, approach) = SNAP_PHASES;
    if phase < wander {
        let from = if index > 0.0 { near(index - 1.0) } else { far };
        let share = smooth(phase / wander);
        Intent {
            pose: interpolate(&from, &far, share),
            grip: LOOSE + (1.0 - LOOSE) * smooth(2.0 * share),
        }
    } else {
        let share = smooth((phase - wander) / (approach - wander));
        let loose = smooth((phase - approach) / 0.05);
        Intent {
            pose: interpolate(&far, &to, share),
            grip: LOOSE + (1.0 - LOOSE) * (1.0 - loose),
        }
    }
}

fn free(geometry: &Geometry, time: f64, seed: u64) -> Intent {
    let mut rng = event_rng(seed, 0.0);
    let mut wave = |amplitude: f64| -> f64 {
        (0..3)
            .map(|_| {
                let rate: f64 = rng.random_range(0.1..0.7);
                let start: f64 = rng.random_range(0.0..1.0);
                (std::f64::consts::TAU * (rate * time + start)).sin() * amplitude / 3.0
            })
            .sum()
    };
    let side = geometry.axis.any_orthonormal_vector();
    let other = geometry.axis.cross(side);
    let offset = side * wave(geometry.radius)
        + other * wave(geometry.radius)
        + geometry.axis * (wave(geometry.depth) - 0.7 * geometry.depth);
    let tilt = DVec3::new(
        wave(geometry.tilt),
        wave(geometry.tilt),
        wave(geometry.tilt),
    );
    Intent {
        pose: Pose {
            rotation: DQuat::from_scaled_axis(tilt) * geometry.seated.rotation,
            translation: geometry.seated.translation + offset,
        },
        grip: 1.0,
    }
}

fn interpolate(from: &Pose, to: &Pose, share: f64) -> Pose {
    from.perturbed(&(from.twist_to(to) * share))
}

/// How far a careless operator tilts the part, radians.
const CARELESS_TILT: f64 = 0.08;

impl Geometry {
    /// The insertion path of `moving` into its fit at `seated`: along `axis` (unit, fixed frame) over `depth`
    /// metres. An axis that is not given is the coordinate direction along which the part can be
    /// withdrawn with the least climb in energy; a depth that is not is the part's extent along it.
    pub fn from_fit(
        source: &dyn EnergySource,
        moving: &TriangleMesh,
        seated: Pose,
        axis: Option<DVec3>,
        depth: Option<f64>,
    ) -> Self {
        let size = moving
            .transformed(seated.rotation, DVec3::ZERO)
            .bounds()
            .size();
        let axis = axis.unwrap_or_else(|| -easiest_removal(source, &seated, size));
        let along = axis.abs().dot(size);
        let across = size.length_squared() - along * along;
        Self {
            seated,
            axis,
            depth: depth.unwrap_or(along),
            radius: 0.25 * (0.5 * across.max(0.0)).sqrt(),
            tilt: CARELESS_TILT,
        }
    }
}

/// Climbs that differ by less than this share of the depth of the fit are alike: a part symmetric
/// front to back differs by rounding only.
const ALIKE: f64 = 1e-3;

/// Of the six coordinate directions, the one along which the removal path's highest energy is lowest; the
/// first such one of +z, -z, +y, -y, +x, -x.
fn easiest_removal(source: &dyn EnergySource, seated: &Pose, size: DVec3) -> DVec3 {
    const STEPS: u32 = 60;
    let mut scratch = source.scratch();
    let depth = source.evaluate(seated, &mut scratch).energy.abs();
    let mut climb = |direction: DVec3| {
        let reach = direction.abs().dot(size);
        (1..=STEPS)
            .map(|i| {
                let away = direction * (reach * f64::from(i) / f64::from(STEPS));
                let pose = Pose {
                    translation: seated.translation + away,
                    ..*seated
                };
                source.evaluate(&pose, &mut scratch).energy
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let mut best = (climb(DVec3::Z), DVec3::Z);
    for direction in [DVec3::NEG_Z, DVec3::Y, DVec3::NEG_Y, DVec3::X, DVec3::NEG_X] {
        let energy = climb(direction);
        if energy < best.0 - ALIKE * depth {
            best = (energy, direction);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn geometry() -> Geometry {
        Geometry {
            seated: Pose::from_translation(DVec3::new(0.1, 0.0, 0.0)),
            axis: DVec3::NEG_Z,
            depth: 0.03,
            radius: 0.01,
            tilt: 0.05,
        }
    }

    #[test]
    fn intents_are_continuous_and_repeatable() {
        for script in [Script::Collision, Script::Snap, Script::Free] {
            let intent = |t: f64| script.intent(&geometry(), t, 10.0, 0.01, 7);
            for tick in 1..12_000 {
                let (a, b) = (intent((tick - 1) as f64 * 1e-3), intent(tick as f64 * 1e-3));
                let step = (b.pose.translation - a.pose.translation).length();
                // 0.6 m/s is a brisk hand.
                assert!(step < 6e-4, "{script:?} {tick} {step}");
                assert!((0.0..=1.0 + 1e-12).contains(&a.grip));
            }
            assert_eq!(intent(3.3), intent(3.3));
        }
    }

    #[test]
    fn the_snap_script_ends_let_go_near_the_fit() {
        let geometry = geometry();
        for seed in 0..20 {
            let end = Script::Snap.intent(&geometry, 10.9, 10.5, 0.0, seed);
            assert!(end.grip <= LOOSE + 1e-12);
            let away = end.pose.translation - geometry.seated.translation;
            assert!(away.length() < 0.35 * geometry.depth);
        }
    }

    #[test]
    fn collision_pushes_go_every_way() {
        let geometry = geometry();
        let mut sum = DVec3::ZERO;
        for k in 0..400 {
            let top =
                Script::Collision.intent(&geometry, PUSH_PERIOD * (k as f64 + 0.575), 1e9, 1.0, 3);
            let push = top.pose.translation - geometry.seated.translation;
            assert!((push.length() - 1.0).abs() < 1e-3);
            sum += push;
        }
        // 400 unit vectors: the mean is within 4 standard deviations of zero.
        assert!(sum.length() / 400.0 < 4.0 / 20.0);
    }
}

#[cfg(test)]
mod insertion_tests {
    use fft_correlate::{
        DirectEvaluator, DirectOptions, PairBuilder, Response, ScoreModel, Scratch,
    };
    use glam::DQuat;
    use sdf_grid::{Silent, shapes};

    use super::*;

    /// Uphill in all directions but -y.
    struct Gutter;

    impl EnergySource for Gutter {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            let t = pose.translation;
            Response {
                energy: t.x.abs() + t.z.abs() + t.y.max(0.0),
                ..Response::default()
            }
        }
    }

    #[test]
    fn the_way_in_is_against_the_easiest_removal() {
        let part = shapes::cuboid(DVec3::new(0.01, 0.03, 0.02)).unwrap();
        let found = Geometry::from_fit(&Gutter, &part, Pose::IDENTITY, None, None);
        assert_eq!(found.axis, DVec3::Y);
        assert!((found.depth - 0.03).abs() < 1e-12, "{}", found.depth);
        let given = Geometry::from_fit(&Gutter, &part, Pose::IDENTITY, Some(DVec3::Z), Some(0.5));
        assert_eq!((given.axis, given.depth), (DVec3::Z, 0.5));
    }

    /// A hole open at both ends that lies along an axis: of two equal removal paths, the first.
    #[test]
    fn a_part_goes_into_its_hole_along_the_hole() {
        let (hole, peg) = shapes::PegInHole::Rectangular.pair(0.0).unwrap();
        let builder = PairBuilder {
            spacing: Some(0.004),
            ..PairBuilder::default()
        };
        for (turn, axis) in [
            (DQuat::IDENTITY, DVec3::NEG_Z),
            (DQuat::from_rotation_arc(DVec3::Z, DVec3::X), DVec3::NEG_X),
            (DQuat::from_rotation_arc(DVec3::Z, DVec3::Y), DVec3::NEG_Y),
        ] {
            let [hole, peg] = [&hole, &peg].map(|mesh| mesh.transformed(turn, DVec3::ZERO));
            let pair = builder
                .build(&hole, &peg, &ScoreModel::GUIDED, &Silent)
                .unwrap();
            let source = DirectEvaluator::new(&pair, &DirectOptions::REAL_TIME).unwrap();
            let found = Geometry::from_fit(&source, &peg, Pose::IDENTITY, None, None);
            assert_eq!(found.axis, axis);
            assert!((found.depth - 0.03).abs() < 1e-9, "{}", found.depth);
        }
    }
}
