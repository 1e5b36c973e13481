//! The moving part's field at the nodes of the fixed part's lattice, for one rotation.

mod field;
mod hull;
mod second_turns;
mod turned;

pub(super) use field::MovingField;
pub(super) use second_turns::SecondTurns;
pub(super) use turned::Turned;

#[cfg(test)]
mod tests;
