//! Straight scans of an energy around a pose.

use glam::{DQuat, DVec3};
use serde::Serialize;

use crate::energy::{EnergySource, Scratch};
use crate::geometry::se3::{Pose, Twist};

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
    /// Highest energy on the path above the minimum, as a fraction of the depth: 1 for a free way
    /// out, more for a wall.
    pub escape: f64,
    /// Where it is, metres.
    pub escape_at: f64,
    /// Largest climb on the way in, as a fraction of the depth: 0 for a funnel.
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
pub(super) struct Around<'a> {
    pub(super) source: &'a dyn EnergySource,
    pub(super) scratch: Scratch,
    pub(super) base: Pose,
    pub(super) pivot: DVec3,
}

/// Displacement of the pivot and rotation vector about it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Step {
    pub(super) turn: DVec3,
    pub(super) shift: DVec3,
}

impl Around<'_> {
    pub(super) fn pose(&self, step: Step) -> Pose {
        let rotation = DQuat::from_scaled_axis(step.turn) * self.base.rotation;
        let pivot = self.base.apply(self.pivot) + step.shift;
        Pose::new(rotation, pivot - rotation * self.pivot)
    }

    pub(super) fn energy(&mut self, step: Step) -> f64 {
        self.source
            .evaluate(&self.pose(step), &mut self.scratch)
            .energy
    }

    /// Energy and the force (torque) along a unit twist through the pivot.
    fn along(&mut self, step: Step, axis: Step) -> (f64, f64) {
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
    pub(super) fn far_energy(&mut self) -> f64 {
        self.energy(Step {
            shift: DVec3::splat(1e6),
            ..Step::default()
        })
    }

    /// Compass search: try each axis both ways, halve the step when nothing is lower. Slow but at
    /// home on V-shaped energies, where gradients mislead.
    pub(super) fn descend(&mut self, length: f64, radius: f64) -> Step {
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

    pub(super) fn axis(&mut self, axis: Step, length: f64, reach: f64) -> Axis {
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
            let restoring = -self.along(at, outwards).1;
            if restoring > side.peak {
                (side.peak, side.convex) = (restoring, s);
            } else if restoring < -0.01 * side.peak && s > length {
                side.attraction = s;
                break;
            }
        }
        side
    }

    pub(super) fn barrier(
        &mut self,
        direction: DVec3,
        [reach, length]: [f64; 2],
        far: f64,
    ) -> Barrier {
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
pub(super) fn axes(radius: f64) -> [Step; 6] {
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
