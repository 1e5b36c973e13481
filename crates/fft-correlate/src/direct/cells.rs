//! The cells of a smoothed density as quadrature points.

use num_complex::{Complex32, Complex64};
use sdf_grid::DensityField;

use crate::direct::quadrature::Point;
use crate::direct::terms::Blend;

/// Nodes along the sides of the bricks in which points are listed, so that neighbours in the list
/// are neighbours in space.
const BRICK: usize = 4;

/// Values below this share of the largest, the outermost rim of what smoothing spreads, are left
/// out.
const NEGLIGIBLE: f64 = 1e-3;

/// Every cell that counts, with its node and the blend there times its volume.
pub(super) fn cells(field: &DensityField, blend: Blend) -> Vec<Point> {
    let widen = |v: Complex32| Complex64::new(v.re.into(), v.im.into());
    let value = |index: [usize; 3]| {
        blend.exterior * widen(field.exterior[index])
            + blend.interior * widen(field.interior[index])
    };
    let lattice = field.lattice();
    let shape = lattice.shape();
    let squares = (0..lattice.len()).map(|flat| value(lattice.unravel(flat)).norm_sqr());
    let least = NEGLIGIBLE.powi(2) * squares.fold(0.0, f64::max);
    let volume = lattice.cell_volume();
    let mut points = Vec::new();
    let bricks = shape.map(|n| n.div_ceil(BRICK));
    for brick in 0..bricks.iter().product() {
        let corner = [
            brick / bricks[2] / bricks[1],
            brick / bricks[2] % bricks[1],
            brick % bricks[2],
        ];
        for place in 0..BRICK.pow(3) {
            let within = [place / BRICK / BRICK, place / BRICK % BRICK, place % BRICK];
            let index: [usize; 3] = std::array::from_fn(|a| BRICK * corner[a] + within[a]);
            if (0..3).any(|a| index[a] >= shape[a]) {
                continue;
            }
            let weight = value(index);
            if weight.norm_sqr() > least {
                points.push(Point {
                    position: lattice.position(index),
                    weight: weight * volume,
                });
            }
        }
    }
    points
}
