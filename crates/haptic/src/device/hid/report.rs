//! Where the numbers lie in a device's HID reports, by its own descriptor.

use std::ops::Range;

use hidreport::{Field, Report, ReportDescriptor};

use crate::device::contract::DeviceError;

/// A usage: page in the upper 16 bits, id in the lower.
pub type Usage = u32;

/// One number in a report.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportField {
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
    pub fields: Vec<ReportField>,
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
        .find(|l| l.fields.iter().any(|s| s.groups.contains(&group)))
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
    let fields = report
        .fields()
        .iter()
        .filter_map(|f| report_field(f, shift));
    ReportLayout {
        id,
        bytes,
        fields: fields
            .filter(|s| s.bits.end <= 8 * bytes && (1..=32).contains(&s.bits.len()))
            .collect(),
    }
}

fn report_field(field: &Field, shift: usize) -> Option<ReportField> {
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
    Some(ReportField {
        groups,
        usage,
        bits,
        minimum: minimum.into(),
        maximum: maximum.into(),
        choices,
    })
}

impl ReportField {
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
    pub fn find(&self, usage: Usage) -> Option<&ReportField> {
        self.fields.iter().find(|s| s.usage == usage)
    }

    /// Chooses `usage`: sets its bit, or the array that offers it to its place. False if the report
    /// does not offer it.
    pub fn choose(&self, report: &mut [u8], usage: Usage) -> bool {
        for field in &self.fields {
            if field.usage == usage {
                field.write(report, field.maximum);
                return true;
            }
            if let Some(place) = field.choices.iter().position(|c| *c == usage) {
                field.write(report, field.minimum + place as i64);
                return true;
            }
        }
        false
    }

    /// Whether `usage` is chosen in a report received.
    pub fn chosen(&self, report: &[u8], usage: Usage) -> bool {
        self.fields.iter().any(|field| {
            let Some(value) = field.read(report) else {
                return false;
            };
            if field.usage == usage {
                return value != 0;
            }
            let place = field.choices.iter().position(|c| *c == usage);
            place.is_some_and(|p| field.minimum + p as i64 == value)
        })
    }
}

/// Most bits of one item's numbers: the longest report the kernel believes.
const MOST_BITS: u64 = 8 * 4096;

/// Most numbers and usages of a whole descriptor.
const MOST_NUMBERS: u64 = 1 << 15;

/// Deepest nesting of collections and of pushed states.
const DEEPEST: usize = 16;

/// Item tags without their size bits, HID 1.11 section 6.2.2.
mod tag {
    pub(super) const INPUT: u8 = 0x80;
    pub(super) const OUTPUT: u8 = 0x90;
    pub(super) const FEATURE: u8 = 0xb0;
    pub(super) const COLLECTION: u8 = 0xa0;
    pub(super) const END_COLLECTION: u8 = 0xc0;
    pub(super) const USAGE_PAGE: u8 = 0x04;
    pub(super) const REPORT_SIZE: u8 = 0x74;
    pub(super) const REPORT_COUNT: u8 = 0x94;
    pub(super) const PUSH: u8 = 0xa4;
    pub(super) const POP: u8 = 0xb4;
    pub(super) const USAGE: u8 = 0x08;
    pub(super) const USAGE_MINIMUM: u8 = 0x18;
    pub(super) const USAGE_MAXIMUM: u8 = 0x28;
    pub(super) const LONG: u8 = 0xfe;
}

/// What the items so far have set.
#[derive(Debug, Clone, Copy, Default)]
struct ItemState {
    has_page: bool,
    size: u64,
    count: u64,
    usages: u64,
    minimum: u64,
    maximum: u64,
}

impl ItemState {
    /// Usages of the next main item.
    fn named(&self) -> u64 {
        self.usages + (self.maximum.saturating_sub(self.minimum))
    }

    /// A collection or a report's numbers: whether it is the one, and how many numbers and usages
    /// it has.
    fn main_item(&mut self, tag: u8) -> Result<(bool, u64), &'static str> {
        if self.named() > 0 && !self.has_page {
            return Err("usages without a page");
        }
        let collection = tag == tag::COLLECTION;
        // Saturating: both factors have 32 bits.
        if !collection && self.size.saturating_mul(self.count) > MOST_BITS {
            return Err("a longer report than any system takes");
        }
        let numbers = self.named() + if collection { 0 } else { self.count };
        self.forget_usages();
        Ok((collection, numbers))
    }

    fn forget_usages(&mut self) {
        (self.usages, self.minimum, self.maximum) = (0, 0, 0);
    }
}

