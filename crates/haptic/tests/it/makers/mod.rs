//! Devices of makers' drivers, against stand-ins for the drivers: no hardware, the same promises.

mod force_dimension;
mod haply;
mod openhaptics;
mod promises;
mod stub;
