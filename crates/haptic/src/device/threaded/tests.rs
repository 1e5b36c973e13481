use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

use std::time::Duration;

use fft_correlate::{Pose, Twist, Wrench};
use glam::DVec3;

use super::*;
use crate::device::contract::{Device, DeviceError, DeviceSpec};
use crate::device::hid::fake::until;

#[derive(Default)]
struct World {
    plugged: AtomicBool,
    wrote: Mutex<Vec<Wrench>>,
    stops: AtomicU32,
    connects: AtomicU32,
}

struct Half(Arc<World>, Motion);

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

fn device(motion: Motion) -> (Arc<World>, Threaded) {
    let world = Arc::new(World::default());
    world.plugged.store(true, Ordering::SeqCst);
    let spec = DeviceSpec {
        rate_controlled: matches!(motion, Motion::Rate(_)),
        ..crate::device::hand_body::HandConfig::default().spec()
    };
    let device = Threaded::spawn(
        spec,
        Cursor::default(),
        Box::new(Half(Arc::clone(&world), motion)),
        Some(Box::new(Half(Arc::clone(&world), motion))),
    )
    .unwrap();
    (world, device)
}

fn push(x: f64) -> Wrench {
    Wrench {
        force: DVec3::new(x, 0.0, 0.0),
        ..Wrench::ZERO
    }
}

#[test]
fn a_slow_device_gets_the_newest_force_and_the_loop_does_not_wait() {
    let (world, mut device) = device(Motion::Position(Pose::IDENTITY));
    for k in 1..=300 {
        device.send(&push(k as f64)).unwrap();
        std::thread::sleep(Duration::from_micros(200));
    }
    until(|| world.wrote.lock().unwrap().last() == Some(&push(300.0)));
    let wrote = world.wrote.lock().unwrap().clone();
    assert!(wrote.len() < 300, "values were overtaken");
    assert!(wrote.windows(2).all(|w| w[0].force.x < w[1].force.x));
}

#[test]
fn stops_when_told_when_the_loop_falls_silent_and_when_dropped() {
    let (world, mut device) = device(Motion::Position(Pose::IDENTITY));
    let stops = || world.stops.load(Ordering::SeqCst);
    device.stop_all().unwrap();
    assert_eq!(stops(), 1);
    device.send(&push(1.0)).unwrap();
    until(|| stops() == 2);
    drop(device);
    assert_eq!(stops(), 3);
}

#[test]
fn comes_back_after_being_unplugged() {
    let (world, mut device) = device(Motion::Position(Pose::IDENTITY));
    until(|| device.poll(0.0).is_ok_and(|s| s.buttons == 5));
    world.plugged.store(false, Ordering::SeqCst);
    until(|| device.poll(0.0) == Err(DeviceError::Disconnected));
    until(|| device.send(&push(1.0)) == Err(DeviceError::Disconnected));
    world.plugged.store(true, Ordering::SeqCst);
    until(|| device.poll(0.0).is_ok() && device.send(&push(1.0)).is_ok());
    assert!(world.connects.load(Ordering::SeqCst) >= 2);
}

#[test]
fn rates_move_a_cursor_that_gives_way_and_stays_in_the_workspace() {
    let rate = Twist {
        linear: DVec3::new(0.0, 0.1, 0.0),
        ..Twist::default()
    };
    let (_, mut device) = device(Motion::Rate(rate));
    until(|| device.poll(0.0).is_ok_and(|s| s.buttons == 5));
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
fn passes_the_conformance_suite() {
    let (_, mut device) = device(Motion::Position(Pose::IDENTITY));
    crate::device::conformance::check(&mut device).unwrap();
}

#[test]
fn a_device_plugged_in_again_is_pushed_gently_at_first() {
    let (world, mut device) = device(Motion::Position(Pose::IDENTITY));
    device.send(&push(1.0)).unwrap();
    until(|| !world.wrote.lock().unwrap().is_empty());
    world.plugged.store(false, Ordering::SeqCst);
    until(|| device.send(&push(1.0)) == Err(DeviceError::Disconnected));
    world.wrote.lock().unwrap().clear();
    world.plugged.store(true, Ordering::SeqCst);
    until(|| {
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
