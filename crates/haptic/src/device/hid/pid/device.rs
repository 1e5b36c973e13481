//! A PID device as the loop has it: set up, pushed along its axes, stopped.

use std::time::{Duration, Instant};

use fft_correlate::Wrench;

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::hid::pid::layout::{BlockLoad, PidLayout, Pool};
use crate::device::hid::pid::settings::PidSettings;
use crate::device::hid::pid::usage;
use crate::device::hid::port::{Connector, Decoder, HidInput, HidPort};
use crate::device::threaded::{Cursor, ThreadedDevice};
use crate::device::threaded::{OutputHalf, Reading};

/// How often a device is asked for a block it has not loaded yet.
const LOAD_TRIES: u32 = 20;

/// Pause between two such questions.
const LOAD_PAUSE: Duration = Duration::from_millis(2);

/// Longest time for the setup: the system waits for seconds for each answer of a device.
const SETUP: Duration = Duration::from_secs(5);

/// A force that does not change is sent again after this time: that is how an unplugged device is
/// noticed while it is held still.
const REFRESH: Duration = Duration::from_millis(100);

/// Opens a PID device through two connections of its own, one per direction.
///
/// # Errors
/// If it is gone, may not be opened, or cannot play constant forces.
pub fn open(
    name: &str,
    mut input: Connector,
    output: Connector,
    settings: PidSettings,
) -> Result<ThreadedDevice, DeviceError> {
    let layout = PidLayout::parse(name, &input()?.descriptor()?)?;
    let spec: DeviceSpec = layout.spec(name, &settings);
    let decoder = PidInput {
        name: name.to_owned(),
        layout: layout.clone(),
        workspace: settings.workspace,
    };
    let write = PidOutput {
        name: name.to_owned(),
        connector: output,
        port: None,
        layout,
        settings,
        effects: Vec::new(),
    };
    ThreadedDevice::spawn(
        spec,
        Cursor::default(),
        Box::new(HidInput::new(input, decoder)),
        Some(Box::new(write)),
    )
}

/// The meaning of a PID device's input reports.
struct PidInput {
    name: String,
    layout: PidLayout,
    workspace: f64,
}

impl Decoder for PidInput {
    fn start(&mut self, port: &mut dyn HidPort) -> Result<(), DeviceError> {
        // A device that comes back may be another one of the same kind.
        self.layout = PidLayout::parse(&self.name, &port.descriptor()?)?;
        Ok(())
    }

    fn decode(&mut self, report: &[u8]) -> Option<Reading> {
        self.layout.reading(report, self.workspace)
    }

    fn silence(&mut self, _: Duration) -> Option<Reading> {
        None // a stick that rests may well be silent
    }
}

/// One effect on the device.
#[derive(Debug, Clone, Copy)]
struct Effect {
    axis: usize,
    block: i64,
    /// The magnitude sent last, to leave out what does not change.
    magnitude: Option<i64>,
    sent: Instant,
    playing: bool,
}

/// The writing half.
struct PidOutput {
    name: String,
    connector: Connector,
    port: Option<Box<dyn HidPort>>,
    layout: PidLayout,
    settings: PidSettings,
    effects: Vec<Effect>,
}

impl PidOutput {
    /// Sets the device up; refuses one that has not answered all by `until`.
    fn prepare(&mut self, port: &mut dyn HidPort, until: Instant) -> Result<(), DeviceError> {
        for command in [usage::RESET, usage::ENABLE] {
            if let Some(report) = self.layout.control(command) {
                port.write(&report)?;
            }
        }
        if let Some(report) = self.layout.gain(self.settings.gain) {
            port.write(&report)?;
        }
        let axes = self.layout.output_axes();
        self.check_pool(port, axes.len())?;
        for axis in axes {
            let block = self.load(port, until)?;
            self.effects.push(Effect {
                axis,
                block,
                magnitude: None,
                sent: Instant::now(),
                playing: false,
            });
            port.write(&self.layout.set_effect(block, axis))?;
        }
        Ok(())
    }

