//! Devices kept plugged in and moving, for other programs to look at.

use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::models::{Motors, Silent, compact, joystick};
use crate::uhid::Virtual;

/// The joystick's x at a twentieth of its range, 5 mm: where a wall pushes.
const ASIDE: [u8; 6] = [1, 0, 0x66, 0x06, 0, 0];

/// Plugs in what `name` says: the compact mouse is pushed right with button 2 held, the joystick
/// held at the middle. Unplugged when the file `release` appears.
pub(crate) fn hold(name: &str, release: &Path) -> ExitCode {
    let motors = Arc::new(Mutex::new(Motors::default()));
    let mouse = ["compact", "both"]
        .contains(&name)
        .then(|| Virtual::plug(&compact(), Arc::new(Mutex::new(Silent))));
    let stick = ["joystick", "both"]
        .contains(&name)
        .then(|| Virtual::plug(&joystick(), Arc::clone(&motors) as _));
    let mut greatest = 0.0f64;
    while !release.exists() {
        if let Some(mouse) = &mouse {
            mouse.input(&[3, 0b10, 0]);
            mouse.input(&[1, 0x5e, 0x01, 0, 0, 0, 0]);
        }
        if let Some(stick) = &stick {
            stick.input(&ASIDE);
        }
        let push = motors.lock().expect("motors").push().length();
        if greatest == 0.0 && push > 0.0 {
            println!("pushing");
        }
        greatest = greatest.max(push);
        std::thread::sleep(Duration::from_millis(8));
    }
    if stick.is_some() {
        let motors = motors.lock().expect("motors");
        println!(
            "joystick: {} magnitudes, greatest push {greatest:.3} of full, {} stops, {} effects left, \
             push at the end {:.3}",
            motors.magnitudes,
            motors.stops,
            motors.effects.len(),
            motors.push().length()
        );
    }
    ExitCode::SUCCESS
}
