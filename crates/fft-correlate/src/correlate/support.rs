//! The products of a score and where their factors are nonzero, from the densities or, before any
//! density is computed, from the parts' bounds.

use glam::DVec3;
use ndarray::Array3;
use num_complex::{Complex, Complex32};
use sdf_grid::{Aabb, DensityField, Lattice, TriangleMesh};

use crate::correlate::overlap::IndexBox;
use crate::correlate::real::Real;
use crate::pair::builder::PairPlan;
use crate::pair::fields::Pair;
use crate::pair::interpolation::Interpolation;
use crate::pair::model::ScoreModel;

/// Where the factors of a pair's score are nonzero. To find it every density is read once or twice;
/// nothing is allocated for it, and plans made from it read no density.
#[derive(Debug, Clone, PartialEq)]
pub struct PairSupport {
    /// Metres per cell.
    pub(super) spacing: f64,
    /// How the moving part's density is read between nodes.
    pub(super) interpolation: Interpolation,
    /// Node 0 of the fixed and of the moving lattice relative to the pivot, cells.
    pub(super) fixed_first: DVec3,
    pub(super) moving_first: DVec3,
    pub(super) products: Vec<ProductSupport>,
}

/// The supports of one product's factors; `None` where a factor is zero everywhere.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ProductSupport {
    pub(super) product: Product,
    pub(super) fixed: Option<IndexBox>,
    pub(super) moving: Option<MovingSupport>,
}

/// Where a moving field is nonzero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MovingSupport {
    pub(super) nodes: IndexBox,
    /// Largest distance from the pivot at which the interpolated field counts, cells.
    radius: f64,
}

/// What is left out of an interpolated field, of its largest value: a few roundings.
const NOTHING: f64 = 5e-7;

impl PairSupport {
    /// Reads the densities of a pair.
    ///
    /// # Errors
    /// If one is not finite.
    pub fn of(pair: &Pair) -> Result<Self, CorrelateError> {
        for (part, field) in [("fixed", pair.fixed()), ("moving", pair.moving())] {
            check_finite(part, field)?;
        }
        let h = pair.spacing();
        let first = |field: &DensityField| (field.lattice().origin() - pair.pivot()) / h;
        let moving_first = first(pair.moving());
        let interpolation = pair.interpolation();
        let of_product = |product: Product| {
            let fixed = |at| product.fixed.value(pair.fixed(), at);
            let moving = |at| product.moving.value(pair.moving(), at);
            ProductSupport {
                fixed: support(pair.fixed().lattice().shape(), fixed),
                moving: MovingSupport::from_field(
                    pair.moving().lattice().shape(),
                    moving,
                    moving_first,
                    interpolation,
                ),
                product,
            }
        };
        Ok(Self {
            spacing: h,
            interpolation,
            fixed_first: first(pair.fixed()),
            moving_first,
            products: products(pair.model()).map(of_product).collect(),
        })
    }

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
        // Solids fill their bounds, exteriors the whole lattice.
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
                    plan.interpolation(),
                )),
                product,
            }
        };
        Self {
            spacing: h,
            interpolation: plan.interpolation(),
            fixed_first,
            moving_first,
            products: products(&plan.model).map(of_product).collect(),
        }
    }
}

impl MovingSupport {
    /// Of values whose node `[0, 0, 0]` lies `first` cells from the pivot; `None` if all are zero.
    pub(super) fn from_field(
        shape: [usize; 3],
        value: impl Fn([usize; 3]) -> Complex32,
        first: DVec3,
        interpolation: Interpolation,
    ) -> Option<Self> {
        let nodes = support(shape, &value)?;
        let size = |at| f64::from(value(at).norm_sqr()).sqrt();
        let largest = nodes.indices().map(size).fold(0.0, f64::max);
        let mut radius = 0.0f64;
        for at in nodes.indices() {
            let p = first + DVec3::from_array(at.map(|a| a as f64));
            // The outermost values of a smoothed density are small, and so are their weights beyond.
            let farthest = p.length() + corner(interpolation);
            if farthest > radius && value(at) != Complex32::default() {
                let least = NOTHING * largest / size(at);
                radius = radius.max(p.length() + interpolation.reach_of_weight(least));
            }
        }
        Some(Self { nodes, radius })
    }

    /// Of nodes in a box of which [0, 0, 0] lies `first` cells from the pivot, and none that is not
    /// zero farther than `reach` cells from it.
    pub(super) fn within(
        nodes: IndexBox,
        first: DVec3,
        reach: f64,
        interpolation: Interpolation,
    ) -> Self {
        let place = |v: [i64; 3]| (first + DVec3::from_array(v.map(|v| v as f64))).abs();
        let farthest = place(nodes.lo).max(place(nodes.hi.map(|v| v - 1)));
        Self {
            nodes,
            radius: reach.min(farthest.length()) + corner(interpolation),
        }
    }

    /// The box of fixed-lattice indices that can be nonzero under any rotation, when index 0 lies
    /// `origin` cells from the pivot.
    pub(super) fn reach(&self, origin: DVec3) -> IndexBox {
        let lo = (DVec3::splat(-self.radius) - origin).ceil();
        let hi = (DVec3::splat(self.radius) - origin).floor() + 1.0;
        IndexBox {
            lo: lo.to_array().map(|v| v as i64),
            hi: hi.to_array().map(|v| v as i64),
        }
    }
}

