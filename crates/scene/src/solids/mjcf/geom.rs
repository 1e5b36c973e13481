//! Geoms of a model: which count as solids; and options of MuJoCo.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

use sdf_grid::{Ledger, LedgerKind};

use crate::solids::geometry::{SEGMENTS, Shape};

/// Why a plane is left out.
pub(super) const PLANE: &str = "it bounds half of space, no solid";

/// Why a height field is left out.
pub(super) const HEIGHT_FIELD: &str = "it is a landscape, no solid";

/// What is assumed of a joint.
pub(super) const STANDS: &str = "stands at its reference position";

/// A geom, before it is chosen.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Geom {
    pub(super) shape: Shape,
    /// It touches nothing: it is there to be looked at.
    pub(super) visual: bool,
}

/// Of each body that has both, the geoms to look at (`visual`) or those that touch; all others of
/// bodies that have one kind. By bodies.
pub(super) fn chosen(mut geoms: Vec<Geom>, visual: bool, ledger: &mut Ledger) -> Vec<Shape> {
    geoms.sort_by_key(|g| g.shape.group);
    let of_kind = |visual: bool| -> BTreeSet<usize> {
        let geoms = geoms.iter().filter(|g| g.visual == visual);
        geoms.map(|g| g.shape.group).collect()
    };
    let (seen, touching) = (of_kind(true), of_kind(false));
    let mut shapes = Vec::new();
    let mut faceted = 0;
    for Geom {
        shape,
        visual: is_visual,
    } in geoms
    {
        let both = seen.contains(&shape.group) && touching.contains(&shape.group);
        if both && is_visual != visual {
            let (item, reason) = match is_visual {
                true => (
                    "visual geom",
                    "its body has geoms that touch; --visual takes the visual ones instead",
                ),
                false => ("touching geom", "--visual, and its body has visual geoms"),
            };
            ledger.add(LedgerKind::Ignored, item, reason);
            continue;
        }
        ledger.add(
            LedgerKind::Read,
            &format!("{} geom", shape.geometry.kind()),
            "",
        );
        if is_visual && !both {
            let reason = "a solid, although it touches nothing: its body has no other";
            ledger.add(LedgerKind::Assumed, "visual geom", reason);
        }
        faceted += u64::from(shape.geometry.is_faceted());
        shapes.push(shape);
    }
    let facets = format!("facets, {SEGMENTS} around a full turn");
    ledger.add_many(LedgerKind::Assumed, "curved geom", &facets, faceted);
    shapes
}

/// How MuJoCo is asked to compile a model.
///
/// See the example of [`SolidOptions`](crate::SolidOptions).
#[derive(Debug, Clone, PartialEq)]
pub struct MujocoOptions {
    /// A Python interpreter that may have the module `mujoco`: a path, or a name on the PATH. If
    /// `None`, the first of `python3` and `python` that has it. Without the module, a model is read
    /// only if it needs nothing of MuJoCo.
    pub interpreter: Option<PathBuf>,
    /// Processor time after which MuJoCo is stopped, in whole seconds, at least one; by the clock it
    /// may take ten times as long.
    pub time_limit: Duration,
    /// Address space that it may use, and the most it may write to a file, bytes.
    pub memory_limit: u64,
}

impl Default for MujocoOptions {
    /// An interpreter from the PATH, 2 minutes, 4 GiB.
    fn default() -> Self {
        Self {
            interpreter: None,
            time_limit: Duration::from_secs(120),
            memory_limit: 4 << 30,
        }
    }
}
