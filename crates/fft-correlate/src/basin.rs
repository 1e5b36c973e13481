//! Analysis of the energy well (basin) about a pose: depth, stiffness, barriers.

use glam::{DQuat, DVec3};
use serde::Serialize;

use crate::energy::{EnergySource, Scratch};
use crate::geometry::se3::{Pose, Twist};

/// Options of [`Well::analyse`].
///
/// See the example of [`Well`].
#[derive(Debug, Clone, PartialEq)]
pub struct WellOptions {
    /// Length over which stiffness is measured, metres: at zero clearance the energy is V-shaped
    /// and its second derivative exists only over a length. The lattice spacing is a good choice.
    pub length: f64,
    /// Length of a lever that turns lengths into angles (`angle = length / radius`), metres: the
    /// moving part's bounding radius about its pivot.
    pub radius: f64,
    /// How far scans reach from the minimum, metres; rotations reach `min(reach / radius, pi)`.
    pub reach: f64,
    /// Point of the moving part about which rotations turn, metres in its frame.
    pub pivot: DVec3,
    /// Directions, in the fixed frame, along which barriers are reported. Need not be unit.
    pub directions: Vec<DVec3>,
}

/// A minimum of the energy and its surroundings. Axes are those of the fixed frame; rotations turn
/// about the pivot.
///
/// ```
/// use fft_correlate::*;
/// use glam::DVec3;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
/// let well = Well::analyse(&source, &Pose::IDENTITY, &WellOptions {
///     length: 0.004,
///     radius: 0.02,
///     reach: 0.05,
///     pivot: pair.pivot(),
///     directions: vec![DVec3::X, DVec3::Z],
/// })?;
/// assert!(well.depth > 0.0 && well.translations[0].stiffness > 0.0);
/// // Shares of the depth: a wall along x, the way out along z.
/// assert!(well.barriers[0].escape > 1.2 && well.barriers[1].escape < 1.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Well {
    /// Where the energy is lowest: position of the moving part's origin, metres.
    pub position: [f64; 3],
    /// Its rotation there, quaternion x, y, z, w.
    pub rotation: [f64; 4],
    /// Displacement of the pivot from the given pose, metres.
    pub offset: [f64; 3],
    /// Rotation vector from the given pose, radians.
    pub turn: [f64; 3],
    /// Energy at the minimum, joules.
    pub energy: f64,
    /// Energy out of reach, joules.
    pub far_energy: f64,
    /// `far_energy - energy`, joules.
    pub depth: f64,
    /// Length of the stiffness measurement, metres.
    pub length: f64,
    /// Along x, y, z.
    pub translations: [Axis; 3],
    /// About x, y, z.
    pub rotations: [Axis; 3],
    /// Along [`WellOptions`]' directions.
    pub barriers: Vec<Barrier>,
}

impl Well {
    /// Finds the minimum near `pose` and measures the well around it.
    ///
    /// # Errors
    /// If an option is out of range, or the energy near `pose` is no lower than far away.
    pub fn analyse(
        source: &dyn EnergySource,
        pose: &Pose,
        options: &WellOptions,
    ) -> Result<Self, WellError> {
        options.validate()?;
        let mut around = LocalEnergy {
            source,
            scratch: source.scratch(),
            base: *pose,
            pivot: options.pivot,
        };
        // The minimum, which must lie below the far energy.
        let far_energy = around.far_energy();
        let lowest = around.descend(options.length, options.radius);
        around.base = around.pose(lowest);
        let energy = around.energy(Step::default());
        if energy.partial_cmp(&far_energy) != Some(std::cmp::Ordering::Less) {
            return Err(WellError::NoWell {
                minimum: energy,
                far: far_energy,
            });
        }
        let WellOptions {
            length,
            radius,
            reach,
            ..
        } = *options;
        // Scans along and about all axes, then along the directions for barriers.
        let turn_reach = (reach / radius).min(std::f64::consts::PI);
        let [x, y, z, rx, ry, rz] = axes(1.0);
        let mut axis = |a, length, reach| around.axis(a, length, reach);
        let translations = [x, y, z].map(|a| axis(a, length, reach));
        let rotations = [rx, ry, rz].map(|a| axis(a, length / radius, turn_reach));
        let directions = options.directions.iter();
        let barriers = directions
            .map(|d| around.barrier(d.normalize(), [reach, length], far_energy))
            .collect();
        Ok(Self {
            position: around.base.translation.to_array(),
            rotation: around.base.rotation.to_array(),
            offset: lowest.shift.to_array(),
            turn: lowest.turn.to_array(),
            energy,
            far_energy,
            depth: far_energy - energy,
            length,
            translations,
            rotations,
            barriers,
        })
    }
}