/// How far a node counts at most, cells.
fn corner(interpolation: Interpolation) -> f64 {
    interpolation.reach_of_weight(0.0)
}

/// The bounding box of the nonzero values, or `None`.
fn support(shape: [usize; 3], value: impl Fn([usize; 3]) -> Complex32) -> Option<IndexBox> {
    let mut found: Option<IndexBox> = None;
    for index in IndexBox::of_shape(shape).indices() {
        if value(index) != Complex32::default() {
            let at = index.map(|i| i as i64);
            let b = found.get_or_insert(IndexBox {
                lo: at,
                hi: at.map(|v| v + 1),
            });
            b.lo = std::array::from_fn(|a| b.lo[a].min(at[a]));
            b.hi = std::array::from_fn(|a| b.hi[a].max(at[a] + 1));
        }
    }
    found
}

fn check_finite(part: &'static str, field: &DensityField) -> Result<(), CorrelateError> {
    for values in [&field.exterior, &field.interior] {
        if let Some(((i, j, k), _)) = values.indexed_iter().find(|(_, v)| !v.is_finite()) {
            return Err(CorrelateError::NotFinite {
                part,
                index: [i, j, k],
            });
        }
    }
    Ok(())
}

/// One product of the score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Product {
    /// The two factors: fixed, then moving.
    pub(super) name: &'static str,
    pub(super) fixed: Factor,
    pub(super) moving: Factor,
}

/// A sum of a part's densities: weights of the exterior and of the interior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Factor([f64; 2]);

impl Factor {
    /// At one node.
    pub(super) fn value(&self, field: &DensityField, at: [usize; 3]) -> Complex32 {
        match self.0 {
            [0.0, 1.0] => field.interior[at],
            [1.0, 0.0] => field.exterior[at],
            weights => {
                let [e, i] = weights.map(|w| w as f32);
                field.exterior[at] * e + field.interior[at] * i
            }
        }
    }

    /// Zero wherever the part is not solid.
    pub(super) fn is_interior(&self) -> bool {
        self.0[0] == 0.0
    }

    /// The nodes inside of `kept` in the periodic box, so that window index 0 comes out at index 0;
    /// `moving_first` is the first index of the moving box.
    pub(super) fn periodic<T: Real>(
        &self,
        field: &DensityField,
        kept: &IndexBox,
        moving_first: [i64; 3],
        window_first: [i64; 3],
        size: [usize; 3],
        scale: T,
    ) -> Array3<Complex<T>> {
        let mut periodic = Array3::zeros(size);
        let wide = |v: f32| T::nearest(f64::from(v)) * scale;
        for at in kept.indices() {
            let to: [usize; 3] = std::array::from_fn(|a| {
                let from_start = at[a] as i64 - moving_first[a] - window_first[a];
                from_start.rem_euclid(size[a] as i64) as usize
            });
            let v = self.value(field, at);
            periodic[to] = Complex::new(wide(v.re), wide(v.im));
        }
        periodic
    }
}

/// The products of a score: at most two.
pub(super) fn products(m: &ScoreModel) -> impl Iterator<Item = Product> {
    let (l1, l2, w) = (m.lambda_exterior, m.lambda_interior, m.separation_weight);
    let product = |name, fixed, moving| Product {
        name,
        fixed: Factor(fixed),
        moving: Factor(moving),
    };
    let products = if w == 1.0 {
        [Some(product("whole * whole", [l1, l2], [l1, l2])), None]
    } else {
        let second = if w == 0.0 {
            "interior * exterior"
        } else {
            "whole * exterior"
        };
        [
            Some(product("whole * interior", [l1 * l2, l2 * l2], [0.0, 1.0])),
            Some(product(second, [w * l1 * l1, l1 * l2], [1.0, 0.0])),
        ]
    };
    products.into_iter().flatten()
}

/// Cells that a boundary cuts have their middle within this of it, cells: half a diagonal.
const CUT: f64 = 0.5 * 1.732_050_807_568_877_2;

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

/// Why a correlator cannot be planned or built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CorrelateError {
    /// The window's spacing is not the pair's.
    #[error(
        "translation window: expected the pair's lattice spacing {expected} m, found {found} m"
    )]
    Spacing {
        /// The pair's spacing, metres.
        expected: f64,
        /// The window's spacing, metres.
        found: f64,
    },
    /// The transform would have too many points.
    #[error("transform of {size:?} points: expected at most {limit} in all")]
    Size {
        /// Points per axis.
        size: [usize; 3],
        /// The largest number of points accepted.
        limit: u64,
    },
    /// A density is not finite.
    #[error("density of the {part} part is not finite at lattice node {index:?}")]
    NotFinite {
        /// `fixed` or `moving`.
        part: &'static str,
        /// The first such node.
        index: [usize; 3],
    },
    /// The pair to build for is not the one that was planned for.
    #[error(
        "pair: expected the one that the plan was made for, found other weights, or densities that \
         are nonzero elsewhere"
    )]
    OtherPair,
}
