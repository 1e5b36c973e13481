//! The loop thread allocates nothing while it ticks: counted by the allocator itself.

mod common;
#[path = "../../fft-correlate/tests/counting/mod.rs"]
mod counting;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use common::valleys::{REACH, Valleys, open};
use common::{Well, hand, workspace};
use counting::calls;
use fft_correlate::{EnergySource, PartialTable, Placement, Pose, Wrench};
use glam::{DQuat, DVec3};
use haptic::scene::{Content, LoadedPair, PairState};
use haptic::{
    Clock, Device, DeviceError, DeviceSpec, DeviceState, HapticConfig, LiveScene, LiveSource,
    OperatorConfig, PairSpec, PlacedSource, SceneOptions, Script, Session, SharedSource, SumSource,
    flags,
};

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
        let calls = calls();
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
        inner: hand(OperatorConfig::default(), Script::Snap),
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
    let before = calls();
    drop(std::hint::black_box(vec![1u8; 100]));
    assert_eq!(calls() - before, 2);
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
        let placed = PlacedSource {
            source: Some(SharedSource::new(Arc::new(Well::default()))),
            placement: Placement::IDENTITY,
            reach: None,
        };
        SumSource::new(DVec3::ZERO, vec![placed; 8])
    };
    let live = LiveSource::new(sum(), &Pose::IDENTITY);
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

/// Holds the part off its middle and turns it to and fro, 55 degrees each way; jumps once.
struct Turner(DeviceSpec);

impl Device for Turner {
    fn spec(&self) -> &DeviceSpec {
        &self.0
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        let angle = 0.95 * (1.5 * now).sin() * if now < 1.5 { 1.0 } else { -1.0 };
        let turn = DQuat::from_axis_angle(DVec3::new(0.3, 0.8, -0.5).normalize(), angle);
        Ok(DeviceState::at_rest(
            Pose::new(turn, DVec3::new(0.008, 0.0, -0.006)),
            now,
        ))
    }

    fn send(&mut self, _: &Wrench) -> Result<(), DeviceError> {
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// A scene of one table that keeps a quarter of its rotations in memory.
fn quarter_of_a_table() -> LiveScene {
    let valleys = Valleys {
        spring: 0.02,
        depth: 0.01,
    };
    let table = PartialTable::new(open(&valleys.bake())).unwrap();
    let options = SceneOptions {
        memory: table.node_bytes() * table.nodes() as u64 / 4,
        ..SceneOptions::default()
    };
    let mut table = Some(Box::new(table));
    let pair = PairSpec {
        name: "valleys".into(),
        placement: Placement::IDENTITY,
        reach: REACH,
        bytes: 0,
        files: Vec::new(),
        same_as: None,
        load: Box::new(move |_| {
            let table = table.take().ok_or("opened twice")?;
            Ok(LoadedPair {
                content: Content::Table(table),
                reach: REACH,
                right: None,
            })
        }),
    };
    LiveScene::start(vec![pair], options, &Pose::IDENTITY).unwrap()
}

#[test]
fn no_tick_allocates_or_knocks_while_the_rotations_of_a_table_come_and_go() {
    let scene = quarter_of_a_table();
    let mut device = Watched {
        inner: Turner(OperatorConfig::default().spec()),
        polls: 0,
        before: 0,
        after: 0,
    };
    let config = HapticConfig {
        ramp_s: 0.1,
        ..HapticConfig::default()
    };
    let rates = (config.limits.force_rate, config.limits.torque_rate);
    let outcome = Session::new(config, workspace())
        .keep_samples()
        .run(
            &mut device,
            scene.source(),
            Clock::Real,
            3.0,
            &AtomicBool::new(false),
        )
        .unwrap();
    assert!(device.polls > 100);
    assert_eq!(device.after - device.before, 0);
    assert!(outcome.report.peak_force > 0.5, "it was felt");
    for pair in outcome.samples.windows(2) {
        let step = pair[1].wrench + pair[0].wrench * -1.0;
        // The rate limits, and the rounding of their own arithmetic.
        let most = pair[1].dt * (1.0 + 1e-9) + 1e-12;
        assert!(step.force.length() <= rates.0 * most, "{:?}", pair[1]);
        assert!(step.torque.length() <= rates.1 * most, "{:?}", pair[1]);
        if pair[1].flags & flags::NOT_LOADED != 0 {
            assert_eq!((pair[1].energy, pair[1].coverage), (0.0, 0.0));
        }
    }
    let not_loaded = outcome.samples.iter();
    let not_loaded = not_loaded.filter(|s| s.flags & flags::NOT_LOADED != 0);
    assert_eq!(outcome.report.not_loaded, not_loaded.count() as u64);
    assert!(matches!(scene.states()[0], PairState::Partly { .. }));
}
