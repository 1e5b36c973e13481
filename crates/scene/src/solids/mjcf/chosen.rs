//! Which geoms of a model count as solids.

use std::collections::BTreeSet;

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
