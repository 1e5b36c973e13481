//! Devices on one thread (`Fake`) and on two (`Half`).

use std::sync::atomic::AtomicBool;

use super::*;
use crate::device::hid::fake::wait_for;
use crate::device::simulated::OperatorConfig;

const AT_REST: Motion = Motion::Position {
    pose: Pose::IDENTITY,
    twist: Twist {
        angular: DVec3::ZERO,
        linear: DVec3::ZERO,
    },
};

#[derive(Default)]
struct World {
    unplugged: bool,
    warm: bool,
    other: bool,
    connects: u32,
    /// What it pushes with, and since when.
    force: f64,
    since: Option<Instant>,
    pushed: Vec<f64>,
}

#[derive(Clone, Default)]
struct Fake(Arc<Mutex<World>>);

impl Fake {
    fn with<T>(&self, look: impl FnOnce(&mut World) -> T) -> T {
        look(&mut self.0.lock().unwrap())
    }

    fn take(&self, wrench: &Wrench) -> Result<Exchange, DeviceError> {
        self.with(|world| {
            if world.unplugged {
                world.force = 0.0;
                return Err(DeviceError::System {
                    name: "fake".into(),
                    reason: "pulled out".into(),
                });
            }
            let force = if world.warm { 0.0 } else { wrench.force.x };
            if force != world.force {
                world.since = Some(Instant::now());
                world.pushed.push(force);
            }
            world.force = force;
            Ok(Exchange {
                reading: Some(Reading {
                    motion: AT_REST,
                    buttons: 5,
                }),
                refused: world.warm.then(|| DeviceError::NotReady {
                    name: "fake".into(),
                    reason: "warm motors".into(),
                }),
            })
        })
    }
}

impl OpenDevice for Fake {
    fn exchange(&mut self, wrench: &Wrench) -> Result<Exchange, DeviceError> {
        self.take(wrench)
    }
}

impl Fake {
    fn connect(&self) -> Result<(Self, DeviceSpec), DeviceError> {
        self.with(|world| {
            world.connects += 1;
            if world.unplugged {
                return Err(DeviceError::Disconnected);
            }
            let mut spec = OperatorConfig::default().spec();
            if world.other {
                spec.max_force = 1.0;
            }
            Ok((self.clone(), spec))
        })
    }

    fn open(&self) -> Result<ThreadedDevice, DeviceError> {
        let fake = self.clone();
        ThreadedDevice::exchanging(move || fake.connect())
    }
}

fn device() -> (Fake, ThreadedDevice) {
    let fake = Fake::default();
    let device = fake.open().unwrap();
    (fake, device)
}

fn push(x: f64) -> Wrench {
    Wrench {
        force: DVec3::new(x, 0.0, 0.0),
        ..Wrench::ZERO
    }
}

/// Sends until the device pushes so.
fn pushing(fake: &Fake, device: &mut ThreadedDevice, x: f64) {
    wait_for(|| {
        device.send(&push(x)).unwrap();
        fake.with(|w| w.force) == x
    });
}

#[test]
fn one_thread_passes_the_conformance_suite() {
    let (_, mut device) = device();
    crate::device::conformance::check(&mut device).unwrap();
}

#[test]
fn a_stop_a_drop_and_a_silent_loop_end_the_force() {
    let (fake, mut one) = device();
    pushing(&fake, &mut one, 2.0);
    one.stop_all().unwrap();
    assert_eq!(fake.with(|w| w.force), 0.0);

    pushing(&fake, &mut one, 2.0);
    let sent = Instant::now();
    one.send(&push(2.0)).unwrap();
    wait_for(|| fake.with(|w| w.force) == 0.0);
    // How soon is looked at where the makers' devices are tested; not at once, at any rate.
    let silent = fake.with(|w| w.since).unwrap() - sent;
    assert!(silent > Duration::from_millis(5), "{silent:?}");
    // Heard again, it rises from nothing.
    fake.with(|w| w.pushed.clear());
    pushing(&fake, &mut one, 2.0);
    assert!(fake.with(|w| w.pushed[0]) < 1.0);

    drop(one);
    assert_eq!(fake.with(|w| w.force), 0.0);
}

