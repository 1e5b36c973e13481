//! USB HID PID devices (Physical Interface Device class 1.0): force feedback on their axes.
//!
//! Ids, sizes and ranges of all reports come from the device's own descriptor. Each axis gets one
//! constant-force effect of unlimited duration, started once; a force is then one short report per
//! axis that changed. Setting up, in this order: device control reset and actuators on, device
//! gain, pool asked for, and per axis create new effect, block load, set effect. At the end: every
//! magnitude zero, stop all, blocks freed.

use std::time::{Duration, Instant};

use fft_correlate::{Pose, Twist, Wrench};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::hid::port::{Connector, Decoder, HidInput, HidPort};
use crate::device::hid::report::{Layouts, ReportField, ReportLayout, Usage, with_group};
use crate::device::threaded::{Cursor, Motion, OutputHalf, Reading, ThreadedDevice};

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

    /// Gives the blocks back, so that the next program to open the device finds room.
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

/// What a descriptor cannot say: the table `pid` of a scene's `[device]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PidSettings {
    /// Force of the full magnitude at the handle, N, > 0. Default 5. A force of the loop becomes
    /// the magnitude `force / max_force`; stated too low, the device pushes harder than the log
    /// says.
    pub max_force: f64,
    /// Edge of the workspace that the full range of the axes stands for, metres, > 0. Default 0.2.
    pub workspace: f64,
    /// Stiffest wall, N/m, at `rate`, > 0. Default 500.
    pub max_stiffness: f64,
    /// Reports per second the device takes, > 0. Default 500.
    pub rate: f64,
    /// Device gain, 0 ..= 1. Default 1: less makes full magnitude weaker than `max_force`.
    pub gain: f64,
    /// +1 or -1 per axis x, y, z: which way a positive magnitude pushes. Default +1.
    pub signs: [f64; 3],
}

impl Default for PidSettings {
    fn default() -> Self {
        Self {
            max_force: 5.0,
            workspace: 0.2,
            max_stiffness: 500.0,
            rate: 500.0,
            gain: 1.0,
            signs: [1.0; 3],
        }
    }
}

/// The reports of one PID device.
#[derive(Debug, Clone, PartialEq)]
pub struct PidLayout {
    set_effect: ReportLayout,
    constant: ReportLayout,
    magnitude: ReportField,
    operation: ReportLayout,
    create: ReportLayout,
    block_load: ReportLayout,
    block_free: Option<ReportLayout>,
    pool: Option<ReportLayout>,
    control: Option<ReportLayout>,
    gain: Option<ReportLayout>,
    input: Vec<ReportLayout>,
}

/// What a device says of an effect it was asked to create.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BlockLoad {
    /// It has this block index.
    Loaded(i64),
    /// There is no room.
    Full,
    /// The device refuses it.
    Error,
    /// Nothing yet, or nothing understood.
    Unclear,
}

/// What a device says of its room for effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pool {
    /// Effects it can play at once; zero if it does not say.
    pub simultaneous: i64,
    /// Whether it looks after its memory itself.
    pub device_managed: bool,
}

impl PidLayout {
    /// Finds the reports needed in a report descriptor.
    ///
    /// # Errors
    /// If it is no descriptor or lacks a report that constant forces need.
    pub fn parse(name: &str, descriptor: &[u8]) -> Result<Self, DeviceError> {
        let unsuitable = |expected: String, found: &str| DeviceError::Unsuitable {
            name: name.to_owned(),
            expected,
            found: found.to_owned(),
        };
        let all = Layouts::parse(name, descriptor)?;
        let need = |layouts: &[ReportLayout], group, what: &str| {
            with_group(layouts, group).cloned().ok_or_else(|| {
                let expected = format!("a PID {what} report (usage {group:#010x})");
                unsuitable(expected, "none in the descriptor")
            })
        };
        let constant = need(&all.output, usage::SET_CONSTANT, "set constant force")?;
        let magnitude = constant.find(usage::MAGNITUDE).cloned();
        let layout = Self {
            set_effect: need(&all.output, usage::SET_EFFECT, "set effect")?,
            magnitude: magnitude
                .filter(|m| m.minimum < 0 && m.maximum > 0)
                .ok_or_else(|| {
                    unsuitable(
                        "a magnitude of either sign".into(),
                        "none in the descriptor",
                    )
                })?,
            constant,
            operation: need(&all.output, usage::OPERATION, "effect operation")?,
            create: need(&all.feature, usage::CREATE, "create new effect")?,
            block_load: need(&all.feature, usage::BLOCK_LOAD, "block load")?,
            block_free: with_group(&all.output, usage::BLOCK_FREE).cloned(),
            pool: with_group(&all.feature, usage::POOL).cloned(),
            control: with_group(&all.output, usage::CONTROL).cloned(),
            gain: with_group(&all.output, usage::GAIN_REPORT).cloned(),
            input: all.input,
        };
        if layout.output_axes().is_empty() {
            let expected = "axes to push along in the set effect report".into();
            return Err(unsuitable(expected, "none"));
        }
        Ok(layout)
    }

