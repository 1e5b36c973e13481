//! The highest climb along a way.

use serde::Serialize;

/// The highest climb of an energy along a way in.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Climb {
    /// From a pose to a later one, joules; 0 if the energy never rises.
    pub energy: f64,
    /// The same as a share of the depth of the fit below the energy out of reach.
    pub share: f64,
    /// At which pose it ends.
    pub top: usize,
}

/// The highest climb from first to last, of a well that is `depth` joules deep.
pub(crate) fn highest_climb(energies: &[f64], depth: f64) -> Climb {
    let mut lowest = f64::INFINITY;
    let mut best = Climb {
        energy: 0.0,
        share: 0.0,
        top: 0,
    };
    for (i, energy) in energies.iter().enumerate() {
        lowest = lowest.min(*energy);
        if energy - lowest > best.energy {
            best.energy = energy - lowest;
            best.top = i;
        }
    }
    best.share = if depth > 0.0 {
        best.energy / depth
    } else {
        0.0
    };
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_climb_is_from_a_low_to_a_later_high() {
        let climb = highest_climb(&[0.0, -1.0, 0.5, -3.0, -2.0, -4.0], 4.0);
        assert_eq!((climb.energy, climb.share, climb.top), (1.5, 0.375, 2));
        assert_eq!(highest_climb(&[0.0, -1.0, -2.0], 2.0).energy, 0.0);
    }
}
