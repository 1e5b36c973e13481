//! The columns of a log.

use fft_correlate::Pose;

use crate::path::sample::{Sample, flags};

/// Columns that are empty while there is no input.
const INPUT_COLUMNS: usize = 15;

/// Columns of a log: SI units, device frame unless stated. `object_*` is the virtual object (the
/// moving part) in the scene's frame. Input columns are empty while there was no input.
pub const COLUMNS: [&str; 43] = [
    "tick",
    "time",
    "dt",
    "x",
    "y",
    "z",
    "qx",
    "qy",
    "qz",
    "qw",
    "wx",
    "wy",
    "wz",
    "vx",
    "vy",
    "vz",
    "buttons",
    "timestamp",
    "object_x",
    "object_y",
    "object_z",
    "object_qx",
    "object_qy",
    "object_qz",
    "object_qw",
    "energy",
    "coverage",
    "tx",
    "ty",
    "tz",
    "fx",
    "fy",
    "fz",
    "gain",
    "balance",
    "work_force",
    "work_torque",
    "made",
    "taken",
    "exchanged",
    "evaluations",
    "flags",
    "faults",
];

/// The numbers of a sample in the order of [`COLUMNS`], but for the last, which is text; `None`
/// where there was no input.
pub fn numbers(s: &Sample) -> [Option<f64>; COLUMNS.len() - 1] {
    let input = s.input.as_ref().map(|input| {
        let mut row = [0.0; INPUT_COLUMNS];
        row[..7].copy_from_slice(&pose(&input.pose));
        row[7..10].copy_from_slice(&input.twist.angular.to_array());
        row[10..13].copy_from_slice(&input.twist.linear.to_array());
        row[13..].copy_from_slice(&[f64::from(input.buttons), input.timestamp]);
        row
    });
    let a = &s.account;
    let groups: [&[f64]; 6] = [
        &pose(&s.object),
        &[s.energy, s.coverage],
        &s.wrench.torque.to_array(),
        &s.wrench.force.to_array(),
        &[s.gain, a.balance, a.work_force, a.work_torque, a.made],
        &[
            a.taken,
            a.exchanged,
            f64::from(s.evaluations),
            f64::from(s.flags),
        ],
    ];
    let mut row = [None; COLUMNS.len() - 1];
    let first = [s.tick as f64, s.time, s.dt].map(Some);
    let middle = input.map_or([None; INPUT_COLUMNS], |row| row.map(Some));
    let rest = groups.into_iter().flatten().copied().map(Some);
    let all = first.into_iter().chain(middle).chain(rest);
    row.iter_mut()
        .zip(all)
        .for_each(|(cell, value)| *cell = value);
    row
}

fn pose(pose: &Pose) -> [f64; 7] {
    let ([x, y, z], [qx, qy, qz, qw]) = (pose.translation.to_array(), pose.rotation.to_array());
    [x, y, z, qx, qy, qz, qw]
}

/// The last of [`COLUMNS`]: names of the flags that are set, with spaces between.
pub fn faults(s: &Sample) -> String {
    let names = flags::NAMES;
    let set = (0..names.len()).filter(|bit| s.flags & (1 << bit) != 0);
    set.map(|bit| names[bit]).collect::<Vec<_>>().join(" ")
}
