//! Numbers for sixteen points.

/// Points per packet. Fastest on compact groups such as 2 x 2 x 4 neighbours.
pub(crate) const LANES: usize = 16;

/// One number per point.
pub(crate) type Lanes = [f32; LANES];
