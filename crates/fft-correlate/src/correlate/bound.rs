//! Where a pair's densities can be nonzero, told from its parts before any density is computed.

use glam::DVec3;
use sdf_grid::{Aabb, Lattice, TriangleMesh};

use super::factors::{Product, products};
use super::overlap::IndexBox;
use super::support::{MovingSupport, PairSupport, ProductSupport};
use crate::pair::builder::PairPlan;

/// Cells that a boundary cuts have their middle within this of it, cells: half a diagonal.
const CUT: f64 = 0.5 * 1.732_050_807_568_877_2;

impl PairSupport {
    /// Where the densities that these meshes will have can be nonzero: never less than
    /// [`PairSupport::of`] finds. Plans made from it need at least what those of the pair need;
    /// correlators are built with plans of the pair itself.
    pub fn planned(plan: &PairPlan, fixed: &TriangleMesh, moving: &TriangleMesh) -> Self {
        let (h, halo) = (plan.spacing(), plan.density.halo);
        let spread = plan.spread();
        let lattice = plan.fixed_lattice;
        let first = |lattice: &Lattice| (lattice.origin() - plan.pivot) / h;
        let (fixed_first, moving_first) = (first(&lattice), first(&plan.moving_lattice));
        let grown = h + spread;
        let fixed_solid = solid(&fixed.bounds().grown(grown), &lattice);
        let moving_solid = solid(&moving.bounds().grown(h + spread), &plan.moving_lattice);
        let radius = moving.radius_about(plan.pivot);
        let of_product = |product: Product| {
            let (nodes, reach) = match product.moving.is_interior() {
                true => (moving_solid, radius),
                false => (
                    IndexBox::of_shape(plan.moving_lattice.shape()),
                    radius + halo,
                ),
            };
            ProductSupport {
                fixed: Some(match product.fixed.is_interior() {
                    true => fixed_solid,
                    false => IndexBox::of_shape(lattice.shape()),
                }),
                moving: Some(MovingSupport::within(
                    nodes,
                    moving_first,
                    (reach + spread) / h + CUT,
                    plan.reading(),
                )),
                product,
            }
        };
        Self {
            spacing: h,
            reading: plan.reading(),
            fixed_first,
            moving_first,
            products: products(&plan.model).map(of_product).collect(),
        }
    }
}

/// The nodes of a lattice in a box.
fn solid(bounds: &Aabb, lattice: &Lattice) -> IndexBox {
    let index = |p: DVec3| (p - lattice.origin()) / lattice.spacing();
    let whole = |p: DVec3| p.to_array().map(|v| v as i64);
    let inside = IndexBox {
        lo: whole(index(bounds.min).floor()),
        hi: whole(index(bounds.max).ceil() + 1.0),
    };
    inside.intersect(&IndexBox::of_shape(lattice.shape()))
}
