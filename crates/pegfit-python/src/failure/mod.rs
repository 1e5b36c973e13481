//! What goes wrong, on its way to Python: named errors that carry their evidence.

mod mesh;
mod pair;
pub(crate) mod raised;
mod table;
