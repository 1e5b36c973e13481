//! Where the numbers lie in a device's HID reports, by its own descriptor.

pub(crate) mod layout;
mod screen;

pub use layout::{Layouts, ReportLayout, Slot, Usage, with_group};

#[cfg(test)]
mod layout_tests;