impl WellOptions {
    fn validate(&self) -> Result<(), WellError> {
        let lengths = [
            ("length", self.length),
            ("radius", self.radius),
            ("reach", self.reach),
        ];
        for (name, found) in lengths {
            if !(found.is_finite() && found > 0.0) {
                return Err(WellError::Option {
                    name,
                    expected: "positive and finite",
                    found,
                });
            }
        }
        let usable = |v: &DVec3| v.is_finite() && v.length() > 0.0;
        match self.directions.iter().position(|d| !usable(d)) {
            Some(which) => Err(WellError::Option {
                name: "directions",
                expected: "finite and not zero",
                found: self.directions[which].length(),
            }),
            None => Ok(()),
        }
    }
}

/// The largest force on straight scans along x, y and z through `assembled`, to `window` metres
/// either way and without rotation: walls, floor and mouth all count. Newtons, and where: the
/// displacement from `assembled`, metres. 100 poses per half axis.
pub fn peak_force(source: &dyn EnergySource, assembled: &Pose, window: DVec3) -> (f64, DVec3) {
    const STEPS: i32 = 100;
    let mut scratch = source.scratch();
    let (mut peak, mut place) = (0.0, DVec3::ZERO);
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for i in -STEPS..=STEPS {
            let displacement = axis * window * (f64::from(i) / f64::from(STEPS));
            let pose = Pose {
                translation: assembled.translation + displacement,
                ..*assembled
            };
            let force = source.evaluate(&pose, &mut scratch).wrench.force.length();
            if force > peak {
                (peak, place) = (force, displacement);
            }
        }
    }
    (peak, place)
}

/// The well along one translation (metres, newtons) or about one rotation (radians, newton
/// metres).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Axis {
    /// `(E(s) + E(-s) - 2 E(0)) / s²` with s the stated length or angle, N/m or N·m/rad.
    pub stiffness: f64,
    /// Towards negative and towards positive displacements.
    pub sides: [AxisSide; 2],
}

/// One side of an [`Axis`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AxisSide {
    /// Largest restoring force or torque before the attraction ends, N or N·m.
    pub peak: f64,
    /// Where it is: up to there the energy curves upwards, so this is the paper's radius of the
    /// constraint. Metres or radians, positive.
    pub convex: f64,
    /// Where the energy first stops rising (the force turns outwards) for good measure of 1 % of
    /// the peak; the reach if it never does. Metres or radians, positive.
    pub attraction: f64,
}

/// A straight path from the minimum outwards, without rotation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Barrier {
    /// Unit direction, fixed frame.
    pub direction: [f64; 3],
    /// Highest energy on the path above the minimum, as a fraction of the depth: 1 for a free
    /// removal path, more for a wall.
    pub escape: f64,
    /// Where it is, metres.
    pub escape_at: f64,
    /// Largest climb on the path in, as a fraction of the depth: 0 for a funnel.
    pub entry: f64,
    /// Lowest energy beyond the highest point above the minimum, as a fraction of the depth;
    /// negative if a deeper place lies behind the wall.
    pub beyond: f64,
}

/// Points of a scan: fine enough to see features of a length, few enough to stay cheap.
fn scan_points(reach: f64, length: f64) -> usize {
    ((2.0 * reach / length).ceil() as usize).clamp(40, 2000)
}

/// An energy source at poses counted from a base pose by pivot displacement and rotation vector.
struct LocalEnergy<'a> {
    source: &'a dyn EnergySource,
    scratch: Scratch,
    base: Pose,
    pivot: DVec3,
}

/// Displacement of the pivot and rotation vector about it.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    turn: DVec3,
    shift: DVec3,
}

