//! What must hold, one function each.

use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use fft_correlate::Wrench;
use glam::{DVec2, DVec3};
use haptic::device::hid::{enumerate, open};
use haptic::device::info::{Access, DeviceInfo, DeviceKind};
use haptic::{Device, DeviceError, DeviceState};

use crate::gadget::Gadget;
use crate::models::{Motors, Silent, compact, joystick, wireless};
use crate::uhid::{Identity, Virtual};

type Check = (&'static str, fn());

/// Through `/dev/uhid`.
pub(crate) const UHID: [Check; 6] = [
    ("an empty machine lists nothing", nothing_is_listed),
    ("a split-report mouse steers", || {
        mouse_steers(&compact(), false)
    }),
    ("a combined-report mouse steers", || {
        mouse_steers(&wireless(), true)
    }),
    ("a joystick is set up, pushed and stopped", joystick_pushes),
    (
        "a joystick comes back after being unplugged",
        joystick_comes_back,
    ),
    ("two devices at once keep apart", two_at_once),
];

/// Through a USB host controller.
pub(crate) const USB: [Check; 1] = [("a USB mouse steers, leaves and comes back", usb_mouse)];

/// Runs the checks one after the other, each whatever became of the others.
pub(crate) fn all(checks: &[Check]) -> ExitCode {
    let mut failed = 0;
    for (name, check) in checks {
        let begin = Instant::now();
        let held = std::panic::catch_unwind(check).is_ok();
        failed += u32::from(!held);
        let word = if held { "ok" } else { "FAILED" };
        println!(
            "hid-vm: {word}: {name} ({:.1} s)",
            begin.elapsed().as_secs_f64()
        );
    }
    ExitCode::from(u8::from(failed > 0))
}

/// Waits for what another process or thread brings about.
fn until<T>(what: &str, mut done: impl FnMut() -> Option<T>) -> T {
    let begin = Instant::now();
    loop {
        if let Some(result) = done() {
            return result;
        }
        assert!(begin.elapsed() < Duration::from_secs(20), "never: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn listed(serial: &str) -> DeviceInfo {
    until("listed", || {
        let found = enumerate().expect("list");
        // Its node appears a moment after the device.
        found
            .into_iter()
            .find(|d| d.serial == serial && d.access == Access::Ready)
    })
}

fn nothing_is_listed() {
    assert_eq!(enumerate().expect("list"), []);
}

/// Polls while `feed` sends input, until the state satisfies `wanted`.
fn poll_until(
    device: &mut dyn Device,
    clock: &Instant,
    what: &str,
    mut feed: impl FnMut(),
    wanted: impl Fn(&DeviceState) -> bool,
) -> DeviceState {
    until(what, || {
        feed();
        let state = device.poll(clock.elapsed().as_secs_f64()).ok()?;
        wanted(&state).then_some(state)
    })
}

/// Reports of a mouse pushed right and turned about z to the full.
fn right_and_turned(combined: bool) -> Vec<Vec<u8>> {
    let (full, none) = ([0x5e, 0x01], [0, 0]);
    let translation = [full, none, none].concat();
    let rotation = [none, none, full].concat();
    match combined {
        true => vec![[vec![1], translation, rotation].concat()],
        false => vec![
            [vec![1], translation].concat(),
            [vec![2], rotation].concat(),
        ],
    }
}

fn mouse_steers(identity: &Identity, combined: bool) {
    let mouse = Virtual::plug(identity, Arc::new(Mutex::new(Silent)));
    let info = listed(identity.serial);
    assert_eq!(info.kind, DeviceKind::SpaceMouse);
    let vendor = info.usb.map(|ids| ids.vendor);
    assert_eq!((info.spec.input_dof, vendor), (6, Some(0x256f)));
    let mut device = open(&info).expect("open");
    let clock = Instant::now();
    let send = || {
        mouse.input(&[3, 0b10, 0]);
        right_and_turned(combined)
            .iter()
            .for_each(|r| mouse.input(r));
    };
    let state = poll_until(device.as_mut(), &clock, "steered", send, |s| {
        s.pose.translation.x > 0.02 && s.buttons == 0b10
    });
    // Wire z points down, ours up.
    assert_eq!(state.twist.linear, DVec3::new(0.1, 0.0, 0.0));
    assert_eq!(state.twist.angular, DVec3::new(0.0, 0.0, -1.0));
    assert_eq!(state.pose.translation.y, 0.0);
    drop(mouse);
    until("gone", || {
        let now = clock.elapsed().as_secs_f64();
        (device.poll(now) == Err(DeviceError::Disconnected)).then_some(())
    });
    let again = Virtual::plug(identity, Arc::new(Mutex::new(Silent)));
    let at_rest = poll_until(device.as_mut(), &clock, "back", || (), |_| true);
    assert_eq!(at_rest.buttons, 0);
    drop(again);
}

/// Where the joystick is: x at three quarters of its range, y in the middle, button 1.
const STICK: [u8; 6] = [1, 1, 0x00, 0x40, 0, 0];

fn push(x: f64, y: f64) -> Wrench {
    Wrench {
        force: DVec3::new(x, y, 0.0),
        ..Wrench::ZERO
    }
}

/// Sends the same force until the motors do what they should.
fn push_until(device: &mut dyn Device, motors: &Mutex<Motors>, wrench: &Wrench, wanted: DVec2) {
    until("pushed", || {
        // Refused while the device is away: that is what is waited for.
        let _ = device.send(wrench);
        let push = motors.lock().expect("motors").push();
        (push.distance(wanted) < 2e-4).then_some(())
    });
}

fn joystick_pushes() {
    let motors = Arc::new(Mutex::new(Motors::default()));
    let stick = Virtual::plug(&joystick(), Arc::clone(&motors) as _);
    let info = listed(joystick().serial);
    assert_eq!(info.kind, DeviceKind::ForceFeedback);
    assert_eq!((info.spec.input_dof, info.spec.output_dof), (3, 2));
    let mut device = open(&info).expect("open");
    let clock = Instant::now();
    let state = poll_until(
        device.as_mut(),
        &clock,
        "moved",
        || stick.input(&STICK),
        |_| true,
    );
    assert!((state.pose.translation.x - 0.05).abs() < 1e-4, "{state:?}");
    assert_eq!(state.buttons, 1);
    assert_eq!(motors.lock().expect("motors").effects.len(), 2);
    // 5 N is the full magnitude.
    push_until(
        device.as_mut(),
        &motors,
        &push(2.5, -5.0),
        DVec2::new(0.5, -1.0),
    );
    push_until(
        device.as_mut(),
        &motors,
        &push(-1.0, 0.0),
        DVec2::new(-0.2, 0.0),
    );
    device.stop_all().expect("stop");
    // The kernel hands reports on after the write has returned.
    until("stopped", || {
        (motors.lock().expect("motors").push() == DVec2::ZERO).then_some(())
    });
    // A loop that falls silent is stopped as well.
    push_until(
        device.as_mut(),
        &motors,
        &push(1.0, 1.0),
        DVec2::new(0.2, 0.2),
    );
    until("let go", || {
        (motors.lock().expect("motors").push() == DVec2::ZERO).then_some(())
    });
    keep_pushing(device.as_mut(), &motors);
    drop(device);
    // The kernel hands the last reports on after the writer has closed.
    until("stopped and freed", || {
        let motors = motors.lock().expect("motors");
        (motors.effects.is_empty() && motors.stops >= 3).then_some(())
    });
}

/// A thousand forces at 1 kHz, of which the newest arrive.
fn keep_pushing(device: &mut dyn Device, motors: &Mutex<Motors>) {
    let begin = Instant::now();
    let before = motors.lock().expect("motors").magnitudes;
    for k in 0..1000 {
        device
            .send(&push((f64::from(k) * 0.01).sin(), 0.0))
            .expect("send");
        std::thread::sleep(Duration::from_millis(1));
    }
    let written = motors.lock().expect("motors").magnitudes - before;
    println!(
        "  1000 forces sent in {:.2} s, {written} magnitudes arrived",
        begin.elapsed().as_secs_f64()
    );
    assert!(written > 100, "{written}");
}

fn joystick_comes_back() {
    let motors = || Arc::new(Mutex::new(Motors::default()));
    let first = motors();
    let stick = Virtual::plug(&joystick(), Arc::clone(&first) as _);
    let mut device = open(&listed(joystick().serial)).expect("open");
    push_until(
        device.as_mut(),
        &first,
        &push(5.0, 0.0),
        DVec2::new(1.0, 0.0),
    );
    let clock = Instant::now();
    drop(stick);
    until("gone", || {
        let gone = Err(DeviceError::Disconnected);
        let polled = device.poll(clock.elapsed().as_secs_f64()).map(drop);
        (polled == gone && device.send(&push(5.0, 0.0)) == gone).then_some(())
    });
    println!(
        "  noticed {:.0} ms after",
        clock.elapsed().as_secs_f64() * 1e3
    );
    let second = motors();
    let plugged = Instant::now();
    let stick = Virtual::plug(&joystick(), Arc::clone(&second) as _);
    until("full force again", || {
        let _ = device.send(&push(5.0, 0.0)); // refused until it is back
        let now = second.lock().expect("motors").push().x;
        (now > 0.999).then_some(())
    });
    // The force rises over half a second from when it was found again.
    assert!(plugged.elapsed() > Duration::from_millis(499));
    poll_until(
        device.as_mut(),
        &clock,
        "moved",
        || stick.input(&STICK),
        |s| s.buttons == 1,
    );
}

fn two_at_once() {
    let motors = Arc::new(Mutex::new(Motors::default()));
    let stick = Virtual::plug(&joystick(), Arc::clone(&motors) as _);
    let mouse = Virtual::plug(&wireless(), Arc::new(Mutex::new(Silent)));
    let (stick_info, mouse_info) = (listed(joystick().serial), listed(wireless().serial));
    assert_eq!(enumerate().expect("list").len(), 2);
    let mut held = open(&stick_info).expect("joystick");
    let mut steered = open(&mouse_info).expect("mouse");
    let clock = Instant::now();
    let move_mouse = || right_and_turned(true).iter().for_each(|r| mouse.input(r));
    poll_until(steered.as_mut(), &clock, "steered", move_mouse, |s| {
        s.pose.translation.x > 0.01
    });
    let place = poll_until(
        held.as_mut(),
        &clock,
        "held",
        || stick.input(&STICK),
        |_| true,
    );
    assert!((place.pose.translation.x - 0.05).abs() < 1e-4);
    push_until(
        held.as_mut(),
        &motors,
        &push(0.0, 5.0),
        DVec2::new(0.0, 1.0),
    );
    // One leaves; the other does not notice.
    drop(mouse);
    until("gone", || {
        let now = clock.elapsed().as_secs_f64();
        (steered.poll(now) == Err(DeviceError::Disconnected)).then_some(())
    });
    push_until(
        held.as_mut(),
        &motors,
        &push(0.0, -5.0),
        DVec2::new(0.0, -1.0),
    );
    poll_until(
        held.as_mut(),
        &clock,
        "still held",
        || stick.input(&STICK),
        |_| true,
    );
}

fn usb_mouse() {
    let mut gadget = Gadget::describe().expect("gadget");
    gadget.plug().expect("plug");
    let info = listed("VM-USB");
    assert_eq!(
        info.usb.map(|ids| ids.to_string()).as_deref(),
        Some("046d:c626")
    );
    assert_eq!(info.name, "SpaceNavigator");
    let mut device = open(&info).expect("open");
    let clock = Instant::now();
    steer_usb(device.as_mut(), &mut gadget, &clock);
    gadget.unplug().expect("unplug");
    until("gone", || {
        let now = clock.elapsed().as_secs_f64();
        (device.poll(now) == Err(DeviceError::Disconnected)).then_some(())
    });
    gadget.plug().expect("plug again");
    steer_usb(device.as_mut(), &mut gadget, &clock);
    gadget.unplug().expect("unplug");
}

/// Pushes the USB mouse right and turns it about its y; wire ry is our -ry.
fn steer_usb(device: &mut dyn Device, gadget: &mut Gadget, clock: &Instant) {
    let reports = [[1, 0x5e, 0x01, 0, 0, 0, 0], [2, 0, 0, 0x5e, 0x01, 0, 0]];
    poll_until(
        device,
        clock,
        "steered over USB",
        || reports.iter().for_each(|r| gadget.input(r)),
        |s| s.twist.linear.x == 0.1 && s.twist.angular.y == -1.0,
    );
}