#[test]
fn a_slow_loop_is_not_taken_for_a_silent_one() {
    let (fake, mut device) = device();
    for _ in 0..2 {
        device.send(&push(1.0)).unwrap();
        std::thread::sleep(Duration::from_millis(20));
    }
    device.send(&push(1.0)).unwrap();
    wait_for(|| fake.with(|w| w.force) > 0.0);
    fake.with(|w| w.pushed.clear());
    for _ in 0..10 {
        device.send(&push(1.0)).unwrap();
        std::thread::sleep(Duration::from_millis(20));
    }
    // Pauses of 20 ms, where 12 are borne at first: on a machine that stretches one of them to
    // more than twice the one before there is a gap.
    let gaps = fake.with(|w| w.pushed.iter().filter(|f| **f == 0.0).count());
    assert!(gaps <= 2, "{gaps}");
}

#[test]
fn an_unplugged_device_says_why_and_comes_back_gently() {
    let (fake, mut device) = device();
    pushing(&fake, &mut device, 1.0);
    fake.with(|w| w.unplugged = true);
    wait_for(|| device.poll(0.0) == Err(DeviceError::Disconnected));
    wait_for(|| device.send(&push(1.0)) == Err(DeviceError::Disconnected));
    assert_eq!(device.stop_all(), Err(DeviceError::Disconnected));
    assert!(device.last_fault().is_some());
    // Another device in its place is not taken for it.
    fake.with(|w| (w.unplugged, w.other) = (false, true));
    wait_for(|| {
        device
            .last_fault()
            .unwrap()
            .to_string()
            .contains("the same device")
    });
    assert_eq!(device.poll(0.0), Err(DeviceError::Disconnected));
    fake.with(|w| {
        w.other = false;
        w.pushed.clear();
    });
    wait_for(|| device.poll(0.0).is_ok_and(|s| s.buttons == 5));
    pushing(&fake, &mut device, 1.0);
    let pushed = fake.with(|w| w.pushed.clone());
    let first = pushed.iter().find(|f| **f > 0.0).unwrap();
    assert!(*first < 0.5, "{first}");
}

#[test]
fn a_force_that_the_device_refused_rises_anew() {
    let (fake, mut device) = device();
    pushing(&fake, &mut device, 1.0);
    fake.with(|w| w.warm = true);
    wait_for(|| device.last_fault().is_some());
    assert!(device.poll(0.0).is_ok(), "it is still there");
    fake.with(|w| {
        w.warm = false;
        w.pushed.clear();
    });
    pushing(&fake, &mut device, 1.0);
    assert!(fake.with(|w| w.pushed[0]) < 0.5);
}

#[test]
fn a_wrench_that_is_not_finite_is_none() {
    let (fake, mut device) = device();
    pushing(&fake, &mut device, 1.0);
    wait_for(|| {
        device.send(&push(f64::NAN)).unwrap();
        fake.with(|w| w.force) == 0.0
    });
}

#[test]
fn what_cannot_connect_says_so() {
    let fake = Fake::default();
    fake.with(|w| w.unplugged = true);
    let error = fake.open().err().unwrap();
    assert_eq!(error, DeviceError::Disconnected);
}

#[derive(Default)]
struct HalfWorld {
    plugged: AtomicBool,
    wrote: Mutex<Vec<Wrench>>,
    stops: AtomicU32,
    connects: AtomicU32,
}

struct Half(Arc<HalfWorld>, Motion);

impl Half {
    fn check(&self) -> Result<(), DeviceError> {
        if self.0.plugged.load(Ordering::SeqCst) {
            Ok(())
        } else {
            Err(DeviceError::Disconnected)
        }
    }
}

impl InputHalf for Half {
    fn connect(&mut self) -> Result<(), DeviceError> {
        self.0.connects.fetch_add(1, Ordering::SeqCst);
        self.check()
    }
    fn read(&mut self, _: Duration) -> Result<Option<Reading>, DeviceError> {
        self.check()?;
        std::thread::sleep(Duration::from_millis(1));
        Ok(Some(Reading {
            motion: self.1,
            buttons: 5,
        }))
    }
}

impl OutputHalf for Half {
    fn connect(&mut self) -> Result<(), DeviceError> {
        self.check()
    }
    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        self.check()?;
        std::thread::sleep(Duration::from_millis(10));
        self.0.wrote.lock().unwrap().push(*wrench);
        Ok(())
    }
    fn stop_all(&mut self) -> Result<(), DeviceError> {
        self.check()?;
        self.0.stops.fetch_add(1, Ordering::SeqCst);
        Ok(())
    }
}