    /// Axes with a motor: 0 for x, 1 for y, 2 for z.
    pub fn output_axes(&self) -> Vec<usize> {
        (0..3).filter(|a| self.enable_bit(*a).is_some()).collect()
    }

    fn enable_bit(&self, axis: usize) -> Option<&ReportField> {
        let bits = self.set_effect.fields.iter();
        bits.filter(|s| s.directly_in(usage::AXES_ENABLE))
            .find(|s| s.usage == usage::AXES[axis])
    }

    /// The device record.
    pub fn spec(&self, name: &str, settings: &PidSettings) -> DeviceSpec {
        let last = self.output_axes().into_iter().max();
        DeviceSpec {
            name: name.to_owned(),
            input_dof: 3,
            output_dof: last.map_or(0, |axis| axis as u8 + 1),
            rate_controlled: false,
            max_force: settings.max_force,
            max_torque: 0.0,
            max_stiffness: settings.max_stiffness,
            max_rotational_stiffness: f64::INFINITY,
            workspace: settings.workspace,
            nominal_rate: settings.rate,
        }
    }

    /// Create New Effect: a constant force.
    fn create(&self) -> Vec<u8> {
        let mut report = self.create.blank();
        self.create.choose(&mut report, usage::CONSTANT_FORCE);
        report
    }

    /// A Block Load report to be filled by the device.
    fn blank_block_load(&self) -> Vec<u8> {
        self.block_load.blank()
    }

    /// The meaning of a Block Load report; any bytes will do.
    pub fn block_load(&self, answer: &[u8]) -> BlockLoad {
        let layout = &self.block_load;
        let says = |what| layout.chosen(answer, what);
        let index = layout.find(usage::BLOCK_INDEX).and_then(|s| s.read(answer));
        match index {
            _ if says(usage::LOAD_FULL) => BlockLoad::Full,
            _ if says(usage::LOAD_ERROR) => BlockLoad::Error,
            Some(index) if index > 0 && says(usage::LOAD_SUCCESS) => BlockLoad::Loaded(index),
            _ => BlockLoad::Unclear,
        }
    }

    /// A Pool report to be filled by the device, if it has one.
    fn blank_pool(&self) -> Option<Vec<u8>> {
        self.pool.as_ref().map(ReportLayout::blank)
    }

    /// The meaning of a Pool report, `None` if it is too short; any bytes will do.
    pub fn pool(&self, answer: &[u8]) -> Option<Pool> {
        let layout = self.pool.as_ref()?;
        let value = |usage| layout.find(usage).map(|s| s.read(answer));
        Some(Pool {
            // A device that leaves a number out says nothing against us.
            simultaneous: value(usage::SIMULTANEOUS).unwrap_or(Some(0))?,
            device_managed: value(usage::DEVICE_MANAGED).unwrap_or(Some(1))? != 0,
        })
    }

    /// Set Effect: a constant force in `block` along `axis` alone, without end or trigger.
    fn set_effect(&self, block: i64, axis: usize) -> Vec<u8> {
        let layout = &self.set_effect;
        let mut report = layout.blank();
        put(layout, &mut report, usage::BLOCK_INDEX, block);
        layout.choose(&mut report, usage::CONSTANT_FORCE);
        put(layout, &mut report, usage::EFFECT_GAIN, i64::MAX);
        // All ones is outside the logical range: no end, no button.
        for unlimited in [usage::DURATION, usage::TRIGGER_BUTTON] {
            if let Some(field) = layout.find(unlimited) {
                fill(field, &mut report);
            }
        }
        if let Some(bit) = self.enable_bit(axis) {
            bit.write(&mut report, 1);
        }
        report
    }

    /// The magnitude that stands for `share` of the full force, -1 ..= 1.
    fn magnitude(&self, share: f64) -> i64 {
        let full = match share < 0.0 {
            true => -self.magnitude.minimum,
            false => self.magnitude.maximum,
        };
        // `as` turns NaN into zero; the limiter has seen to both already.
        (share.clamp(-1.0, 1.0) * full as f64).round() as i64
    }

    /// Set Constant Force.
    fn constant(&self, block: i64, magnitude: i64) -> Vec<u8> {
        let mut report = self.constant.blank();
        put(&self.constant, &mut report, usage::BLOCK_INDEX, block);
        self.magnitude.write(&mut report, magnitude);
        report
    }

    /// Effect Operation: start, for ever.
    fn start(&self, block: i64) -> Vec<u8> {
        let layout = &self.operation;
        let mut report = layout.blank();
        put(layout, &mut report, usage::BLOCK_INDEX, block);
        layout.choose(&mut report, usage::START);
        put(layout, &mut report, usage::LOOP_COUNT, i64::MAX);
        report
    }

    /// Block Free, if the device has it.
    fn free(&self, block: i64) -> Option<Vec<u8>> {
        let layout = self.block_free.as_ref()?;
        let mut report = layout.blank();
        put(layout, &mut report, usage::BLOCK_INDEX, block);
        Some(report)
    }

    /// Device Control, if the device has it.
    fn control(&self, command: Usage) -> Option<Vec<u8>> {
        let layout = self.control.as_ref()?;
        let mut report = layout.blank();
        layout.choose(&mut report, command).then_some(report)
    }

