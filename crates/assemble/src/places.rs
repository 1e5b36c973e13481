//! Places in which parts can be added, and how contact holds them there.

use fft_correlate::Pose;
use fft_correlate::mating::Joint;
use serde::{Deserialize, Serialize};

/// A part is held that is held so well, nats.
pub(crate) const HELD: f64 = 5.0;

/// Parts are held alike if it is to within so much, nats, and if the shares of their surfaces that mate
/// differ by less than this factor.
const ALIKE: f64 = 1.5;
const ALIKE_SHARE: f64 = 1.15;

/// How contact holds a part.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct Held {
    /// How well, nats.
    pub(crate) rank: f64,
    /// Share of its surface that mates.
    pub(crate) share: f64,
}

impl Held {
    /// Whether contact holds two parts alike.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        let [small, large] = match self.share < other.share {
            true => [self.share, other.share],
            false => [other.share, self.share],
        };
        (self.rank - other.rank).abs() <= ALIKE && large <= ALIKE_SHARE * small
    }
}

/// Where parts of one shape can be added, alike.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Extension {
    pub(crate) shape: usize,
    /// Poses and joints, assembly frame.
    pub(crate) places: Vec<(Pose, Joint)>,
    pub(crate) held: Held,
}

/// What could be added to a subassembly when it had fewer parts.
#[derive(Debug)]
pub(crate) struct Known {
    /// The key of that subassembly.
    pub(crate) key: String,
    /// The parts it had.
    pub(crate) placed: usize,
    /// What could be added of every shape, the best first; none of those that were not asked for.
    pub(crate) extensions: Vec<Option<Vec<Extension>>>,
}
