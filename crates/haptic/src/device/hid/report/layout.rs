//! Where the numbers lie in a device's HID reports, by its own descriptor.

use std::ops::Range;

use hidreport::{Field, Report, ReportDescriptor};

use crate::device::contract::DeviceError;
use crate::device::hid::report::screen::screen;

/// A usage: page in the upper 16 bits, id in the lower.
pub type Usage = u32;

/// One number in a report.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    /// Usages of the collections it lies in, outermost first.
    pub groups: Vec<Usage>,
    /// Its own usage; zero for an array.
    pub usage: Usage,
    /// Bits in the report, counted from the report id's first bit.
    pub bits: Range<usize>,
    /// Least logical value.
    pub minimum: i64,
    /// Greatest logical value.
    pub maximum: i64,
    /// For an array: what its values choose, from `minimum` on.
    pub choices: Vec<Usage>,
}

/// One report. On the wire it begins with its id, which is zero where a device has no ids.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportLayout {
    /// First byte.
    pub id: u8,
    /// Length, id included.
    pub bytes: usize,
    /// Its numbers, padding left out.
    pub slots: Vec<Slot>,
}

/// All reports of a device.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Layouts {
    /// Device to host.
    pub input: Vec<ReportLayout>,
    /// Host to device.
    pub output: Vec<ReportLayout>,
    /// Both ways, on request.
    pub feature: Vec<ReportLayout>,
}

/// Longest report believed, bytes; the kernel's own limit.
const LONGEST: usize = 4096;

impl Layouts {
    /// Reads a report descriptor.
    ///
    /// # Errors
    /// If it is not one.
    pub fn parse(name: &str, descriptor: &[u8]) -> Result<Self, DeviceError> {
        let unsuitable = |found: String| DeviceError::Unsuitable {
            name: name.to_owned(),
            expected: "a HID report descriptor".into(),
            found,
        };
        screen(descriptor).map_err(|why| unsuitable(why.into()))?;
        let parsed =
            ReportDescriptor::try_from(descriptor).map_err(|e| unsuitable(e.to_string()))?;
        Ok(Self {
            input: layouts(parsed.input_reports()),
            output: layouts(parsed.output_reports()),
            feature: layouts(parsed.feature_reports()),
        })
    }
}

/// The report with a collection of this usage.
pub fn with_group(layouts: &[ReportLayout], group: Usage) -> Option<&ReportLayout> {
    layouts
        .iter()
        .find(|l| l.slots.iter().any(|s| s.groups.contains(&group)))
}

fn layouts(reports: &[impl Report]) -> Vec<ReportLayout> {
    let kept = reports.iter().map(layout);
    kept.filter(|l| l.bytes <= LONGEST).collect()
}

fn layout(report: &impl Report) -> ReportLayout {
    let id = report.report_id().as_ref().map_or(0, u8::from);
    // Without ids the wire has a zero in front that the descriptor does not count.
    let shift = if report.report_id().is_some() { 0 } else { 8 };
    let bytes = report.size_in_bytes() + shift / 8;
    let slots = report.fields().iter().filter_map(|f| slot(f, shift));
    ReportLayout {
        id,
        bytes,
        slots: slots
            .filter(|s| s.bits.end <= 8 * bytes && (1..=32).contains(&s.bits.len()))
            .collect(),
    }
}

fn slot(field: &Field, shift: usize) -> Option<Slot> {
    let groups = field
        .collections()
        .iter()
        .flat_map(|c| c.usages().iter().map(u32::from))
        .collect();
    let bits = field.bits();
    let bits = bits.start + shift..bits.end + shift;
    let (usage, choices, minimum, maximum) = match field {
        Field::Variable(v) => (
            u32::from(&v.usage),
            Vec::new(),
            i32::from(v.logical_minimum),
            i32::from(v.logical_maximum),
        ),
        Field::Array(a) => (
            0,
            a.usages().iter().map(u32::from).collect(),
            i32::from(a.logical_minimum),
            i32::from(a.logical_maximum),
        ),
        Field::Constant(_) => return None,
    };
    Some(Slot {
        groups,
        usage,
        bits,
        minimum: minimum.into(),
        maximum: maximum.into(),
        choices,
    })
}

impl Slot {
    /// True if the innermost collection is `group`.
    pub fn directly_in(&self, group: Usage) -> bool {
        self.groups.last() == Some(&group)
    }

    /// Reads the number from a report; `None` if the report is too short.
    pub fn read(&self, report: &[u8]) -> Option<i64> {
        let mut value = 0u64;
        for (k, bit) in self.bits.clone().enumerate() {
            let byte = report.get(bit / 8)?;
            value |= u64::from(byte >> (bit % 8) & 1) << k;
        }
        let width = self.bits.len();
        let negative = self.minimum < 0 && value >> (width - 1) & 1 == 1;
        let offset = if negative { 1i64 << width } else { 0 };
        Some(value as i64 - offset)
    }

    /// Writes `value`, clamped to the logical range, into a report of the right length.
    pub fn write(&self, report: &mut [u8], value: i64) {
        let value = value.clamp(self.minimum, self.maximum.max(self.minimum));
        for (k, bit) in self.bits.clone().enumerate() {
            if let Some(byte) = report.get_mut(bit / 8) {
                let mask = 1 << (bit % 8);
                if value >> k & 1 == 1 {
                    *byte |= mask;
                } else {
                    *byte &= !mask;
                }
            }
        }
    }
}

impl ReportLayout {
    /// A report of zeros with its id.
    pub fn blank(&self) -> Vec<u8> {
        let mut report = vec![0; self.bytes.max(1)];
        report[0] = self.id;
        report
    }

    /// The first number with this usage.
    pub fn find(&self, usage: Usage) -> Option<&Slot> {
        self.slots.iter().find(|s| s.usage == usage)
    }

    /// Chooses `usage`: sets its bit, or the array that offers it to its place. False if the report
    /// does not offer it.
    pub fn choose(&self, report: &mut [u8], usage: Usage) -> bool {
        for slot in &self.slots {
            if slot.usage == usage {
                slot.write(report, slot.maximum);
                return true;
            }
            if let Some(place) = slot.choices.iter().position(|c| *c == usage) {
                slot.write(report, slot.minimum + place as i64);
                return true;
            }
        }
        false
    }

    /// Whether `usage` is chosen in a report received.
    pub fn chosen(&self, report: &[u8], usage: Usage) -> bool {
        self.slots.iter().any(|slot| {
            let Some(value) = slot.read(report) else {
                return false;
            };
            if slot.usage == usage {
                return value != 0;
            }
            let place = slot.choices.iter().position(|c| *c == usage);
            place.is_some_and(|p| slot.minimum + p as i64 == value)
        })
    }
}
