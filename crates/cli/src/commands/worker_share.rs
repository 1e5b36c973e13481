//! Which share of a batch this process works on.

use fft_correlate::Launcher;
use serde::Serialize;

use crate::context::Context;
use crate::error::{CommandError, refuse};

/// What is shared, in words.
#[derive(Debug, Clone, Copy)]
pub(super) struct Batch {
    /// What a process does with it: `bakes`.
    pub(super) does: &'static str,
    /// The whole: `all of the table`.
    pub(super) all: &'static str,
}

/// Which of how many processes this is.
#[derive(Debug, Clone, Serialize)]
pub(super) struct WorkerShare {
    pub(super) rank: usize,
    pub(super) size: usize,
    /// The launcher that set it, if it was not the command line.
    launcher: Option<String>,
    #[serde(skip)]
    batch: Batch,
}

impl WorkerShare {
    /// The options `--rank` and `--size`, else the launcher's environment, else all of it.
    ///
    /// # Errors
    /// If one option needs the other, the environment contradicts itself, or the rank is not below
    /// the size.
    pub(super) fn of(
        rank: Option<usize>,
        size: Option<usize>,
        batch: &Batch,
    ) -> Result<Self, CommandError> {
        let given = |rank, size| Self {
            rank,
            size,
            launcher: None,
            batch: *batch,
        };
        let share = match (rank, size) {
            (Some(rank), Some(size)) => given(rank, size),
            (Some(_), None) => {
                return refuse("--size", "given with --rank", "none");
            }
            (None, size) => {
                let found = Launcher::from_env(size)
                    .map_err(|e| CommandError::bad_input("launcher's environment", e))?;
                match (found, size) {
                    (Some(launcher), _) => Self {
                        launcher: Some(launcher.source),
                        ..given(launcher.rank, launcher.size)
                    },
                    (None, Some(size)) if size != 1 => {
                        return refuse("--rank", "given with --size", "none");
                    }
                    (None, _) => given(0, 1),
                }
            }
        };
        if share.rank >= share.size {
            let expected = format!("below --size {}", share.size);
            return refuse("--rank", expected, share.rank);
        }
        Ok(share)
    }

    /// Whether this process works on item `i` of the batch.
    pub(super) fn has(&self, i: usize) -> bool {
        i % self.size == self.rank
    }

    /// What a launcher's environment was taken for.
    pub(super) fn description(&self) -> Option<String> {
        let launcher = self.launcher.as_ref()?;
        let (rank, size, Batch { does, all }) = (self.rank, self.size, self.batch);
        Some(match size {
            1 => format!("rank 0 of 1, {all}: so says the environment ({launcher})"),
            _ => format!(
                "rank {rank} of {size}, so says the environment ({launcher}); `--rank 0 --size 1` \
                 {does} {all}"
            ),
        })
    }

    /// Tells it before the work.
    pub(super) fn note(&self, context: &Context) {
        if let Some(told) = self.description() {
            context.progress.note(&told);
        }
    }
}
