//! How far apart poses are, in square roots of joules: by springs, or by inertia over a step.

use fft_correlate::{Twist, Wrench};
use glam::DVec3;

/// Scaled coordinates: angular part first.
pub(crate) type Six = [f64; 6];

pub(crate) fn dot(a: &Six, b: &Six) -> f64 {
    (0..6).map(|i| a[i] * b[i]).sum()
}

/// What makes lengths and angles comparable.
// One of each path, and the loop allocates nothing.
#[expect(clippy::large_enum_variant)]
#[derive(Debug, Clone, Copy)]
pub(crate) enum Metric {
    /// The stiffnesses of a linear and an angular spring.
    Springs(Springs),
    /// What a body's inertia holds against a motion within one step.
    Inertia(Inertia),
}

/// Square roots of stiffnesses.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Springs {
    /// √(N·m/rad).
    angular: f64,
    /// √(N/m).
    linear: f64,
    /// Leave rotations out.
    lock_rotation: bool,
}

/// The lower factor of `dt² A`, with `A` the twist that a wrench gives per second.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Inertia([[f64; 6]; 6]);

impl Metric {
    pub(crate) fn new(rotational_stiffness: f64, stiffness: f64, lock_rotation: bool) -> Self {
        Self::Springs(Springs {
            angular: rotational_stiffness.sqrt(),
            linear: stiffness.sqrt(),
            lock_rotation,
        })
    }

    /// Whether rotations are left out.
    pub(crate) fn locks_rotation(&self) -> bool {
        matches!(self, Self::Springs(springs) if springs.lock_rotation)
    }

    pub(crate) fn scaled(&self, twist: &Twist) -> Six {
        match self {
            Self::Springs(springs) => springs.six(twist.angular, twist.linear, 1.0),
            Self::Inertia(inertia) => inertia.solve(&six(twist.angular, twist.linear)),
        }
    }

    pub(crate) fn twist(&self, y: &Six) -> Twist {
        match self {
            Self::Springs(springs) => Twist {
                angular: DVec3::new(y[0], y[1], y[2]) / springs.angular,
                linear: DVec3::new(y[3], y[4], y[5]) / springs.linear,
            },
            Self::Inertia(inertia) => {
                let [a, b, c, x, y, z] = inertia.apply(y);
                Twist {
                    angular: DVec3::new(a, b, c),
                    linear: DVec3::new(x, y, z),
                }
            }
        }
    }

    pub(crate) fn gradient(&self, wrench: &Wrench) -> Six {
        match self {
            Self::Springs(springs) => springs.six(-wrench.torque, -wrench.force, -1.0),
            Self::Inertia(inertia) => inertia.transposed(&six(-wrench.torque, -wrench.force)),
        }
    }
}

fn six(angular: DVec3, linear: DVec3) -> Six {
    [
        angular.x, angular.y, angular.z, linear.x, linear.y, linear.z,
    ]
}

impl Springs {
    /// Times or, with a negative `power`, over the roots of the stiffnesses.
    fn six(&self, angular: DVec3, linear: DVec3, power: f64) -> Six {
        let angular = match self.lock_rotation {
            true => DVec3::ZERO,
            false if power > 0.0 => angular * self.angular,
            false => angular / self.angular,
        };
        let linear = match power > 0.0 {
            true => linear * self.linear,
            false => linear / self.linear,
        };
        six(angular, linear)
    }
}

