//! USB HID PID devices (Physical Interface Device class 1.0): force feedback on their axes.
//!
//! Ids, sizes and ranges of all reports come from the device's own descriptor. Each axis gets one
//! constant-force effect of unlimited duration, started once; a force is then one short report per
//! axis that changed.

use std::time::Duration;

use fft_correlate::{Pose, Wrench};
use glam::DVec3;

use crate::hid::{Connector, HidPort};
use crate::hid_report::{Layout, Layouts, Slot, Usage, with_group};
use crate::io_thread::{Cursor, InputHalf, Motion, OutputHalf, Reading, Threaded};
use crate::{DeviceError, DeviceSpec};

/// Usages of page 0x0F (Physical Interface) and of the axes.
mod usage {
    use super::Usage;

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
    pub(super) const BLOCK_LOAD: Usage = 0x000f_0089;
    pub(super) const LOAD_SUCCESS: Usage = 0x000f_008c;
    pub(super) const LOAD_FULL: Usage = 0x000f_008d;
    pub(super) const CONTROL: Usage = 0x000f_0096;
    pub(super) const ENABLE: Usage = 0x000f_0097;
    pub(super) const STOP_ALL: Usage = 0x000f_0099;
    pub(super) const RESET: Usage = 0x000f_009a;
    pub(super) const CREATE: Usage = 0x000f_00ab;
    /// Generic Desktop X, Y, Z.
    pub(super) const AXES: [Usage; 3] = [0x0001_0030, 0x0001_0031, 0x0001_0032];
    pub(super) const BUTTON_PAGE: Usage = 0x0009_0000;
}

/// What a descriptor cannot say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PidSettings {
    /// Force of the full magnitude, N.
    pub max_force: f64,
    /// Edge of the workspace that the full range of the axes stands for, metres.
    pub workspace: f64,
    /// Stiffest wall, N/m, at `rate`.
    pub max_stiffness: f64,
    /// Reports per second the device takes.
    pub rate: f64,
    /// Device gain, 0 ..= 1.
    pub gain: f64,
    /// +1 or -1 per axis: which way a positive magnitude pushes.
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
    set_effect: Layout,
    constant: Layout,
    operation: Layout,
    create: Layout,
    block_load: Layout,
    control: Option<Layout>,
    gain: Option<Layout>,
    input: Vec<Layout>,
}

impl PidLayout {
    /// Finds the reports needed in a report descriptor.
    ///
    /// # Errors
    /// If it is no descriptor or lacks a report that constant forces need.
    pub fn parse(name: &str, descriptor: &[u8]) -> Result<Self, DeviceError> {
        let all = Layouts::parse(name, descriptor)?;
        let need = |layouts: &[Layout], group, what: &str| {
            with_group(layouts, group)
                .cloned()
                .ok_or_else(|| DeviceError::Unsuitable {
                    name: name.to_owned(),
                    expected: format!("a PID {what} report (usage {group:#010x})"),
                    found: "none in the descriptor".into(),
                })
        };
        let layout = Self {
            set_effect: need(&all.output, usage::SET_EFFECT, "set effect")?,
            constant: need(&all.output, usage::SET_CONSTANT, "set constant force")?,
            operation: need(&all.output, usage::OPERATION, "effect operation")?,
            create: need(&all.feature, usage::CREATE, "create new effect")?,
            block_load: need(&all.feature, usage::BLOCK_LOAD, "block load")?,
            control: with_group(&all.output, usage::CONTROL).cloned(),
            gain: with_group(&all.output, usage::GAIN_REPORT).cloned(),
            input: all.input,
        };
        if layout.output_axes().is_empty() {
            return Err(DeviceError::Unsuitable {
                name: name.to_owned(),
                expected: "axes to push along in the set effect report".into(),
                found: "none".into(),
            });
        }
        Ok(layout)
    }

    /// Axes with a motor: 0 for x, 1 for y, 2 for z.
    pub fn output_axes(&self) -> Vec<usize> {
        (0..3).filter(|a| self.enable_bit(*a).is_some()).collect()
    }

    fn enable_bit(&self, axis: usize) -> Option<&Slot> {
        let bits = self.set_effect.slots.iter();
        bits.filter(|s| s.directly_in(usage::AXES_ENABLE))
            .find(|s| s.usage == usage::AXES[axis])
    }

