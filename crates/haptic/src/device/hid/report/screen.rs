//! Refuses report descriptors that no device sends and that would cost a parser its memory.
//!
//! A descriptor comes from whatever was plugged in. A few bytes of it can ask for 2^32 numbers, or
//! name usages without a page; both are found here by walking its items once.

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
struct Items {
    has_page: bool,
    size: u64,
    count: u64,
    usages: u64,
    minimum: u64,
    maximum: u64,
}

impl Items {
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
pub(super) fn screen(descriptor: &[u8]) -> Result<(), &'static str> {
    let mut walk = Walk {
        states: vec![Items::default()],
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
struct Walk {
    /// The last is the one in force, the others are pushed.
    states: Vec<Items>,
    /// Collections that are open.
    depth: usize,
    /// Numbers and usages so far.
    numbers: u64,
}

impl Walk {
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