fn halves(motion: Motion) -> (Arc<HalfWorld>, ThreadedDevice) {
    let world = Arc::new(HalfWorld::default());
    world.plugged.store(true, Ordering::SeqCst);
    let spec = DeviceSpec {
        rate_controlled: matches!(motion, Motion::Rate(_)),
        ..OperatorConfig::default().spec()
    };
    let device = ThreadedDevice::spawn(
        spec,
        Cursor::default(),
        Box::new(Half(Arc::clone(&world), motion)),
        Some(Box::new(Half(Arc::clone(&world), motion))),
    )
    .unwrap();
    (world, device)
}

#[test]
fn a_slow_device_gets_the_newest_force_and_the_loop_does_not_wait() {
    let (world, mut device) = halves(AT_REST);
    for k in 1..=300 {
        device.send(&push(k as f64)).unwrap();
        std::thread::sleep(Duration::from_micros(200));
    }
    wait_for(|| world.wrote.lock().unwrap().last() == Some(&push(300.0)));
    let wrote = world.wrote.lock().unwrap().clone();
    assert!(wrote.len() < 300, "values were overtaken");
    assert!(wrote.windows(2).all(|w| w[0].force.x < w[1].force.x));
}

#[test]
fn stops_when_told_when_the_loop_falls_silent_and_when_dropped() {
    let (world, mut device) = halves(AT_REST);
    let stops = || world.stops.load(Ordering::SeqCst);
    device.stop_all().unwrap();
    assert_eq!(stops(), 1);
    device.send(&push(1.0)).unwrap();
    wait_for(|| stops() == 2);
    drop(device);
    assert_eq!(stops(), 3);
}

#[test]
fn comes_back_after_being_unplugged() {
    let (world, mut device) = halves(AT_REST);
    wait_for(|| device.poll(0.0).is_ok_and(|s| s.buttons == 5));
    world.plugged.store(false, Ordering::SeqCst);
    wait_for(|| device.poll(0.0) == Err(DeviceError::Disconnected));
    wait_for(|| device.send(&push(1.0)) == Err(DeviceError::Disconnected));
    world.plugged.store(true, Ordering::SeqCst);
    wait_for(|| device.poll(0.0).is_ok() && device.send(&push(1.0)).is_ok());
    assert!(world.connects.load(Ordering::SeqCst) >= 2);
}

#[test]
fn rates_move_a_cursor_that_gives_way_and_stays_in_the_workspace() {
    let rate = Twist {
        linear: DVec3::new(0.0, 0.1, 0.0),
        ..Twist::default()
    };
    let (_, mut device) = halves(Motion::Rate(rate));
    wait_for(|| device.poll(0.0).is_ok_and(|s| s.buttons == 5));
    let start = device.poll(0.0).unwrap().pose.translation;
    let end = device.poll(0.1).unwrap().pose.translation;
    assert!((end.y - start.y - 0.01).abs() < 1e-12);
    device.send(&push(2.0)).unwrap();
    let gave = device.poll(0.2).unwrap().pose.translation;
    assert!((gave.x - 2.0 * 0.03 * 0.1).abs() < 1e-12);
    for k in 3..200 {
        device.poll(k as f64 * 0.1).unwrap();
    }
    let edge = device.poll(20.0).unwrap().pose.translation.y;
    assert_eq!(edge, device.spec().workspace / 2.0);
}

#[test]
fn two_threads_pass_the_conformance_suite() {
    let (_, mut device) = halves(AT_REST);
    crate::device::conformance::check(&mut device).unwrap();
}

#[test]
fn a_device_plugged_in_again_is_pushed_gently_at_first() {
    let (world, mut device) = halves(AT_REST);
    device.send(&push(1.0)).unwrap();
    wait_for(|| !world.wrote.lock().unwrap().is_empty());
    world.plugged.store(false, Ordering::SeqCst);
    wait_for(|| device.send(&push(1.0)) == Err(DeviceError::Disconnected));
    world.wrote.lock().unwrap().clear();
    world.plugged.store(true, Ordering::SeqCst);
    wait_for(|| {
        let _ = device.send(&push(1.0)); // until it is back
        world
            .wrote
            .lock()
            .unwrap()
            .last()
            .is_some_and(|w| w.force.x == 1.0)
    });
    let wrote = world.wrote.lock().unwrap().clone();
    // Written every 10 ms at most: the first one falls within the first tenth of the ramp unless
    // the machine is very slow, and none is smaller than the one before.
    assert!(wrote[0].force.x < 1.0, "{}", wrote[0].force.x);
    assert!(wrote.windows(2).all(|w| w[0].force.x <= w[1].force.x));
}