/// Walks the items of a descriptor.
fn screen(descriptor: &[u8]) -> Result<(), &'static str> {
    let mut walk = DescriptorWalk {
        states: vec![ItemState::default()],
        depth: 0,
        numbers: 0,
    };
    let mut rest = descriptor;
    while let Some((&first, after)) = rest.split_first() {
        // None is defined, and parsers disagree about where one ends.
        if first == tag::LONG {
            return Err("a long item");
        }
        let length = [0, 1, 2, 4][usize::from(first & 3)];
        let data = after.get(..length).ok_or("an item that is cut off")?;
        rest = &after[length..];
        let value = data
            .iter()
            .rev()
            .fold(0, |v, byte| v << 8 | u64::from(*byte));
        walk.item(first & 0xfc, value)?;
    }
    Ok(())
}

/// A walk through the items, as far as it has come.
struct DescriptorWalk {
    /// The last is the one in force, the others are pushed.
    states: Vec<ItemState>,
    /// Collections that are open.
    depth: usize,
    /// Numbers and usages so far.
    numbers: u64,
}

impl DescriptorWalk {
    fn item(&mut self, tag: u8, value: u64) -> Result<(), &'static str> {
        let open = self.states.len();
        let state = self.states.last_mut().ok_or("more pops than pushes")?;
        match tag {
            tag::USAGE_PAGE => state.has_page = true,
            tag::REPORT_SIZE => state.size = value,
            tag::REPORT_COUNT => state.count = value,
            tag::USAGE => state.usages += 1,
            tag::USAGE_MINIMUM => state.minimum = value,
            tag::USAGE_MAXIMUM => state.maximum = value,
            tag::PUSH if open == DEEPEST => return Err("states pushed too deep"),
            tag::PUSH => {
                let copy = *state;
                self.states.push(copy);
            }
            tag::POP if open == 1 => return Err("more pops than pushes"),
            tag::POP => {
                self.states.pop();
            }
            tag::END_COLLECTION => {
                let ends = self.depth.checked_sub(1);
                self.depth = ends.ok_or("more ends than collections")?;
                state.forget_usages();
            }
            tag::INPUT | tag::OUTPUT | tag::FEATURE | tag::COLLECTION => {
                let (opened, numbers) = state.main_item(tag)?;
                self.depth += usize::from(opened);
                self.numbers += numbers;
                if self.numbers > MOST_NUMBERS || self.depth > DEEPEST {
                    return Err("more numbers or collections than any device has");
                }
            }
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_cost_memory_or_a_panic_is_refused_with_a_reason() {
        let many = [
            0x05, 1, 0x09, 0x30, 0x75, 0, 0x97, 0xff, 0xff, 0xff, 0xff, 0x81, 2,
        ];
        let wide = [
            0x05, 1, 0x1b, 0, 0, 0, 0, 0x2b, 0xff, 0xff, 0xff, 0xff, 0xa1, 1,
        ];
        let cases: [(&[u8], &str); 8] = [
            (&many, "more numbers"),
            (&wide, "more numbers"),
            (&[0x75, 0xff, 0x96, 0xff, 0xff, 0x81, 3], "longer report"),
            (&[0x09, 0x30, 0xa1, 1], "without a page"),
            (&[0xb4], "pops"),
            (&[0xc0], "ends"),
            (&[0x26, 0x01], "cut off"),
            (&[0xfe, 1, 5, 0], "long item"),
        ];
        for (descriptor, reason) in cases {
            let refused = screen(descriptor).unwrap_err();
            assert!(refused.contains(reason), "{descriptor:02x?}: {refused}");
        }
        assert!(screen(&[0xa4; 20]).is_err());
        assert!(screen(&[0xa1, 0].repeat(20)).is_err());
        assert_eq!(screen(&[]), Ok(()));
    }
}

#[cfg(test)]
#[path = "report_tests.rs"]
mod layout_tests;
