//! The devices that are pretended to.

use std::collections::BTreeMap;

use glam::DVec2;

use crate::uhid::{Firmware, Identity};

/// The bytes of a text of hexadecimal numbers; lines that begin with # are remarks.
fn unhex(text: &str) -> Vec<u8> {
    let lines = text.lines().filter(|l| !l.starts_with('#'));
    let numbers = lines.flat_map(str::split_whitespace);
    numbers
        .map(|n| u8::from_str_radix(n, 16).expect("hexadecimal"))
        .collect()
}

/// A SpaceMouse Compact: split reports.
pub(crate) fn compact() -> Identity {
    Identity {
        name: "3Dconnexion SpaceMouse Compact",
        serial: "VM-COMPACT",
        vendor: 0x256f,
        product: 0xc635,
        descriptor: unhex(include_str!(
            "../../../crates/haptic/descriptors/space-mouse-split.hex"
        )),
    }
}

/// A cabled SpaceMouse Wireless: combined reports.
pub(crate) fn wireless() -> Identity {
    Identity {
        name: "3Dconnexion SpaceMouse Wireless",
        serial: "VM-WIRELESS",
        vendor: 0x256f,
        product: 0xc62e,
        descriptor: unhex(include_str!(
            "../../../crates/haptic/descriptors/space-mouse-combined.hex"
        )),
    }
}

/// A two-axis force feedback joystick with the ids of OpenFFBoard.
pub(crate) fn joystick() -> Identity {
    Identity {
        name: "Virtual FFB Joystick",
        serial: "VM-PID",
        vendor: 0x1209,
        product: 0xffb0,
        descriptor: unhex(include_str!(
            "../../../crates/haptic/descriptors/pid-two-axes.hex"
        )),
    }
}

/// A device that only sends.
pub(crate) struct Silent;

impl Firmware for Silent {
    fn told(&mut self, _: &[u8]) {}

    fn asked(&mut self, id: u8) -> Vec<u8> {
        vec![id]
    }
}

/// Effects a joystick can hold.
const ROOM: u8 = 4;

/// One effect as the joystick has it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Effect {
    axes: u8,
    magnitude: i16,
    playing: bool,
}

/// What is inside a joystick with the reports of `pid-two-axes.hex`.
#[derive(Debug, Default)]
pub(crate) struct Motors {
    pub(crate) enabled: bool,
    pub(crate) gain: u8,
    pub(crate) effects: BTreeMap<u8, Effect>,
    pub(crate) stops: u32,
    pub(crate) magnitudes: u32,
    loaded: Option<u8>,
}

impl Motors {
    /// What the motors do now, as a share of what they can.
    pub(crate) fn push(&self) -> DVec2 {
        let playing = self.effects.values().filter(|e| e.playing);
        let sum = playing.fold(DVec2::ZERO, |sum, e| {
            let along = DVec2::new(f64::from(e.axes & 1), f64::from(e.axes >> 1 & 1));
            sum + along * f64::from(e.magnitude) / 10_000.0
        });
        if self.enabled {
            sum * f64::from(self.gain) / 255.0
        } else {
            DVec2::ZERO
        }
    }

    fn effect(&mut self, block: u8) -> &mut Effect {
        self.effects.entry(block).or_default()
    }

    fn control(&mut self, commands: u8) {
        for bit in (0..8).filter(|b| commands >> b & 1 == 1) {
            match bit {
                0 => self.enabled = true,
                1 => self.enabled = false,
                2 => {
                    self.stops += 1;
                    self.effects.values_mut().for_each(|e| e.playing = false);
                }
                3 => self.effects.clear(),
                _ => {}
            }
        }
    }
}

impl Firmware for Motors {
    fn told(&mut self, report: &[u8]) {
        match *report {
            [0x01, block, 1, ..] if report.len() == 22 => self.effect(block).axes = report[13],
            [0x05, block, low, high] => {
                self.magnitudes += 1;
                self.effect(block).magnitude = i16::from_le_bytes([low, high]);
            }
            [0x0a, block, operation, _] => self.effect(block).playing = operation != 3,
            [0x0b, block] => {
                self.effects.remove(&block);
            }
            [0x0c, commands] => self.control(commands),
            [0x0d, gain] => self.gain = gain,
            [0x11, 1, ..] => {
                self.loaded = (1..=ROOM).find(|b| !self.effects.contains_key(b));
                if let Some(block) = self.loaded {
                    self.effects.insert(block, Effect::default());
                }
            }
            _ => println!("  the joystick does not know {report:02x?}"),
        }
    }

    fn asked(&mut self, id: u8) -> Vec<u8> {
        match id {
            0x12 => match self.loaded {
                Some(block) => vec![id, block, 1, 0x00, 0x10],
                None => vec![id, 0, 2, 0, 0],
            },
            0x13 => vec![id, 0x00, 0x10, ROOM, 0b01],
            _ => vec![id],
        }
    }
}
