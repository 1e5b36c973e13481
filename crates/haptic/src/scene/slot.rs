//! A pair of a scene as the keeper has it: what is loaded of it, and how its files were then.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::SystemTime;

use glam::DVec3;
use sdf_grid::Aabb;

use crate::panics::panic_message;
use crate::scene::event::PairState;
use crate::scene::pair::{Content, LoadFailure, Loaded, PairSpec};
use crate::scene::rotations::Rotations;
use crate::scene::shared::SharedSource;

/// Time and length of each file; `None` for one that is not there.
pub(super) type Stamps = Vec<Option<(SystemTime, u64)>>;

/// A source in memory; several pairs may hold the same.
#[derive(Clone)]
pub(super) struct Held {
    pub(super) source: SharedSource,
    pub(super) reach: Aabb,
    /// 0 for a table that is kept in part: its rotations count.
    pub(super) bytes: u64,
}

/// A pair and its state.
pub(super) struct Slot {
    pub(super) spec: PairSpec,
    /// The first pair with the same source.
    pub(super) group: usize,
    pub(super) loaded: Option<Held>,
    pub(super) state: PairState,
    /// The files as they were when last loaded.
    pub(super) stamps: Stamps,
    /// The files as they were at the last look.
    pub(super) seen: Stamps,
    pub(super) reload: bool,
}

impl Slot {
    pub(super) fn new(spec: PairSpec, group: usize) -> Self {
        let stamps = stamps(&spec.files);
        Self {
            seen: stamps.clone(),
            stamps,
            spec,
            group,
            loaded: None,
            state: PairState::Waiting,
            reload: false,
        }
    }

    /// A loader that panics has failed; the pairs that are loaded go on.
    pub(super) fn load(&mut self) -> Result<Loaded, LoadFailure> {
        let load = AssertUnwindSafe(|| (self.spec.load)());
        catch_unwind(load).unwrap_or_else(|panic| Err(panic_message(panic.as_ref()).into()))
    }

    /// Metres from the reach to a point of the scene; 0 inside.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let at = self.spec.placement.fixed.inverse().apply(point);
        let Aabb { min, max } = self.spec.reach;
        (min - at).max(at - max).max(DVec3::ZERO).length()
    }

    /// Asks for a reload if the files differ from those loaded and have stood still since the last
    /// look: a file that is being written is left alone.
    pub(super) fn look(&mut self) {
        let now = stamps(&self.spec.files);
        let settled = now == self.seen;
        if settled && now != self.stamps {
            self.stamps.clone_from(&now);
            self.reload = true;
            if self.state == PairState::Failed {
                self.state = PairState::Waiting;
            }
        }
        self.seen = now;
    }
}

/// What the pairs of a group share, and the table if it is kept in part.
pub(super) fn hold(loaded: Loaded) -> (Held, Option<Rotations>) {
    let Loaded { content, reach } = loaded;
    let (source, bytes, rotations) = match content {
        Content::Whole { source, bytes } => (SharedSource::new(source), bytes, None),
        Content::Table(table) => {
            let rotations = Rotations::new(*table);
            (rotations.source().clone(), 0, Some(rotations))
        }
    };
    let held = Held {
        source,
        reach,
        bytes,
    };
    (held, rotations)
}

pub(super) fn stamps(files: &[PathBuf]) -> Stamps {
    let stamp = |path: &PathBuf| {
        let meta = std::fs::metadata(path).ok()?;
        Some((meta.modified().ok()?, meta.len()))
    };
    files.iter().map(stamp).collect()
}
