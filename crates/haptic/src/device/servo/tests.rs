use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use fft_correlate::{Pose, Twist, Wrench};
use glam::DVec3;

use super::device::{Servo, ServoDevice};
use super::link::Link;
use super::pull::pull;
use super::turn::{Handle, Turn};
use crate::device::contract::{Device, DeviceError, DeviceSpec};
use crate::device::hand_body::HandConfig;
use crate::device::hid::fake::until;

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

    fn take(&self, wrench: &Wrench) -> Result<Turn, DeviceError> {
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
            Ok(Turn {
                handle: Some(Handle {
                    pose: Pose::IDENTITY,
                    twist: Twist::default(),
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

impl Servo for Fake {
    fn connect(&mut self) -> Result<DeviceSpec, DeviceError> {
        self.with(|world| {
            world.connects += 1;
            if world.unplugged {
                return Err(DeviceError::Disconnected);
            }
            let mut spec = HandConfig::default().spec();
            if world.other {
                spec.max_force = 1.0;
            }
            Ok(spec)
        })
    }

    fn serve(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let fake = self.clone();
        pull(link, |wrench| fake.take(wrench))
    }
}

fn device() -> (Fake, ServoDevice) {
    let fake = Fake::default();
    let device = ServoDevice::spawn(Box::new(fake.clone())).unwrap();
    (fake, device)
}

fn push(x: f64) -> Wrench {
    Wrench {
        force: DVec3::new(x, 0.0, 0.0),
        ..Wrench::ZERO
    }
}

/// Sends until the device pushes so.
fn pushing(fake: &Fake, device: &mut ServoDevice, x: f64) {
    until(|| {
        device.send(&push(x)).unwrap();
        fake.with(|w| w.force) == x
    });
}

#[test]
fn passes_the_conformance_suite() {
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
    until(|| fake.with(|w| w.force) == 0.0);
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
    until(|| fake.with(|w| w.force) > 0.0);
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
    until(|| device.poll(0.0) == Err(DeviceError::Disconnected));
    until(|| device.send(&push(1.0)) == Err(DeviceError::Disconnected));
    assert_eq!(device.stop_all(), Err(DeviceError::Disconnected));
    assert!(device.last_fault().is_some());
    // Another device in its place is not taken for it.
    fake.with(|w| (w.unplugged, w.other) = (false, true));
    until(|| {
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
    until(|| device.poll(0.0).is_ok_and(|s| s.buttons == 5));
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
    until(|| device.last_fault().is_some());
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
    until(|| {
        device.send(&push(f64::NAN)).unwrap();
        fake.with(|w| w.force) == 0.0
    });
}

#[test]
fn what_cannot_connect_says_so() {
    let fake = Fake::default();
    fake.with(|w| w.unplugged = true);
    let error = ServoDevice::spawn(Box::new(fake)).err().unwrap();
    assert_eq!(error, DeviceError::Disconnected);
}
