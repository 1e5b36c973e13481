//! 3MF: a zip archive with XML models in it.
//!
//! Read through the `zip` and `quick-xml` crates in one pass over each model, because the 3MF
//! crates there are build the whole document in memory first, or keep coordinates in single
//! precision. Meshes, components, build items, the production extension's parts in other files and
//! what slicers say of parts are read; materials and everything else that is no boundary is listed.

mod model;
mod package;
mod slicer;
mod unfolding;

use crate::mesh::error::MeshError;
use crate::mesh_io::soup::Soup;
use package::Package;
use unfolding::Unfolding;

/// Reads every item that the file asks to build. An item of one mesh is a solid, named after its
/// object; of several, each is, named after the item's object and its own: `box/lid`.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut package = Package::open(file, bytes)?;
    let root = package.root()?;
    let slicer = slicer::read(file, &mut package)?;
    Unfolding::new(file, package, root, slicer).run()
}
