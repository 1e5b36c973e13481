use proptest::prelude::*;

use std::ops::Range;

use crate::device::hid::fake::unhex;
use crate::device::hid::report::{Layouts, ReportField};

const REAL: [&str; 3] = [
    include_str!("../../../descriptors/pid-two-axes.hex"),
    include_str!("../../../descriptors/space-mouse-split.hex"),
    include_str!("../../../descriptors/space-mouse-combined.hex"),
];

fn report_field(bits: Range<usize>, minimum: i64, maximum: i64) -> ReportField {
    ReportField {
        groups: Vec::new(),
        usage: 1,
        bits,
        minimum,
        maximum,
        choices: Vec::new(),
    }
}

#[test]
fn numbers_come_back_from_any_bit_position() {
    for start in 8..24 {
        for width in 1..=32 {
            let top = 1i64 << (width - 1);
            let signed = report_field(start..start + width, -top, top - 1);
            let unsigned = report_field(start..start + width, 0, 2 * top - 1);
            let mut report = [0xff; 8];
            for value in [-top, -1, 0, top - 1] {
                signed.write(&mut report, value);
                assert_eq!(signed.read(&report), Some(value), "{start} {width}");
            }
            unsigned.write(&mut report, i64::MAX);
            assert_eq!(unsigned.read(&report), Some(2 * top - 1));
            assert_eq!(report[0], 0xff);
        }
    }
}

#[test]
fn a_short_report_has_no_number() {
    assert_eq!(report_field(8..24, 0, 9).read(&[1, 2]), None);
}

proptest! {
    /// Bytes, and real descriptors with some of theirs replaced: read or refused, never a panic.
    #[test]
    fn any_descriptor_is_read_or_refused(
        noise: Vec<u8>,
        which in 0usize..3,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
    ) {
        let _ = Layouts::parse("noise", &noise);
        let mut real = unhex(REAL[which]);
        for (place, byte) in changes {
            let place = place.index(real.len());
            real[place] = byte;
        }
        if let Ok(layouts) = Layouts::parse("changed", &real) {
            for layout in layouts.input.iter().chain(&layouts.output).chain(&layouts.feature) {
                let mut report = layout.blank();
                for field in &layout.fields {
                    field.write(&mut report, i64::MIN);
                    prop_assert!(field.read(&report).is_some());
                }
            }
        }
        let _ = crate::device::hid::pid::PidLayout::parse("changed", &real)
            .map(|layout| layout.reading(&noise, 0.1));
    }
}

#[test]
fn the_descriptors_kept_as_examples_are_read() {
    for text in REAL {
        let layouts = Layouts::parse("example", &unhex(text)).unwrap();
        let axes = layouts.input.iter().flat_map(|l| &l.fields);
        assert!(
            axes.filter(|s| (0x0001_0030..0x0001_0036).contains(&s.usage))
                .count()
                >= 2
        );
    }
}