    fn refused(&self, found: impl Into<String>) -> DeviceError {
        DeviceError::Unsuitable {
            name: self.name.clone(),
            expected: "room for one constant force per axis".into(),
            found: found.into(),
        }
    }

    /// Refuses a device that says it cannot hold the effects.
    fn check_pool(&self, port: &mut dyn HidPort, axes: usize) -> Result<(), DeviceError> {
        let Some(mut answer) = self.layout.blank_pool() else {
            return Ok(());
        };
        // A device that will not say may still play: creating the effects shows it.
        let Ok(length) = port.get_feature(&mut answer) else {
            return Ok(());
        };
        match self.layout.pool(&answer[..length.min(answer.len())]) {
            Some(Pool {
                device_managed: false,
                ..
            }) => Err(self.refused("a pool that the host must manage")),
            Some(Pool { simultaneous, .. }) if simultaneous > 0 && simultaneous < axes as i64 => {
                Err(self.refused(format!("{simultaneous} effects at once for {axes} axes")))
            }
            _ => Ok(()),
        }
    }

    /// Creates an effect and asks which block it got.
    fn load(&self, port: &mut dyn HidPort, until: Instant) -> Result<i64, DeviceError> {
        port.set_feature(&self.layout.create())?;
        let mut answer = Vec::new();
        for _ in 0..LOAD_TRIES {
            if Instant::now() >= until {
                return Err(self.refused(format!("no effect within {SETUP:?}")));
            }
            answer = self.layout.blank_block_load();
            let length = port.get_feature(&mut answer)?;
            answer.truncate(length);
            match self.layout.block_load(&answer) {
                BlockLoad::Loaded(block) => return Ok(block),
                BlockLoad::Full => return Err(self.refused("a full effect pool")),
                BlockLoad::Error => return Err(self.refused("an error loading the effect")),
                BlockLoad::Unclear => std::thread::sleep(LOAD_PAUSE),
            }
        }
        Err(self.refused(format!("block load answer {answer:02x?}")))
    }

    /// Gives the blocks back, so that whoever opens the device next finds room.
    fn free(&mut self) {
        let Some(port) = &mut self.port else {
            return;
        };
        for effect in self.effects.drain(..) {
            if let Some(report) = self.layout.free(effect.block) {
                // A device that is gone has nothing to free.
                let _ = port.write(&report);
            }
        }
    }
}

impl OutputHalf for PidOutput {
    fn connect(&mut self) -> Result<(), DeviceError> {
        self.port = None;
        self.effects.clear();
        let mut port = (self.connector)()?;
        // A device that comes back may be another one of the same kind.
        self.layout = PidLayout::parse(&self.name, &port.descriptor()?)?;
        let prepared = self.prepare(port.as_mut(), Instant::now() + SETUP);
        self.port = Some(port);
        if prepared.is_err() {
            self.free();
            self.port = None;
        }
        prepared
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        let port = self.port.as_mut().ok_or(DeviceError::Disconnected)?;
        for effect in &mut self.effects {
            let full = self.settings.signs[effect.axis] / self.settings.max_force;
            let magnitude = self.layout.magnitude(wrench.force[effect.axis] * full);
            if effect.magnitude != Some(magnitude) || effect.sent.elapsed() > REFRESH {
                port.write(&self.layout.constant(effect.block, magnitude))?;
                effect.magnitude = Some(magnitude);
                effect.sent = Instant::now();
            }
            if !effect.playing {
                port.write(&self.layout.start(effect.block))?;
                effect.playing = true;
            }
        }
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        let port = self.port.as_mut().ok_or(DeviceError::Disconnected)?;
        for effect in &mut self.effects {
            port.write(&self.layout.constant(effect.block, 0))?;
            effect.magnitude = Some(0);
            effect.playing = false;
        }
        match self.layout.control(usage::STOP_ALL) {
            Some(report) => port.write(&report),
            None => Ok(()),
        }
    }
}

impl Drop for PidOutput {
    fn drop(&mut self) {
        self.free();
    }
}

#[cfg(test)]
#[path = "device_tests.rs"]
mod tests;