impl LocalEnergy<'_> {
    fn pose(&self, step: Step) -> Pose {
        let rotation = DQuat::from_scaled_axis(step.turn) * self.base.rotation;
        let pivot = self.base.apply(self.pivot) + step.shift;
        Pose::new(rotation, pivot - rotation * self.pivot)
    }

    fn energy(&mut self, step: Step) -> f64 {
        self.source
            .evaluate(&self.pose(step), &mut self.scratch)
            .energy
    }

    /// Energy and the force (torque) along a unit twist through the pivot.
    fn energy_and_force(&mut self, step: Step, axis: Step) -> (f64, f64) {
        let pose = self.pose(step);
        let response = self.source.evaluate(&pose, &mut self.scratch);
        let twist = Twist {
            angular: axis.turn,
            // A turn about the pivot carries the origin with it.
            linear: axis.shift - axis.turn.cross(pose.rotation * self.pivot),
        };
        (response.energy, response.wrench.dot(&twist))
    }

    /// Far outside any reach; sources go to their far value there.
    fn far_energy(&mut self) -> f64 {
        self.energy(Step {
            shift: DVec3::splat(1e6),
            ..Step::default()
        })
    }

    /// Compass search: try each axis both ways, halve the step when nothing is lower. Slow but at
    /// home on V-shaped energies, where gradients mislead.
    fn descend(&mut self, length: f64, radius: f64) -> Step {
        let axes = axes(radius);
        let mut best = Step::default();
        let mut lowest = self.energy(best);
        let mut stride = 4.0 * length;
        let mut moves = 0;
        while stride > length / 64.0 && moves < 2000 {
            let tries = axes.iter().flat_map(|a| [(a, stride), (a, -stride)]);
            let mut next = None;
            for (axis, s) in tries {
                let step = best.plus(axis, s);
                let energy = self.energy(step);
                if energy < lowest {
                    (lowest, next) = (energy, Some(step));
                }
            }
            match next {
                Some(step) => (best, moves) = (step, moves + 1),
                None => stride *= 0.5,
            }
        }
        best
    }

    fn axis(&mut self, axis: Step, length: f64, reach: f64) -> Axis {
        let zero = Step::default();
        let centre = self.energy(zero);
        let ends = self.energy(zero.plus(&axis, length)) + self.energy(zero.plus(&axis, -length));
        Axis {
            stiffness: (ends - 2.0 * centre) / length.powi(2),
            sides: [-1.0, 1.0].map(|sign| self.side(zero.plus(&axis, sign), length, reach)),
        }
    }

    fn side(&mut self, outwards: Step, length: f64, reach: f64) -> AxisSide {
        let n = scan_points(reach, length);
        let mut side = AxisSide {
            peak: 0.0,
            convex: 0.0,
            attraction: reach,
        };
        for i in 1..=n {
            let s = reach * i as f64 / n as f64;
            let at = Step::default().plus(&outwards, s);
            let restoring = -self.energy_and_force(at, outwards).1;
            if restoring > side.peak {
                (side.peak, side.convex) = (restoring, s);
            } else if restoring < -0.01 * side.peak && s > length {
                side.attraction = s;
                break;
            }
        }
        side
    }

    fn barrier(&mut self, direction: DVec3, [reach, length]: [f64; 2], far: f64) -> Barrier {
        let n = scan_points(reach, length);
        let at = |i: usize| reach * i as f64 / n as f64;
        let mut energies: Vec<f64> = (0..=n)
            .map(|i| {
                self.energy(Step {
                    shift: at(i) * direction,
                    ..Step::default()
                })
            })
            .collect();
        // The path ends where nothing acts any more.
        energies.push(far);
        let minimum = energies[0];
        let depth = far - minimum;
        let highest = (0..energies.len())
            .max_by(|&a, &b| energies[a].total_cmp(&energies[b]))
            .unwrap_or(0);
        let (mut lowest, mut entry) = (far, 0.0f64);
        for &e in energies.iter().rev() {
            lowest = lowest.min(e);
            entry = entry.max(e - lowest);
        }
        let beyond = energies[highest..].iter().copied().fold(far, f64::min);
        Barrier {
            direction: direction.to_array(),
            escape: (energies[highest] - minimum) / depth,
            escape_at: at(highest),
            entry: entry / depth,
            beyond: (beyond - minimum) / depth,
        }
    }
}

impl Step {
    fn plus(self, axis: &Self, s: f64) -> Self {
        Self {
            turn: self.turn + s * axis.turn,
            shift: self.shift + s * axis.shift,
        }
    }
}

/// Translations along and rotations about x, y, z; a rotation by `1 / radius` counts as a metre.
fn axes(radius: f64) -> [Step; 6] {
    let e = [DVec3::X, DVec3::Y, DVec3::Z];
    std::array::from_fn(|a| {
        if a < 3 {
            Step {
                shift: e[a],
                ..Step::default()
            }
        } else {
            Step {
                turn: e[a - 3] / radius,
                ..Step::default()
            }
        }
    })
}

/// Why a well cannot be analysed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WellError {
    /// An option is out of range.
    #[error("well option {name} must be {expected}, found {found}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its accepted range.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// The energy is no lower at the minimum found than far away.
    #[error("no well here: energy {minimum} J at its lowest, {far} J far away")]
    NoWell {
        /// Lowest energy found near the pose, joules.
        minimum: f64,
        /// Energy far away, joules.
        far: f64,
    },
}
