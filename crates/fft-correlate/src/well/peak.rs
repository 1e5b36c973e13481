//! The largest force around a pose.

use glam::DVec3;

use crate::energy::EnergySource;
use crate::geometry::se3::Pose;

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
