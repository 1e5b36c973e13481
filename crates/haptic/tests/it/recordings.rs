//! Recordings that no device gives are refused before they are replayed.

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use haptic::log::ReplayError;
use haptic::{DeviceState, HapticConfig, OperatorConfig, Replay, Sample, flags};

type Change = fn(&mut Sample);

/// A hand that moves at 0.1 m/s, a tick each millisecond.
fn recording() -> Vec<Sample> {
    let sample = |tick: u32| {
        let time = f64::from(tick) * 1e-3;
        let pose = Pose::from_translation(DVec3::X * 0.1 * time);
        Sample {
            tick: tick.into(),
            time,
            dt: 1e-3,
            input: Some(DeviceState::at_rest(pose, time)),
            ..Sample::default()
        }
    };
    (0..200).map(sample).collect()
}

fn replay(samples: Vec<Sample>) -> Result<(), ReplayError> {
    let spec = OperatorConfig::default().spec();
    Replay::new(spec, samples, &HapticConfig::default()).map(drop)
}

/// What is said of a recording with another tick 100.
fn said(change: Change) -> String {
    let mut samples = recording();
    change(&mut samples[100]);
    replay(samples).unwrap_err().to_string()
}

fn input(sample: &mut Sample) -> &mut DeviceState {
    sample.input.as_mut().unwrap()
}

#[test]
fn an_ordinary_recording_and_the_end_of_one_are_replayed() {
    replay(recording()).unwrap();
    replay(recording().split_off(70)).unwrap();
    // Where the disk was too slow, ticks are missing.
    let mut gap = recording();
    gap.drain(20..150);
    replay(gap).unwrap();
}

#[test]
fn a_tick_that_cannot_have_been_recorded_is_refused_by_line_and_column() {
    let cases: [(&str, Change); 14] = [
        ("time", |s| s.time = f64::NAN),
        ("time", |s| s.time = f64::INFINITY),
        ("time", |s| s.time = 0.05),
        ("dt", |s| s.dt = f64::NAN),
        ("dt", |s| s.dt = -1e-3),
        ("dt", |s| s.dt = 2e-3),
        ("dt", |s| s.dt = 1.0),
        ("x to qw", |s| input(s).pose.translation.y = f64::NAN),
        ("x to qw", |s| input(s).pose.translation.z = 1e7),
        ("x to qw", |s| input(s).pose.rotation.w = f64::INFINITY),
        ("x to qw", |s| {
            input(s).pose.rotation = DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0);
        }),
        ("x to qw", |s| input(s).pose.translation.x += 0.2),
        ("x to qw", |s| {
            input(s).pose.rotation = DQuat::from_rotation_z(1.0);
        }),
        ("timestamp", |s| input(s).timestamp = 100.0),
    ];
    for (index, (item, change)) in cases.into_iter().enumerate() {
        let said = said(change);
        let begin = format!("line 102: {item}: expected ");
        assert!(said.starts_with(&begin), "{index}: {said}");
        assert!(said.contains(", found "), "{index}: {said}");
    }
}

#[test]
fn another_unit_is_refused() {
    // Metres, not millimetres; seconds, not milliseconds.
    let scaled = |change: Change| {
        let mut samples = recording();
        samples.iter_mut().for_each(change);
        replay(samples)
    };
    let millimetres = scaled(|s| input(s).pose.translation *= 1e3);
    assert!(millimetres.is_err());
    let milliseconds = scaled(|s| {
        s.time *= 1e3;
        s.dt *= 1e3;
        input(s).timestamp *= 1e3;
    });
    assert!(milliseconds.unwrap_err().to_string().contains("dt: "));
    let stamps = scaled(|s| input(s).timestamp *= 1e3);
    assert!(stamps.unwrap_err().to_string().contains("timestamp: "));
}

#[test]
fn a_fault_that_the_recording_says_is_what_a_device_gave() {
    let cases: [Change; 4] = [
        |s| {
            input(s).pose.translation.y = f64::NAN;
            s.flags = flags::BAD_INPUT;
        },
        |s| {
            input(s).pose.translation.x += 0.2;
            s.flags = flags::JUMP;
        },
        |s| {
            input(s).timestamp = -5.0;
            s.flags = flags::STALE;
        },
        |s| {
            s.input = None;
            s.flags = flags::NO_INPUT;
        },
    ];
    for change in cases {
        let mut samples = recording();
        change(&mut samples[100]);
        replay(samples).unwrap();
    }
}

#[test]
fn a_recording_of_no_device_or_of_nothing_is_refused() {
    assert_eq!(replay(Vec::new()), Err(ReplayError::Empty));
    let good = OperatorConfig::default().spec();
    let bad = [
        ("max_force", f64::NAN),
        ("max_force", -1.0),
        ("max_stiffness", 0.0),
        ("nominal_rate", f64::INFINITY),
    ];
    for (key, value) in bad {
        let mut spec = good.clone();
        match key {
            "max_force" => spec.max_force = value,
            "max_stiffness" => spec.max_stiffness = value,
            _ => spec.nominal_rate = value,
        }
        let refused = Replay::new(spec, recording(), &HapticConfig::default());
        let said = refused.unwrap_err().to_string();
        assert!(said.contains(key) && said.contains("found"), "{said}");
    }
}
