//! The moving part's field at the nodes of the fixed part's lattice, for one rotation.

mod hull;
mod moving_field;
mod rotated_field;
mod rotation_moments;

pub(super) use moving_field::MovingField;
pub(super) use rotated_field::RotatedField;
pub(super) use rotation_moments::RotationMoments;

#[cfg(test)]
mod tests;
