//! What a page is about.

use haptic::scene::SceneEvent;
use haptic::{DeviceSpec, HapticConfig, Outcome, Sample, Script, flags};

/// Events listed; the rest is counted.
pub(super) const LISTED: usize = 200;

/// A page about a run of the haptic loop: what was felt, how the loop fared, what happened and under
/// which conditions.
#[derive(Debug)]
pub struct FeltPage<'a> {
    /// What the run is called.
    pub title: String,
    /// What was felt: a scene's file, or a pair.
    pub subject: String,
    /// The device.
    pub spec: &'a DeviceSpec,
    /// Settings of the loop.
    pub config: &'a HapticConfig,
    /// The run, its samples kept ([`haptic::Session::keep_samples`]).
    pub outcome: &'a Outcome,
    /// What became of parts meanwhile.
    pub events: &'a [SceneEvent],
    /// Parts and what had become of each in the end.
    pub pairs: Vec<(String, String)>,
}

impl FeltPage<'_> {
    /// What a run is called: the script, if a hand followed one, and the device's name.
    #[must_use]
    pub fn title(script: Option<Script>, device: &str) -> String {
        match script {
            Some(Script::Collision) => format!("Collision test, {device}"),
            Some(Script::Snap) => format!("Snap test, {device}"),
            Some(Script::Free) => format!("Free wandering, {device}"),
            None => {
                let mut letters = device.chars();
                let first = letters.next().into_iter().flat_map(char::to_uppercase);
                first.chain(letters.clone()).collect()
            }
        }
    }
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
