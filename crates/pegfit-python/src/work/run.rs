//! Work on worker threads while the calling one waits without the interpreter, looks for Ctrl-C
//! and tells of progress.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

use super::monitor::Progress;
pub(crate) use super::monitor::Watch;
use super::pools::pool;
use crate::failure::raised::Failure;

/// Between two looks for Ctrl-C.
const SLICE: Duration = Duration::from_millis(10);

/// How long work that was told to stop may go on before the caller is let go.
const GRACE: Duration = Duration::from_millis(25);

/// Runs work that owns what it needs. After Ctrl-C, or an exception of `progress(stage, done,
/// total)`, that is raised as soon as the work has stopped, or at most 25 ms later: what it has
/// begun then ends unheard in the background.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Watch) -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    let pool = pool(py, None)?;
    let watch = Arc::new(Watch::default());
    let (sender, mut result) = sync_channel(1);
    let its = Arc::clone(&watch);
    pool.spawn(move || {
        // Nobody listens any more if the caller was let go.
        let _ = sender.send(guarded(|| work(&its)));
    });
    match wait(py, &watch, &mut result, progress) {
        Ok(done) => Ok(done?),
        Err(interruption) => {
            watch.stop();
            // Whatever comes in time is as good as nothing: the caller has been interrupted.
            let _ = py.detach(move || result.recv_timeout(GRACE));
            Err(interruption)
        }
    }
}

/// Runs work that borrows, on so many threads; a stop is waited for, so it must come soon.
pub(crate) fn run_scoped<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    work: impl FnOnce(&Watch) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let pool = pool(py, threads)?;
    let watch = Watch::default();
    let (sender, mut result) = sync_channel(1);
    pool.in_place_scope(|scope| {
        let its = &watch;
        scope.spawn(move |_| {
            // The receiver outlives the scope.
            let _ = sender.send(guarded(|| work(its)));
        });
        match wait(py, &watch, &mut result, None) {
            Ok(done) => Ok(done?),
            Err(interruption) => {
                watch.stop();
                // Threads may not be waited for while attached: they could wait for it.
                let _ = py.detach(move || result.recv());
                Err(interruption)
            }
        }
    })
}

/// A panic is an error like any other.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    // What the work shares is its results, which are dropped with it.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(Failure::internal(&*panic)))
}

fn wait<T: Send>(
    py: Python<'_>,
    watch: &Watch,
    result: &mut Receiver<Result<T, Failure>>,
    progress: Option<&Py<PyAny>>,
) -> PyResult<Result<T, Failure>> {
    let mut told = Told::new(progress);
    loop {
        let heard = &mut *result;
        let next = py.detach(move || heard.recv_timeout(SLICE));
        match next {
            Ok(done) => {
                told.tell(py, watch.progress())?;
                return Ok(done);
            }
            Err(RecvTimeoutError::Timeout) => {
                py.check_signals()?;
                told.now_and_then(py, watch)?;
            }
            // The sender sends whatever happens, a panic included.
            Err(RecvTimeoutError::Disconnected) => {
                return Ok(Err(Failure::internal(&"a worker thread went away")));
            }
        }
    }
}

/// The caller's `progress`, and what it has heard.
struct Told<'a> {
    progress: Option<&'a Py<PyAny>>,
    last: Option<Progress>,
    when: Instant,
}

impl<'a> Told<'a> {
    /// Between two calls.
    const PAUSE: Duration = Duration::from_millis(50);

    fn new(progress: Option<&'a Py<PyAny>>) -> Self {
        Self {
            progress,
            last: None,
            when: Instant::now(),
        }
    }

    fn now_and_then(&mut self, py: Python<'_>, watch: &Watch) -> PyResult<()> {
        if self.progress.is_none() || self.when.elapsed() < Self::PAUSE {
            return Ok(());
        }
        self.when = Instant::now();
        self.tell(py, watch.progress())
    }

    fn tell(&mut self, py: Python<'_>, now: Progress) -> PyResult<()> {
        let Some(progress) = self.progress else {
            return Ok(());
        };
        if now.total == 0 || self.last.as_ref() == Some(&now) {
            return Ok(());
        }
        progress.call1(py, (&now.stage, now.done, now.total))?;
        self.last = Some(now);
        Ok(())
    }
}
