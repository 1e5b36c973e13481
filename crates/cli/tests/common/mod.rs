//! What the command-line tests share.
#![allow(dead_code, reason = "each test binary uses its part")]

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

/// Runs the command in `folder`.
pub(crate) fn pegfit(folder: &Path, args: &[&str]) -> Output {
    pegfit_with_input(folder, args, "")
}

/// Runs the command in `folder` with `input` on standard input.
pub(crate) fn pegfit_with_input(folder: &Path, args: &[&str], input: &str) -> Output {
    Command::cargo_bin("pegfit")
        .unwrap()
        .current_dir(folder)
        .args(args)
        .write_stdin(input.to_owned())
        .output()
        .unwrap()
}

/// Standard output as text.
pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Standard error as text.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A box of the given sides, centred on the origin, as OBJ.
pub(crate) fn cuboid_obj(sides: [f64; 3]) -> String {
    let mut text = String::new();
    for corner in 0..8 {
        let at = |axis: usize| sides[axis] * (f64::from(corner >> axis & 1) - 0.5);
        text += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    // Two triangles per face, counter-clockwise seen from outside.
    for [a, b, c, d] in [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ] {
        text += &format!(
            "f {} {} {}\nf {} {} {}\n",
            a + 1,
            b + 1,
            c + 1,
            a + 1,
            c + 1,
            d + 1
        );
    }
    text
}
