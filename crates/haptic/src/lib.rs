//! 1 kHz haptic rendering of an assembly energy.
