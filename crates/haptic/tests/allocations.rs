//! The loop thread allocates nothing while it ticks: counted by the allocator itself.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use common::{Well, hand, workspace};
use fft_correlate::{EnergySource, Pose, Wrench};
use glam::DVec3;
use haptic::{
    Clock, Device, DeviceError, DeviceSpec, DeviceState, HandConfig, HapticConfig, LiveSource,
    Placed, Script, Session, SumSource,
};

struct Counting;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    // The thread's storage may be gone at its very end.
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
}

// SAFETY: every call goes to the system allocator unchanged; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Counts the allocator calls of the thread that polls it, from its first poll to its last, and
/// disconnects for a while on the way.
struct Watched<D> {
    inner: D,
    polls: u64,
    before: u64,
    after: u64,
}

impl<D: Device> Device for Watched<D> {
    fn spec(&self) -> &DeviceSpec {
        self.inner.spec()
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        let calls = CALLS.with(Cell::get);
        if self.polls == 0 {
            self.before = calls;
        }
        self.after = calls;
        self.polls += 1;
        if (100..150).contains(&self.polls) {
            return Err(DeviceError::Disconnected);
        }
        self.inner.poll(now)
    }

    fn send(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        self.inner.send(wrench)
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        self.inner.stop_all()
    }
}

fn calls_while_ticking(clock: Clock, seconds: f64) -> (u64, u64) {
    calls_with(&Well::default(), clock, seconds)
}

fn calls_with(source: &dyn EnergySource, clock: Clock, seconds: f64) -> (u64, u64) {
    let folder = tempfile::tempdir().unwrap();
    let mut device = Watched {
        inner: hand(HandConfig::default(), Script::Snap),
        polls: 0,
        before: 0,
        after: 0,
    };
    let mut session =
        Session::new(HapticConfig::default(), workspace()).record_to(folder.path().join("log.csv"));
    let mut viewer = session.viewer();
    session
        .run(&mut device, source, clock, seconds, &AtomicBool::new(false))
        .unwrap();
    assert!(viewer.newest().tick > 0);
    (device.after - device.before, device.polls)
}

#[test]
fn the_counter_counts() {
    let before = CALLS.with(Cell::get);
    drop(std::hint::black_box(vec![1u8; 100]));
    assert_eq!(CALLS.with(Cell::get) - before, 2);
}

#[test]
fn no_tick_allocates_in_simulated_time() {
    let (calls, polls) = calls_while_ticking(Clock::Simulated, 30.0);
    assert!(polls >= 30_000);
    assert_eq!(calls, 0);
}

#[test]
fn no_tick_allocates_in_real_time() {
    let (calls, polls) = calls_while_ticking(Clock::Real, 0.5);
    assert!(polls > 10);
    assert_eq!(calls, 0);
}

#[test]
fn no_tick_allocates_or_frees_while_parts_are_exchanged() {
    let sum = || {
        let placed = Placed {
            source: Some(Arc::new(Well::default()) as Arc<dyn EnergySource>),
            placement: Pose::IDENTITY,
            reach: None,
        };
        SumSource::new(DVec3::ZERO, vec![placed; 8])
    };
    let live = LiveSource::new(DVec3::ZERO, sum(), DVec3::ZERO);
    let (done, published) = (AtomicBool::new(false), AtomicU32::new(0));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::Relaxed) {
                live.publish(sum());
                published.fetch_add(1, Ordering::Relaxed);
                std::thread::sleep(Duration::from_millis(3));
            }
        });
        let (calls, polls) = calls_with(&live, Clock::Real, 0.7);
        done.store(true, Ordering::Relaxed);
        assert!(polls > 10);
        assert_eq!(calls, 0);
    });
    assert!(published.load(Ordering::Relaxed) > 3);
}
