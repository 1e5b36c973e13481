//! What came of tries, for a disassembly that goes on.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::contact::solid::Solid;
use crate::disassembly::options::DisassemblyOptions;
use crate::error::PathError;

/// Parts and groups that were tried, and what came of it: a disassembly that is given them does not try
/// again what does not come off. It is empty at first, belongs to one assembly, and can be written to
/// a file.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DisassemblyTries {
    assembly: Option<Assembly>,
    tries: Vec<Try>,
}

/// What was taken apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Assembly {
    parts: Vec<String>,
    tolerance: Option<f64>,
    allow_overlap: bool,
}

/// A group that did not come off others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Try {
    group: Vec<usize>,
    rest: Vec<usize>,
    /// How long it was tried at most, seconds.
    limit: f64,
    /// Whether everything was tried.
    exhausted: bool,
}

impl DisassemblyTries {
    /// How many there are.
    pub fn count(&self) -> usize {
        self.tries.len()
    }

    /// Begins with an assembly, or goes on with it.
    ///
    /// # Errors
    /// If what was tried belongs to another one.
    pub(super) fn of<'a>(
        &mut self,
        parts: impl Iterator<Item = &'a Solid>,
        options: &DisassemblyOptions,
    ) -> Result<(), PathError> {
        let hash = |solid: &Solid| {
            let bytes = solid.mesh.hash();
            bytes[..16].iter().map(|b| format!("{b:02x}")).collect()
        };
        let asked = Assembly {
            parts: parts.map(hash).collect(),
            tolerance: options.tolerance,
            allow_overlap: options.allow_overlap,
        };
        if let Some(known) = self.assembly.as_ref().filter(|known| **known != asked) {
            let item = if known.parts != asked.parts {
                "an assembled part"
            } else {
                "the tolerance or the overlap that is allowed"
            };
            return Err(PathError::Explored { item });
        }
        self.assembly = Some(asked);
        Ok(())
    }

    /// If a group is known not to come off in so much time: whether everything was tried.
    pub(super) fn known(&self, group: &[usize], rest: &[usize], limit: Duration) -> Option<bool> {
        let same = |t: &&Try| t.group == group && t.rest == rest;
        let told = |t: &Try| t.exhausted || t.limit >= limit.as_secs_f64();
        let tries = self.tries.iter().filter(same);
        tries.filter(|t| told(t)).map(|t| t.exhausted).max()
    }

    /// Adds a group that did not come off.
    pub(super) fn add(
        &mut self,
        group: &[usize],
        rest: &[usize],
        limit: Duration,
        exhausted: bool,
    ) {
        self.tries.push(Try {
            group: group.to_vec(),
            rest: rest.to_vec(),
            limit: limit.as_secs_f64(),
            exhausted,
        });
    }
}
