//! MJCF, the models of MuJoCo.
//!
//! Defaults, classes, fitted shapes and generated bodies make the format more than a reader of its own
//! can follow: MuJoCo compiles the model where it is installed. Without it a file is read only if
//! every word of it that could change a solid is known.

mod compiled;
pub(crate) mod geom;
mod plain;

use std::path::Path;

use sdf_grid::{Ledger, LedgerKind};

use crate::solids::element::Element;
use crate::solids::error::ImportError;
use crate::solids::geometry::Shape;
use crate::solids::mjcf::geom::{MujocoOptions, chosen};

/// Every shape of every body, in the world at the reference pose; the world's own geoms are those of
/// `world`.
pub(crate) fn shapes(
    path: &Path,
    model: &Element,
    visual: bool,
    options: &MujocoOptions,
    ledger: &mut Ledger,
) -> Result<Vec<Shape>, ImportError> {
    let geoms = match compiled::geoms(path, options, ledger)? {
        Ok(geoms) => geoms,
        Err(why) => {
            let geoms = plain::geoms(path, model, &why, ledger)?;
            ledger.add(LedgerKind::Read, "model without MuJoCo", "");
            geoms
        }
    };
    Ok(chosen(geoms, visual, ledger))
}
