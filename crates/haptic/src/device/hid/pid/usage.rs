//! Usages of page 0x0F (Physical Interface) and of the axes.

use crate::device::hid::report::layout::Usage;

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
