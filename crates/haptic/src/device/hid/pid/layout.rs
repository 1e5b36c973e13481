//! The reports of a PID device: from a descriptor to the bytes of each, and from bytes to meaning.
//! No device is touched here.

use fft_correlate::{Pose, Twist};
use glam::DVec3;

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::hid::pid::settings::PidSettings;
use crate::device::hid::pid::usage;
use crate::device::hid::report::layout::{Layouts, ReportLayout, Slot, Usage, with_group};
use crate::device::threaded::{Motion, Reading};

/// The reports of one PID device.
#[derive(Debug, Clone, PartialEq)]
pub struct PidLayout {
    set_effect: ReportLayout,
    constant: ReportLayout,
    magnitude: Slot,
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

    fn enable_bit(&self, axis: usize) -> Option<&Slot> {
        let bits = self.set_effect.slots.iter();
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
    pub(super) fn create(&self) -> Vec<u8> {
        let mut report = self.create.blank();
        self.create.choose(&mut report, usage::CONSTANT_FORCE);
        report
    }

    /// A Block Load report to be filled by the device.
    pub(super) fn blank_block_load(&self) -> Vec<u8> {
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
    pub(super) fn blank_pool(&self) -> Option<Vec<u8>> {
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
    pub(super) fn set_effect(&self, block: i64, axis: usize) -> Vec<u8> {
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

    /// The magnitude that stands for `share` of the full force, -1 ..= 1.
    pub(super) fn magnitude(&self, share: f64) -> i64 {
        let full = match share < 0.0 {
            true => -self.magnitude.minimum,
            false => self.magnitude.maximum,
        };
        // `as` turns NaN into zero; the limiter has seen to both already.
        (share.clamp(-1.0, 1.0) * full as f64).round() as i64
    }

    /// Set Constant Force.
    pub(super) fn constant(&self, block: i64, magnitude: i64) -> Vec<u8> {
        let mut report = self.constant.blank();
        put(&self.constant, &mut report, usage::BLOCK_INDEX, block);
        self.magnitude.write(&mut report, magnitude);
        report
    }

    /// Effect Operation: start, for ever.
    pub(super) fn start(&self, block: i64) -> Vec<u8> {
        let layout = &self.operation;
        let mut report = layout.blank();
        put(layout, &mut report, usage::BLOCK_INDEX, block);
        layout.choose(&mut report, usage::START);
        put(layout, &mut report, usage::LOOP_COUNT, i64::MAX);
        report
    }

    /// Block Free, if the device has it.
    pub(super) fn free(&self, block: i64) -> Option<Vec<u8>> {
        let layout = self.block_free.as_ref()?;
        let mut report = layout.blank();
        put(layout, &mut report, usage::BLOCK_INDEX, block);
        Some(report)
    }

    /// Device Control, if the device has it.
    pub(super) fn control(&self, command: Usage) -> Option<Vec<u8>> {
        let layout = self.control.as_ref()?;
        let mut report = layout.blank();
        layout.choose(&mut report, command).then_some(report)
    }

    /// Device Gain, if the device has it.
    pub(super) fn gain(&self, share: f64) -> Option<Vec<u8>> {
        let layout = self.gain.as_ref()?;
        let slot = layout.find(usage::DEVICE_GAIN)?;
        let mut report = layout.blank();
        let value = share.clamp(0.0, 1.0) * slot.maximum as f64;
        slot.write(&mut report, value.round() as i64);
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
            let slot = layout.find(usage)?;
            let value = slot.read(report)? as f64;
            let (low, high) = (slot.minimum as f64, slot.maximum as f64);
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
    let slots = layout.slots.iter();
    slots
        .filter(|s| s.usage & 0xffff_0000 == usage::BUTTON_PAGE)
        .filter(|s| s.read(report).is_some_and(|v| v != 0))
        .filter_map(|s| (s.usage & 0xffff).checked_sub(1).filter(|b| *b < 32))
        .fold(0, |mask, bit| mask | 1 << bit)
}

fn put(layout: &ReportLayout, report: &mut [u8], usage: Usage, value: i64) {
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
