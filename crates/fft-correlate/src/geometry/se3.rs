//! Rigid motions: poses, twists and wrenches.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// A rigid motion `p -> rotation * p + translation` from the moving part's frame to the fixed
/// part's frame.
///
/// ```
/// use std::f64::consts::FRAC_PI_2;
///
/// use fft_correlate::Pose;
/// use glam::{DQuat, DVec3};
///
/// // A quarter turn about z, then 1 cm up.
/// let pose = Pose::new(DQuat::from_rotation_z(FRAC_PI_2), DVec3::new(0.0, 0.0, 0.01));
/// assert!((pose.apply(DVec3::X) - DVec3::new(0.0, 1.0, 0.01)).length() < 1e-12);
/// assert!((pose.angle_to(&Pose::IDENTITY) - FRAC_PI_2).abs() < 1e-12);
/// let back = pose.inverse() * pose;
/// assert!(back.translation.length() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Unit quaternion, stored and printed `x, y, z, w`.
    pub rotation: DQuat,
    /// Position of the moving part's origin in the fixed frame, metres.
    pub translation: DVec3,
}

/// An infinitesimal motion in the fixed frame, angular part first.
///
/// ```
/// use fft_correlate::{Pose, Twist};
/// use glam::DVec3;
///
/// let twist = Twist { angular: DVec3::Z * 0.1, linear: DVec3::X * 0.002 };
/// let pose = Pose::from_translation(DVec3::Y).perturbed(&twist);
/// // Turned about its own origin, which moves by the linear part only.
/// assert_eq!(pose.translation, DVec3::new(0.002, 1.0, 0.0));
/// let found = Pose::from_translation(DVec3::Y).twist_to(&pose);
/// assert!((found.angular - twist.angular).length() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Twist {
    /// Radians (or rad/s).
    pub angular: DVec3,
    /// Metres (or m/s), of the moving part's origin.
    pub linear: DVec3,
}

/// A torque and force on the moving part in the fixed frame, angular part first as the paper's
/// (T, F).
///
/// ```
/// use fft_correlate::{Twist, Wrench};
/// use glam::DVec3;
///
/// let load = Wrench { force: DVec3::Z * 5.0, ..Wrench::ZERO };
/// // 5 N with a lever of 0.1 m.
/// assert!((load.about(DVec3::X * 0.1).torque - DVec3::Y * 0.5).length() < 1e-12);
/// // Lifted by 1 cm it does 0.05 J of work.
/// let lifted = Twist { angular: DVec3::ZERO, linear: DVec3::Z * 0.01 };
/// assert!((load.dot(&lifted) - 0.05).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wrench {
    /// About the moving part's origin, newton metres.
    pub torque: DVec3,
    /// Newtons.
    pub force: DVec3,
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Pose {
    /// The assembled pose of parts modelled in place.
    pub const IDENTITY: Self = Self {
        rotation: DQuat::IDENTITY,
        translation: DVec3::ZERO,
    };

    /// A pose from its two parts; the quaternion is normalized.
    pub fn new(rotation: DQuat, translation: DVec3) -> Self {
        Self {
            rotation: rotation.normalize(),
            translation,
        }
    }

    /// A pure translation, metres.
    pub fn from_translation(translation: DVec3) -> Self {
        Self {
            rotation: DQuat::IDENTITY,
            translation,
        }
    }

    /// Maps a point of the moving part into the fixed frame.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// The motion that undoes this one.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Self {
            rotation,
            translation: -(rotation * self.translation),
        }
    }

    /// This motion after `twist`, both about the moving part's origin in the fixed frame: the
    /// rotation is `exp(angular) * rotation`, the translation grows by `linear`. This is the
    /// perturbation against which wrenches are gradients.
    #[must_use]
    pub fn perturbed(&self, twist: &Twist) -> Self {
        Self {
            rotation: (DQuat::from_scaled_axis(twist.angular) * self.rotation).normalize(),
            translation: self.translation + twist.linear,
        }
    }

    /// The twist that takes this pose to `other` under [`Pose::perturbed`]; the angle is in 0..=pi.
    pub fn twist_to(&self, other: &Self) -> Twist {
        let mut q = other.rotation * self.rotation.conjugate();
        if q.w < 0.0 {
            q = -q;
        }
        Twist {
            angular: q.to_scaled_axis(),
            linear: other.translation - self.translation,
        }
    }

    /// Angle of the rotation between two poses, radians, 0..=pi.
    pub fn angle_to(&self, other: &Self) -> f64 {
        self.twist_to(other).angular.length()
    }

    /// True if every number is finite and the quaternion is within 1e-6 of unit length.
    pub fn is_valid(&self) -> bool {
        self.translation.is_finite()
            && self.rotation.is_finite()
            && (self.rotation.length() - 1.0).abs() < 1e-6
    }
}

impl Mul for Pose {
    type Output = Self;
    /// `(a * b).apply(p) == a.apply(b.apply(p))`.
    fn mul(self, rhs: Self) -> Self {
        Self {
            rotation: (self.rotation * rhs.rotation).normalize(),
            translation: self.apply(rhs.translation),
        }
    }
}

impl Wrench {
    /// No torque, no force.
    pub const ZERO: Self = Self {
        torque: DVec3::ZERO,
        force: DVec3::ZERO,
    };

    /// The same load with the torque taken about a point `offset` metres from the present one.
    #[must_use]
    pub fn about(&self, offset: DVec3) -> Self {
        Self {
            torque: self.torque - offset.cross(self.force),
            force: self.force,
        }
    }

    /// Power, watts, against a velocity twist (or work, joules, against a small twist).
    pub fn dot(&self, twist: &Twist) -> f64 {
        self.torque.dot(twist.angular) + self.force.dot(twist.linear)
    }

    /// True if all six numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.torque.is_finite() && self.force.is_finite()
    }
}

macro_rules! linear {
    ($t:ident, $a:ident, $b:ident) => {
        impl Add for $t {
            type Output = Self;
            fn add(self, rhs: Self) -> Self {
                Self {
                    $a: self.$a + rhs.$a,
                    $b: self.$b + rhs.$b,
                }
            }
        }
        impl AddAssign for $t {
            fn add_assign(&mut self, rhs: Self) {
                *self = *self + rhs;
            }
        }
        impl Sub for $t {
            type Output = Self;
            fn sub(self, rhs: Self) -> Self {
                Self {
                    $a: self.$a - rhs.$a,
                    $b: self.$b - rhs.$b,
                }
            }
        }
        impl Neg for $t {
            type Output = Self;
            fn neg(self) -> Self {
                Self {
                    $a: -self.$a,
                    $b: -self.$b,
                }
            }
        }
        impl Mul<f64> for $t {
            type Output = Self;
            fn mul(self, rhs: f64) -> Self {
                Self {
                    $a: self.$a * rhs,
                    $b: self.$b * rhs,
                }
            }
        }
    };
}
linear!(Twist, angular, linear);
linear!(Wrench, torque, force);
