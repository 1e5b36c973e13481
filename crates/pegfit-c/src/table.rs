//! Tables: load, ask, query, close.

use std::ffi::{CStr, c_char};
use std::path::Path;
use std::sync::Arc;

use fft_correlate::{EnergySource, EnergyTable, InScene, Scratch, TableStore};

use crate::failure::{Failure, guarded};
use crate::handles::Handles;
use crate::pose::{PegfitPose, PegfitResponse};
use crate::status::PegfitStatus;

/// A loaded table. 0 is never one.
pub type PegfitTable = u64;

/// What a table covers.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PegfitTableInfo {
    /// Point of the moving part (its own frame, metres) whose displacement the window counts.
    pub pivot: [f64; 3],
    /// Least displacement of the pivot, metres, along the axes of the fixed part's own frame, from
    /// where it is when both frames coincide.
    pub window_min: [f64; 3],
    /// Greatest displacement.
    pub window_max: [f64; 3],
    /// Rotation nodes.
    pub rotations: u64,
    /// Bytes of energies in memory.
    pub bytes: u64,
    /// Where the fixed part's own frame is in the scene that the table was baked for.
    pub fixed: PegfitPose,
    /// Where the moving part's own frame is there at the pose that is the identity.
    pub moving: PegfitPose,
}

static TABLES: Handles<InScene<EnergyTable>> = Handles::new();

fn table(handle: PegfitTable) -> Result<Arc<InScene<EnergyTable>>, Failure> {
    TABLES.get(handle).ok_or_else(|| no_such(handle))
}

fn no_such(handle: PegfitTable) -> Failure {
    Failure::new(
        PegfitStatus::NoSuchTable,
        format!("no table has the handle {handle:#x}: it was closed, or never opened"),
    )
}

/// Refuses a pointer that cannot be one to `T`.
fn check<T>(name: &str, pointer: *const T) -> Result<(), Failure> {
    if pointer.is_null() || !pointer.is_aligned() {
        let found = if pointer.is_null() {
            "null"
        } else {
            "not aligned"
        };
        let text = format!("{name}: expected a pointer, found {found}");
        return Err(Failure::new(PegfitStatus::BadPointer, text));
    }
    Ok(())
}

/// Reads all of a baked table into memory, `memory_limit` bytes at most (0: no limit), and writes
/// its handle to `table`. `path` is the table's folder, UTF-8, ended by a zero. On failure `table`
/// is set to 0. Works in the child of a fork as well, if no other thread was in the middle of loading or
/// closing a table at that moment.
///
/// # Safety
/// `path` must be null or end with a zero; `table` must be null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pegfit_table_load(
    path: *const c_char,
    memory_limit: u64,
    table: *mut PegfitTable,
) -> PegfitStatus {
    guarded(|| {
        check("table", table)?;
        // SAFETY: not null and aligned; the caller says that it may be written.
        unsafe { table.write(0) };
        check("path", path)?;
        // SAFETY: not null; the caller says that it ends with a zero.
        let path = unsafe { CStr::from_ptr(path) };
        let path = path.to_str().map_err(|_| {
            let text = format!("path: expected UTF-8, found {}", path.to_string_lossy());
            Failure::new(PegfitStatus::BadPath, text)
        })?;
        let limit = if memory_limit == 0 {
            u64::MAX
        } else {
            memory_limit
        };
        let loaded = on_own_threads(|| {
            TableStore::open(Path::new(path))
                .and_then(|store| store.load(limit))
                .map_err(|e| Failure::new(PegfitStatus::CannotLoad, e.to_string()))
        })?;
        let handle = TABLES
            .insert(loaded.in_scene())
            .ok_or_else(|| Failure::new(PegfitStatus::Internal, "no handle is left"))?;
        // SAFETY: as above.
        unsafe { table.write(handle) };
        Ok(())
    })
}

/// Runs `work` on threads that are started for it and end with it. Threads that were started before a
/// fork are not there in the child, which would wait for them for ever.
fn on_own_threads<T: Send>(work: impl FnOnce() -> Result<T, Failure> + Send) -> Result<T, Failure> {
    let threads = rayon::ThreadPoolBuilder::new()
        .thread_name(|number| format!("pegfit-load-{number}"))
        .build()
        .map_err(|e| Failure::new(PegfitStatus::CannotLoad, e.to_string()))?;
    threads.install(work)
}

