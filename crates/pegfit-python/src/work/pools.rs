//! The worker threads of this process.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::failure::raised::{Failure, Kind};

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
        .map_err(|e| Failure::of(Kind::General, &e))?;
    let pool = Arc::new(built);
    pools.insert(key, Arc::clone(&pool));
    Ok(pool)
}
