use super::*;
use crate::device::contract::Device;
use crate::device::hid::fake::{Fake, wait_for};
use crate::device::hid::port::HidInput;
use crate::device::threaded::Cursor;
use crate::device::threaded::ThreadedDevice;

#[test]
fn reads_the_split_layout() {
    // X +350, Y -350, Z +1.
    let translation = [0x01, 0x5e, 0x01, 0xa2, 0xfe, 0x01, 0x00];
    assert_eq!(parse(&translation), Report::Translation([350, -350, 1]));
    let rotation = [0x02, 0x00, 0x00, 0x00, 0x00, 0x0c, 0xfe];
    assert_eq!(parse(&rotation), Report::Rotation([0, 0, -500]));
}

#[test]
fn reads_the_combined_layout_buttons_and_battery() {
    let both = [1, 0x5e, 0x01, 0, 0, 0, 0, 0xff, 0xff, 0, 0, 0x02, 0x00];
    assert_eq!(parse(&both), Report::Both([350, 0, 0], [-1, 0, 2]));
    assert_eq!(parse(&[3, 0x02, 0x80]), Report::Buttons(0x8002));
    assert_eq!(parse(&[3, 1, 0, 0, 0x80]), Report::Buttons(0x8000_0001));
    assert_eq!(parse(&[0x17, 88, 0]), Report::Battery(88));
}

#[test]
fn short_or_strange_reports_are_nothing() {
    for bytes in [&[][..], &[1], &[1, 2, 3, 4, 5, 6], &[2, 0], &[0x42; 20]] {
        assert_eq!(parse(bytes), Report::Other, "{bytes:?}");
    }
    assert_eq!(parse(&[3]), Report::Buttons(0));
}

#[test]
fn axes_point_right_away_and_up_with_a_dead_zone() {
    let feel = SpaceMouseSettings::default();
    let mut state = Deflection::default();
    // Pushed right, pulled towards the user, pressed down.
    state.take(Report::Translation([350, 350, 350]), &feel);
    assert_eq!(state.twist.linear, DVec3::new(0.1, -0.1, -0.1));
    state.take(Report::Rotation([500, 0, -17]), &feel);
    assert_eq!(state.twist.angular, DVec3::new(1.0, 0.0, 0.0).abs());
    let just_outside = feel.axis(18);
    assert!(just_outside > 0.0 && just_outside < 0.01);
}

#[test]
fn every_model_has_its_own_ids() {
    for (i, a) in MODELS.iter().enumerate() {
        assert!(MODELS[i + 1..].iter().all(|b| (a.0, a.1) != (b.0, b.1)));
    }
    assert_eq!(model(0x046d, 0xc626), Some("SpaceNavigator"));
    assert_eq!(model(0x046d, 0xc077), None);
}

/// Pushed right to the full with button 2, in either layout.
fn pushed(combined: bool) -> Fake {
    let fake = Fake::new(Vec::new(), |_| unreachable!("it is never asked"));
    let mut report = vec![1, 0x5e, 0x01, 0, 0, 0, 0];
    if combined {
        report.extend([0; 6]);
    }
    fake.lock().input = [vec![3, 2]].into();
    fake.lock().rest = report;
    fake
}

fn device(fake: &Fake) -> ThreadedDevice {
    let input = HidInput::new(
        fake.connector(),
        SpaceMouse::new(SpaceMouseSettings::default()),
    );
    ThreadedDevice::spawn(spec("mouse"), Cursor::default(), Box::new(input), None).unwrap()
}

#[test]
fn as_a_device_it_steers_a_cursor_and_passes_the_conformance_suite_in_both_layouts() {
    for combined in [false, true] {
        let mut device = device(&pushed(combined));
        crate::device::conformance::check(&mut device).unwrap();
        let start = device.poll(1.0).unwrap();
        let end = device.poll(1.05).unwrap();
        assert_eq!(start.buttons, 2);
        let moved = end.pose.translation.x - start.pose.translation.x;
        assert!((moved - 0.1 * 0.05).abs() < 1e-12, "{moved}");
    }
}

#[test]
fn unplugged_it_is_gone_and_comes_back_at_rest_where_it_was() {
    let fake = pushed(false);
    let mut device = device(&fake);
    wait_for(|| device.poll(0.0).is_ok_and(|s| s.buttons == 2));
    device.poll(0.05).unwrap();
    let place = device.poll(0.1).unwrap().pose;
    fake.lock().plugged = false;
    wait_for(|| device.poll(0.1) == Err(DeviceError::Disconnected));
    fake.lock().rest = Vec::new();
    fake.lock().plugged = true;
    wait_for(|| device.poll(0.1).is_ok());
    let back = device.poll(0.2).unwrap();
    assert_eq!((back.pose, back.buttons), (place, 0));
    assert_eq!(fake.lock().connections, 2);
}

#[test]
fn a_deflected_device_that_falls_silent_counts_as_let_go() {
    let mut mouse = SpaceMouse::new(SpaceMouseSettings::default());
    assert_eq!(mouse.silence(SILENCE), None);
    mouse.decode(&[3, 1]).unwrap();
    mouse.decode(&[1, 0x5e, 0x01, 0, 0, 0, 0]).unwrap();
    assert_eq!(mouse.silence(SILENCE / 2), None);
    let gone = mouse.silence(SILENCE).unwrap();
    assert_eq!(gone.motion, Motion::Rate(Twist::default()));
    assert_eq!(gone.buttons, 1);
    assert_eq!(mouse.silence(SILENCE), None);
}

#[test]
fn known_models_and_new_ones_are_recognised_but_not_the_keyboards_of_their_receivers() {
    let axes = &[MULTI_AXIS][..];
    assert_eq!(
        recognise(0x046d, 0xc626, axes),
        Some(Some("SpaceNavigator"))
    );
    assert_eq!(
        recognise(0x046d, 0xc626, &[(0, 0)]),
        Some(Some("SpaceNavigator"))
    );
    assert_eq!(recognise(VENDOR, 0xcfff, axes), Some(None));
    assert_eq!(recognise(VENDOR, 0xc652, &[(1, 6), (1, 2)]), None);
    assert_eq!(recognise(0x046d, 0xc077, axes), None);
    assert_eq!(recognise(VENDOR, 0xcfff, &[(0, 0)]), None);
}

proptest::proptest! {
    /// Whatever a device sends, the cursor is asked for finite rates within the full deflection.
    #[test]
    fn any_bytes_give_bounded_rates(reports: Vec<Vec<u8>>) {
        let feel = SpaceMouseSettings::default();
        let mut mouse = SpaceMouse::new(feel);
        for report in reports {
            if let Some(Reading { motion: Motion::Rate(rate), .. }) = mouse.decode(&report) {
                assert!(rate.linear.abs().max_element() <= feel.speed);
                assert!(rate.angular.abs().max_element() <= feel.angular_speed);
            }
        }
    }
}
