//! The largest force around a pose, and the energy scale that gives one.

use glam::DVec3;

use crate::energy::EnergySource;
use crate::geometry::se3::Pose;
use crate::well::error::WellError;

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

/// The energy scale at which [`peak_force`] is `newtons`, given that `source` was made with scale
/// `gamma` (joules per cubic metre).
///
/// # Errors
/// If there is no force on the scans, or `newtons` is not positive and finite.
pub fn gamma_for_peak_force(
    source: &dyn EnergySource,
    gamma: f64,
    assembled: &Pose,
    window: DVec3,
    newtons: f64,
) -> Result<f64, WellError> {
    if !(newtons.is_finite() && newtons > 0.0) {
        return Err(WellError::Option {
            name: "newtons",
            expected: "positive and finite",
            found: newtons,
        });
    }
    let (peak, _) = peak_force(source, assembled, window);
    let scale = gamma * newtons / peak;
    if scale.is_finite() && scale > 0.0 {
        Ok(scale)
    } else {
        Err(WellError::NoForce { newtons })
    }
}