impl Inertia {
    /// Of the twist per second that a wrench gives (torque and angular part first), over `dt`
    /// seconds. What cannot be moved at all is moved by next to nothing.
    pub(crate) fn new(mobility: &[[f64; 6]; 6], dt: f64) -> Self {
        /// 1 / (kg m²) and 1 / kg of what stands still.
        const LEAST: [f64; 2] = [1e-3, 1e-6];
        /// Share of a direction's own mobility that rounding may take.
        const ROUNDING: f64 = 1e-9;
        let mut l = [[0.0; 6]; 6];
        for i in 0..6 {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
                let rest = mobility[i][j] - known;
                l[i][j] = match i == j {
                    true => rest.max(ROUNDING * mobility[i][i]).max(LEAST[i / 3]).sqrt(),
                    false => rest / l[j][j],
                };
            }
        }
        Self(l.map(|row| row.map(|x| x * dt)))
    }

    fn apply(&self, y: &Six) -> Six {
        std::array::from_fn(|i| (0..=i).map(|k| self.0[i][k] * y[k]).sum())
    }

    fn transposed(&self, x: &Six) -> Six {
        std::array::from_fn(|i| (i..6).map(|k| self.0[k][i] * x[k]).sum())
    }

    fn solve(&self, x: &Six) -> Six {
        let mut y = [0.0; 6];
        for i in 0..6 {
            let known: f64 = (0..i).map(|k| self.0[i][k] * y[k]).sum();
            y[i] = (x[i] - known) / self.0[i][i];
        }
        y
    }

    /// The wrench that holds against a displacement.
    pub(crate) fn wrench(&self, displacement: &Twist) -> Wrench {
        let y = self.solve(&six(displacement.angular, displacement.linear));
        let mut w = [0.0; 6];
        for i in (0..6).rev() {
            let known: f64 = (i + 1..6).map(|k| self.0[k][i] * w[k]).sum();
            w[i] = (y[i] - known) / self.0[i][i];
        }
        Wrench {
            torque: DVec3::new(w[0], w[1], w[2]),
            force: DVec3::new(w[3], w[4], w[5]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 20 g box that turns about an axis askew, seen from a point beside its middle.
    fn mobility() -> [[f64; 6]; 6] {
        let arm = [
            [1.0, 0.2, -0.1, 0.0, 0.03, -0.01],
            [0.2, 1.4, 0.3, -0.03, 0.0, 0.02],
            [-0.1, 0.3, 0.8, 0.01, -0.02, 0.0],
            [0.0, -0.03, 0.01, 0.9, 0.0, 0.0],
            [0.03, 0.0, -0.02, 0.0, 1.1, 0.0],
            [-0.01, 0.02, 0.0, 0.0, 0.0, 1.0],
        ];
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let size = |k: usize| if k < 3 { 700.0 } else { 7.0 };
                arm[i][j] * size(i) * size(j)
            })
        })
    }

    #[test]
    fn inertia_moves_by_half_a_square_of_the_step() {
        let (a, dt) = (mobility(), 1e-3);
        let inertia = Inertia::new(&a, dt);
        let metric = Metric::Inertia(inertia);
        let wrench = Wrench {
            torque: DVec3::new(0.02, -0.01, 0.03),
            force: DVec3::new(1.0, -2.0, 3.0),
        };
        let w = six(wrench.torque, wrench.force);
        let moved: Six = std::array::from_fn(|i| (0..6).map(|j| dt * dt * a[i][j] * w[j]).sum());
        // The scaled coordinates are least where the energy's slope and the inertia balance.
        let found = metric.twist(&metric.gradient(&(wrench * -1.0)));
        let back = inertia.wrench(&found);
        for (found, moved) in six(found.angular, found.linear).iter().zip(&moved) {
            assert!((found - moved).abs() < 1e-12 * moved.abs().max(1e-6));
        }
        assert!((back.force - wrench.force).length() < 1e-9);
        assert!((back.torque - wrench.torque).length() < 1e-9);
        let y = [0.1, -0.2, 0.3, 0.4, -0.5, 0.6];
        for (a, b) in metric.scaled(&metric.twist(&y)).iter().zip(&y) {
            assert!((a - b).abs() < 1e-12);
        }
    }

    #[test]
    fn what_cannot_move_is_not_moved() {
        let mut a = [[0.0; 6]; 6];
        a[5][5] = 1.0 / 0.02;
        let metric = Metric::Inertia(Inertia::new(&a, 1e-3));
        let pushed = metric.twist(&metric.gradient(&Wrench {
            torque: DVec3::ONE,
            force: DVec3::splat(-5.0),
        }));
        assert!((pushed.linear.z - 5.0 * 1e-6 / 0.02).abs() < 1e-12);
        assert!(pushed.linear.x.abs() < 1e-11 && pushed.angular.length() < 1e-8);
    }
}
