//! The loop: ticks at absolute deadlines on a thread of its own, or as fast as it can in simulated
//! time.

pub(crate) mod pace;
pub(crate) mod realtime;
pub(crate) mod report;
pub(crate) mod session;
pub(crate) mod stepped;