    /// The device record.
    pub fn spec(&self, name: &str, settings: &PidSettings) -> DeviceSpec {
        DeviceSpec {
            name: name.to_owned(),
            input_dof: 3,
            output_dof: if self.enable_bit(2).is_some() { 3 } else { 2 },
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

    /// Set Effect: a constant force in `block` along `axis` alone, without end or trigger.
    fn set_effect(&self, block: i64, axis: usize) -> Vec<u8> {
        let layout = &self.set_effect;
        let mut report = layout.blank();
        put(layout, &mut report, usage::BLOCK_INDEX, block);
        layout.choose(&mut report, usage::CONSTANT_FORCE);
        put(layout, &mut report, usage::EFFECT_GAIN, i64::MAX);
        // All ones is outside the logical range: no end, no button.
        for unlimited in [usage::DURATION, usage::TRIGGER_BUTTON] {
            if let Some(slot) = layout.find(unlimited) {
                fill(slot, &mut report);
            }
        }
        if let Some(bit) = self.enable_bit(axis) {
            bit.write(&mut report, 1);
        }
        report
    }

    /// Set Constant Force: `share` of the full force, -1 ..= 1.
    fn constant(&self, block: i64, share: f64) -> Vec<u8> {
        let layout = &self.constant;
        let mut report = layout.blank();
        put(layout, &mut report, usage::BLOCK_INDEX, block);
        if let Some(slot) = layout.find(usage::MAGNITUDE) {
            let full = if share < 0.0 {
                -slot.minimum as f64
            } else {
                slot.maximum as f64
            };
            // `as` turns NaN into zero and clamps; the limiter has seen to both already.
            slot.write(&mut report, (share.clamp(-1.0, 1.0) * full).round() as i64);
        }
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

    /// Device Control, if the device has it.
    fn control(&self, command: Usage) -> Option<Vec<u8>> {
        let layout = self.control.as_ref()?;
        let mut report = layout.blank();
        layout.choose(&mut report, command).then_some(report)
    }

    /// Device Gain, if the device has it.
    fn gain(&self, share: f64) -> Option<Vec<u8>> {
        let layout = self.gain.as_ref()?;
        let slot = layout.find(usage::DEVICE_GAIN)?;
        let mut report = layout.blank();
        let value = share.clamp(0.0, 1.0) * slot.maximum as f64;
        slot.write(&mut report, value.round() as i64);
        Some(report)
    }

    /// Position and buttons of an input report, if it holds axes.
    fn reading(&self, report: &[u8], workspace: f64) -> Option<Reading> {
        // Devices without ids put none in front of their input either.
        let bare = self.input.len() == 1 && self.input[0].id == 0;
        let mut framed = [0; 65];
        let report = if bare {
            let length = report.len().min(64);
            framed[1..=length].copy_from_slice(&report[..length]);
            &framed[..=length]
        } else {
            report
        };
        let layout = self.input.iter().find(|l| Some(&l.id) == report.first())?;
        let axis = |usage| -> Option<f64> {
            let slot = layout.find(usage)?;
            let value = slot.read(report)? as f64;
            let (low, high) = (slot.minimum as f64, slot.maximum as f64);
            let share = (value - low) / (high - low).max(1.0);
            Some((share.clamp(0.0, 1.0) - 0.5) * workspace)
        };
        let [x, y, z] = usage::AXES.map(axis);
        let place = DVec3::new(x?, y.unwrap_or(0.0), z.unwrap_or(0.0));
        Some(Reading {
            motion: Motion::Position(Pose::from_translation(place)),
            buttons: buttons(layout, report),
        })
    }
}

fn buttons(layout: &Layout, report: &[u8]) -> u32 {
    let slots = layout.slots.iter();
    slots
        .filter(|s| s.usage & 0xffff_0000 == usage::BUTTON_PAGE)
        .filter(|s| s.read(report).is_some_and(|v| v != 0))
        .filter_map(|s| (s.usage & 0xffff).checked_sub(1).filter(|b| *b < 32))
        .fold(0, |mask, bit| mask | 1 << bit)
}

fn put(layout: &Layout, report: &mut [u8], usage: Usage, value: i64) {
    if let Some(slot) = layout.find(usage) {
        slot.write(report, value);
    }
}

fn fill(slot: &Slot, report: &mut [u8]) {
    let ones = Slot {
        minimum: 0,
        maximum: (1 << slot.bits.len()) - 1,
        ..slot.clone()
    };
    ones.write(report, i64::MAX);
}

/// Opens a PID device through two connections of its own, one per direction.
///
/// # Errors
/// If it is gone, may not be opened, or cannot play constant forces.
pub fn open(
    name: &str,
    mut input: Connector,
    output: Connector,
    settings: PidSettings,
) -> Result<Threaded, DeviceError> {
    let descriptor = input()?.descriptor()?;
    let layout = PidLayout::parse(name, &descriptor)?;
    let spec = layout.spec(name, &settings);
    let read = PidInput {
        connector: input,
        port: None,
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
    Threaded::spawn(
        spec,
        Cursor::default(),
        Box::new(read),
        Some(Box::new(write)),
    )
}

struct PidInput {
    connector: Connector,
    port: Option<Box<dyn HidPort>>,
    layout: PidLayout,
    workspace: f64,
}

impl InputHalf for PidInput {
    fn connect(&mut self) -> Result<(), DeviceError> {
        self.port = None;
        self.port = Some((self.connector)()?);
        Ok(())
    }

    fn read(&mut self, timeout: Duration) -> Result<Option<Reading>, DeviceError> {
        let port = self.port.as_mut().ok_or(DeviceError::Disconnected)?;
        let mut buffer = [0; 64];
        let length = port.read(&mut buffer, timeout)?;
        Ok(self.layout.reading(&buffer[..length], self.workspace))
    }
}

/// One effect on the device.
#[derive(Debug, Clone, Copy)]
struct Effect {
    axis: usize,
    block: i64,
    /// The last magnitude report's share, to leave out what does not change.
    share: f64,
    playing: bool,
}

struct PidOutput {
    name: String,
    connector: Connector,
    port: Option<Box<dyn HidPort>>,
    layout: PidLayout,
    settings: PidSettings,
    effects: Vec<Effect>,
}

impl PidOutput {
    fn prepare(&mut self, port: &mut dyn HidPort) -> Result<(), DeviceError> {
        for command in [usage::RESET, usage::ENABLE] {
            if let Some(report) = self.layout.control(command) {
                port.write(&report)?;
            }
        }
        if let Some(report) = self.layout.gain(self.settings.gain) {
            port.write(&report)?;
        }
        for axis in self.layout.output_axes() {
            let block = self.load(port)?;
            port.write(&self.layout.set_effect(block, axis))?;
            self.effects.push(Effect {
                axis,
                block,
                share: f64::NAN,
                playing: false,
            });
        }
        Ok(())
    }

    /// Creates an effect and asks which block it got.
    fn load(&self, port: &mut dyn HidPort) -> Result<i64, DeviceError> {
        let refused = |found: String| DeviceError::Unsuitable {
            name: self.name.clone(),
            expected: "room for one constant force per axis".into(),
            found,
        };
        port.set_feature(&self.layout.create())?;
        let layout = &self.layout.block_load;
        let mut answer = layout.blank();
        let length = port.get_feature(&mut answer)?;
        answer.truncate(length);
        if layout.chosen(&answer, usage::LOAD_FULL) {
            return Err(refused("a full effect pool".into()));
        }
        let block = layout
            .find(usage::BLOCK_INDEX)
            .and_then(|s| s.read(&answer));
        match block {
            Some(block) if block > 0 && layout.chosen(&answer, usage::LOAD_SUCCESS) => Ok(block),
            _ => Err(refused(format!("block load answer {answer:02x?}"))),
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
        self.prepare(port.as_mut())?;
        self.port = Some(port);
        Ok(())
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        let port = self.port.as_mut().ok_or(DeviceError::Disconnected)?;
        for effect in &mut self.effects {
            let full = self.settings.signs[effect.axis] / self.settings.max_force;
            let share = wrench.force[effect.axis] * full;
            if share != effect.share {
                port.write(&self.layout.constant(effect.block, share))?;
                effect.share = share;
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
            port.write(&self.layout.constant(effect.block, 0.0))?;
            effect.share = 0.0;
            effect.playing = false;
        }
        match self.layout.control(usage::STOP_ALL) {
            Some(report) => port.write(&report),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
