//! What a page is about.

use std::path::Path;

use haptic::scene::SceneEvent;
use haptic::{DeviceSpec, HapticConfig, Outcome, Sample, flags};

/// Events listed; the rest is counted.
pub(super) const LISTED: usize = 200;

/// What the page is about.
pub(super) struct Run<'a> {
    pub(super) title: String,
    pub(super) scene: &'a Path,
    pub(super) spec: &'a DeviceSpec,
    pub(super) config: &'a HapticConfig,
    pub(super) outcome: &'a Outcome,
    pub(super) samples: &'a [Sample],
    pub(super) events: &'a [SceneEvent],
    pub(super) pairs: Vec<(String, String)>,
}

/// Samples at which one of `bits` comes on.
pub(super) fn starts(samples: &[Sample], bits: u16) -> impl Iterator<Item = &Sample> {
    let mut last = 0;
    samples.iter().filter(move |s| {
        let new = s.flags & bits & !last;
        last = s.flags;
        new != 0
    })
}

pub(super) fn names(set: u16) -> String {
    let named = flags::NAMES.iter().enumerate();
    let on = named.filter(|(bit, _)| set & (1 << bit) != 0);
    on.map(|(_, name)| *name).collect::<Vec<_>>().join(", ")
}
