//! The energy well about a pose in numbers: depth, minimum, stiffness, diameter, barriers.

use glam::DVec3;
use serde::Serialize;

use crate::energy::EnergySource;
use crate::geometry::se3::Pose;
use crate::well::error::WellError;
use crate::well::scan::{Around, Axis, Barrier, Step, axes};

/// What [`Well::analyse`] looks at.
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Well {
    /// Where the energy is lowest: position of the moving part's origin, metres.
    pub position: [f64; 3],
    /// Its rotation there, quaternion x, y, z, w.
    pub rotation: [f64; 4],
    /// From the pose asked about: displacement of the pivot, metres.
    pub offset: [f64; 3],
    /// From the pose asked about: rotation vector, radians.
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
    /// Along the directions asked for.
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
        let mut around = Around {
            source,
            scratch: source.scratch(),
            base: *pose,
            pivot: options.pivot,
        };
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
