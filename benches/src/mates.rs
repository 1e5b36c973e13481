//! Pairs of which the true response can be had: the paper's, and others that share neither their
//! right angles nor their wide faces.

use glam::{DVec2, dvec2};
use sdf_grid::TriangleMesh;
use sdf_grid::shapes::{PegInHole, prism};

use crate::Outcome;

/// Two parts that mate. All are prisms 30 mm long in blocks 40 mm wide, and as wide as the paper's
/// pegs, 20 mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mates {
    /// The paper's.
    Paper(PegInHole),
    /// A peg with six walls.
    Hexagon,
    /// A peg with four arms 8 mm wide.
    Cross,
    /// A square bar on its edge in a groove of 90 degrees.
    Bar,
}

/// How far the sections of what is not the paper's are turned, so that their walls lie along no
/// side of the block.
const TURN: f64 = 0.3;

/// Half the width of the arms of [`Mates::Cross`], metres.
const ARM: f64 = 0.004;

/// How deep the groove of [`Mates::Bar`] is, metres.
const GROOVE: f64 = 0.008;

impl Mates {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Paper(PegInHole::Circular),
        Self::Paper(PegInHole::Rectangular),
        Self::Paper(PegInHole::Combined),
        Self::Hexagon,
        Self::Cross,
        Self::Bar,
    ];

    /// Its name in files and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper(which) => which.name(),
            Self::Hexagon => "hexagon",
            Self::Cross => "cross",
            Self::Bar => "bar",
        }
    }

    /// The one of that name.
    ///
    /// # Errors
    /// If there is none.
    pub fn named(name: &str) -> Outcome<Self> {
        let found = Self::ALL.into_iter().find(|m| m.name() == name);
        let names = Self::ALL.map(Self::name).join(", ");
        Ok(found.ok_or_else(|| format!("pair {name:?}: expected one of {names}"))?)
    }

    /// Fixed and moving part, `clearance` (metres) between their walls.
    ///
    /// # Errors
    /// If the clearance is out of range.
    pub fn pair(self, clearance: f64) -> Outcome<[TriangleMesh; 2]> {
        let half = 0.5 * PegInHole::BLOCK;
        let block = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let block = block.map(|(x, y)| half * dvec2(x, y));
        let in_block = |section: &dyn Fn(f64) -> Vec<DVec2>| -> Outcome<[TriangleMesh; 2]> {
            Ok([
                prism(&block, &[section(clearance)], PegInHole::HEIGHT)?,
                prism(&section(0.0), &[], PegInHole::HEIGHT)?,
            ])
        };
        match self {
            Self::Paper(which) => {
                let (hole, peg) = which.pair(clearance)?;
                Ok([hole, peg])
            }
            Self::Hexagon => in_block(&hexagon),
            Self::Cross => in_block(&cross),
            Self::Bar => {
                let [foot, side] = [PegInHole::RADIUS, GROOVE].map(|d| d + 2f64.sqrt() * clearance);
                let brim = GROOVE - PegInHole::RADIUS;
                let groove = [
                    dvec2(-half, -half),
                    dvec2(half, -half),
                    dvec2(half, brim),
                    dvec2(side, brim),
                    dvec2(0.0, -foot),
                    dvec2(-side, brim),
                    dvec2(-half, brim),
                ];
                let bar = [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)];
                let bar = bar.map(|(x, y)| PegInHole::RADIUS * dvec2(x, y));
                Ok([
                    prism(&groove, &[], PegInHole::HEIGHT)?,
                    prism(&bar, &[], PegInHole::HEIGHT)?,
                ])
            }
        }
    }
}

fn hexagon(offset: f64) -> Vec<DVec2> {
    let radius = (PegInHole::RADIUS + offset) * 2.0 / 3f64.sqrt();
    let angle = |i| TURN + std::f64::consts::FRAC_PI_3 * f64::from(i);
    (0..6)
        .map(|i| radius * DVec2::from_angle(angle(i)))
        .collect()
}

fn cross(offset: f64) -> Vec<DVec2> {
    let (long, wide) = (PegInHole::RADIUS + offset, ARM + offset);
    let arm = [dvec2(long, -wide), dvec2(long, wide), dvec2(wide, wide)];
    let turn = |i| DVec2::from_angle(TURN + std::f64::consts::FRAC_PI_2 * f64::from(i));
    (0..4)
        .flat_map(|i| arm.map(|p| turn(i).rotate(p)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clearance_lies_between_all_walls_and_pegs_are_as_narrow_as_the_papers() {
        for mates in Mates::ALL {
            let clearance = 3e-4;
            let [fixed, moving] = mates.pair(clearance).unwrap();
            let bvh = sdf_grid::Bvh::build(&fixed);
            let nearest = moving.vertices().iter().map(|p| bvh.signed_distance(*p));
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            // Corners lie that far from the walls; those of facets, by their angle less.
            let share = nearest / clearance;
            assert!((share - 1.0).abs() < 0.02, "{mates:?}: {share}");
            let narrowest = moving.bounds().size().min_element();
            assert!(
                (0.019..0.026).contains(&narrowest),
                "{mates:?}: {narrowest}"
            );
            assert_eq!(Mates::named(mates.name()).unwrap(), mates);
        }
        assert!(Mates::named("nut").is_err());
    }
}
