//! Long work beside Python: threads, progress, Ctrl-C.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use sdf_grid::Monitor;

use crate::failure::{Failure, Kind};

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
    let mut told = Reporter::new(progress);
    loop {
        let heard = &mut *result;
        let next = py.detach(move || heard.recv_timeout(SLICE));
        match next {
            Ok(done) => {
                told.report(py, watch.progress())?;
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
struct Reporter<'a> {
    progress: Option<&'a Py<PyAny>>,
    last: Option<Progress>,
    when: Instant,
}

impl<'a> Reporter<'a> {
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
        self.report(py, watch.progress())
    }

    fn report(&mut self, py: Python<'_>, now: Progress) -> PyResult<()> {
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

/// Progress of one computation and its order to stop; shared by all of its threads.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    stop: AtomicBool,
    done: AtomicU64,
    stage: Mutex<(String, u64)>,
}

/// How far a computation is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Progress {
    pub(super) stage: String,
    pub(super) done: u64,
    pub(super) total: u64,
}

impl Watch {
    pub(super) fn stop(&self) {
        self.stop.store(true, Relaxed);
    }

    /// The flag itself, for loops that watch one.
    pub(crate) fn flag(&self) -> &AtomicBool {
        &self.stop
    }

    pub(super) fn progress(&self) -> Progress {
        let stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        Progress {
            stage: stage.0.clone(),
            done: self.done.load(Relaxed).min(stage.1),
            total: stage.1,
        }
    }
}

impl Monitor for Watch {
    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Relaxed);
    }

    fn begin(&self, stage: &str, total: u64) {
        let mut current = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        *current = (stage.to_owned(), total);
        self.done.store(0, Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.stop.load(Relaxed)
    }
}

/// Most threads that may be asked for.
const MOST: usize = 4096;

/// What the searches that go deepest need.
const STACK_BYTES: usize = 8 << 20;

/// Pools by the process that started them and the number of threads asked for. A process that was
/// forked has none of its parent's threads, so it starts its own.
static POOLS: Mutex<Option<HashMap<Key, Arc<ThreadPool>>>> = Mutex::new(None);

type Key = (u32, Option<usize>);

/// Refuses numbers of threads that no pool has.
pub(crate) fn check(threads: Option<usize>) -> Result<(), Failure> {
    match threads {
        Some(found) if found == 0 || found > MOST => {
            let expected = format!("1 to {MOST}");
            Err(Failure::found(Kind::General, "threads", expected, found))
        }
        _ => Ok(()),
    }
}

/// The pool of so many threads, one per core if `None`; started when first asked for. Only called
/// while attached to the interpreter, so that no fork happens while the list is locked.
pub(super) fn pool(_: Python<'_>, threads: Option<usize>) -> Result<Arc<ThreadPool>, Failure> {
    check(threads)?;
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let pools = pools.get_or_insert_default();
    let key = (std::process::id(), threads);
    if let Some(pool) = pools.get(&key) {
        return Ok(Arc::clone(pool));
    }
    let built = ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .stack_size(STACK_BYTES)
        .thread_name(|n| format!("pegfit-{n}"))
        .build()
        .map_err(|e| Failure::from_error(Kind::General, &e))?;
    let pool = Arc::new(built);
    pools.insert(key, Arc::clone(&pool));
    Ok(pool)
}