    /// Device Gain, if the device has it.
    fn gain(&self, share: f64) -> Option<Vec<u8>> {
        let layout = self.gain.as_ref()?;
        let field = layout.find(usage::DEVICE_GAIN)?;
        let mut report = layout.blank();
        let value = share.clamp(0.0, 1.0) * field.maximum as f64;
        field.write(&mut report, value.round() as i64);
        Some(report)
    }

    /// Position and buttons of an input report, `None` if it holds no axes; any bytes will do. The
    /// full range of an axis spans `workspace` metres; an axis that is missing is at 0.
    pub fn reading(&self, report: &[u8], workspace: f64) -> Option<Reading> {
        // Devices without ids put none in front of their input either.
        let bare = self.input.iter().any(|l| l.id == 0);
        let framed: Vec<u8>;
        let report = if bare {
            framed = std::iter::once(0).chain(report.iter().copied()).collect();
            &framed
        } else {
            report
        };
        let layout = self.input.iter().find(|l| Some(&l.id) == report.first())?;
        let axis = |usage| -> Option<f64> {
            let field = layout.find(usage)?;
            let value = field.read(report)? as f64;
            let (low, high) = (field.minimum as f64, field.maximum as f64);
            let share = (value - low) / (high - low).max(1.0);
            Some((share.clamp(0.0, 1.0) - 0.5) * workspace)
        };
        let [x, y, z] = usage::AXES.map(axis);
        let place = DVec3::new(x?, y.unwrap_or(0.0), z.unwrap_or(0.0));
        Some(Reading {
            motion: Motion::Position {
                pose: Pose::from_translation(place),
                twist: Twist::default(),
            },
            buttons: buttons(layout, report),
        })
    }
}

fn buttons(layout: &ReportLayout, report: &[u8]) -> u32 {
    let fields = layout.fields.iter();
    fields
        .filter(|s| s.usage & 0xffff_0000 == usage::BUTTON_PAGE)
        .filter(|s| s.read(report).is_some_and(|v| v != 0))
        .filter_map(|s| (s.usage & 0xffff).checked_sub(1).filter(|b| *b < 32))
        .fold(0, |mask, bit| mask | 1 << bit)
}

fn put(layout: &ReportLayout, report: &mut [u8], usage: Usage, value: i64) {
    if let Some(field) = layout.find(usage) {
        field.write(report, value);
    }
}

fn fill(field: &ReportField, report: &mut [u8]) {
    let ones = ReportField {
        minimum: 0,
        maximum: (1 << field.bits.len()) - 1,
        ..field.clone()
    };
    ones.write(report, i64::MAX);
}

/// Usages of page 0x0F (Physical Interface) and of the axes.
mod usage {
    use crate::device::hid::report::Usage;

    pub(super) const SET_EFFECT: Usage = 0x000f_0021;
    pub(super) const BLOCK_INDEX: Usage = 0x000f_0022;
    pub(super) const CONSTANT_FORCE: Usage = 0x000f_0026;
    pub(super) const DURATION: Usage = 0x000f_0050;
    pub(super) const EFFECT_GAIN: Usage = 0x000f_0052;
    pub(super) const TRIGGER_BUTTON: Usage = 0x000f_0053;
    pub(super) const AXES_ENABLE: Usage = 0x000f_0055;
    pub(super) const MAGNITUDE: Usage = 0x000f_0070;
    pub(super) const SET_CONSTANT: Usage = 0x000f_0073;
    pub(super) const OPERATION: Usage = 0x000f_0077;
    pub(super) const START: Usage = 0x000f_0079;
    pub(super) const LOOP_COUNT: Usage = 0x000f_007c;
    pub(super) const GAIN_REPORT: Usage = 0x000f_007d;
    pub(super) const DEVICE_GAIN: Usage = 0x000f_007e;
    pub(super) const POOL: Usage = 0x000f_007f;
    pub(super) const SIMULTANEOUS: Usage = 0x000f_0083;
    pub(super) const BLOCK_LOAD: Usage = 0x000f_0089;
    pub(super) const LOAD_SUCCESS: Usage = 0x000f_008c;
    pub(super) const LOAD_FULL: Usage = 0x000f_008d;
    pub(super) const LOAD_ERROR: Usage = 0x000f_008e;
    pub(super) const BLOCK_FREE: Usage = 0x000f_0090;
    pub(super) const CONTROL: Usage = 0x000f_0096;
    pub(super) const ENABLE: Usage = 0x000f_0097;
    pub(super) const STOP_ALL: Usage = 0x000f_0099;
    pub(super) const RESET: Usage = 0x000f_009a;
    pub(super) const DEVICE_MANAGED: Usage = 0x000f_00a9;
    pub(super) const CREATE: Usage = 0x000f_00ab;
    /// Generic Desktop X, Y, Z.
    pub(super) const AXES: [Usage; 3] = [0x0001_0030, 0x0001_0031, 0x0001_0032];
    pub(super) const BUTTON_PAGE: Usage = 0x0009_0000;
}

#[cfg(test)]
#[path = "pid_tests.rs"]
mod tests;