/// Writes what a table covers to `info`.
///
/// # Safety
/// `info` must be null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pegfit_table_info(
    handle: PegfitTable,
    info: *mut PegfitTableInfo,
) -> PegfitStatus {
    guarded(|| {
        check("info", info)?;
        let found = table(handle)?;
        let (table, placement) = (found.source(), found.placement());
        let spec = table.spec();
        let rotations = table.grid().nodes().len();
        let window = spec.window.node_bounds();
        let found = PegfitTableInfo {
            pivot: spec.provenance.pivot,
            window_min: window.min.to_array(),
            window_max: window.max.to_array(),
            rotations: rotations as u64,
            bytes: u64::try_from(spec.bytes(rotations)).unwrap_or(u64::MAX),
            fixed: placement.fixed.into(),
            moving: placement.moving.into(),
        };
        // SAFETY: not null and aligned; the caller says that it may be written.
        unsafe { info.write(found) };
        Ok(())
    })
}

/// Writes energy, torque and force at `pose` to `response`. Takes microseconds, allocates nothing
/// unless it fails, and waits for nobody but a thread that is opening or closing a table.
///
/// # Safety
/// `pose` must be null or readable, `response` null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pegfit_table_query(
    handle: PegfitTable,
    pose: *const PegfitPose,
    response: *mut PegfitResponse,
) -> PegfitStatus {
    guarded(|| {
        check("pose", pose)?;
        check("response", response)?;
        // SAFETY: not null and aligned; the caller says that it may be read.
        let pose = unsafe { pose.read() }.checked(0)?;
        let found = table(handle)?.evaluate(&pose, &mut Scratch::default());
        // SAFETY: not null and aligned; the caller says that it may be written.
        unsafe { response.write(found.into()) };
        Ok(())
    })
}

/// [`pegfit_table_query`] at `count` poses, one after the other on the calling thread. If a pose is
/// refused, the responses before it are written and those from it on are left alone. The arrays must
/// not overlap; both may be null if `count` is 0.
///
/// # Safety
/// `poses` must be null or `count` readable poses, `responses` null or `count` writable responses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pegfit_table_query_many(
    handle: PegfitTable,
    poses: *const PegfitPose,
    responses: *mut PegfitResponse,
    count: usize,
) -> PegfitStatus {
    guarded(|| {
        let table = table(handle)?;
        if count == 0 {
            return Ok(());
        }
        check("poses", poses)?;
        check("responses", responses)?;
        apart(poses, responses, count)?;
        for place in 0..count {
            // SAFETY: within the `count` poses that the caller says may be read.
            let pose = unsafe { poses.add(place).read() }.checked(place)?;
            let found = table.evaluate(&pose, &mut Scratch::default());
            // SAFETY: within the `count` responses that the caller says may be written.
            unsafe { responses.add(place).write(found.into()) };
        }
        Ok(())
    })
}

/// Refuses arrays that memory cannot hold or that overlap.
fn apart<A, B>(a: *const A, b: *mut B, count: usize) -> Result<(), Failure> {
    let end = |start: usize, size: usize| -> Option<usize> {
        let bytes = count
            .checked_mul(size)
            .filter(|b| *b <= isize::MAX as usize)?;
        start.checked_add(bytes)
    };
    let (a_start, b_start) = (a.addr(), b.addr());
    let ends = end(a_start, size_of::<A>()).zip(end(b_start, size_of::<B>()));
    let (a_end, b_end) = ends.ok_or_else(|| {
        let text = format!("count: expected what memory can hold, found {count}");
        Failure::new(PegfitStatus::BadSize, text)
    })?;
    if a_start < b_end && b_start < a_end {
        let text = "poses and responses: expected arrays apart, found them overlapping";
        return Err(Failure::new(PegfitStatus::BadPointer, text));
    }
    Ok(())
}

/// Gives a table up. Queries that other threads are in the middle of end well; the memory is freed
/// by the last of them. The handle is never used again.
#[unsafe(no_mangle)]
pub extern "C" fn pegfit_table_close(table: PegfitTable) -> PegfitStatus {
    guarded(|| TABLES.remove(table).map(drop).ok_or_else(|| no_such(table)))
}
