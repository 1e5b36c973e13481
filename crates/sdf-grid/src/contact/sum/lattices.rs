//! Lattices on the parts of a surface that can be unrolled into a plane.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3, IVec3};

use super::cylinder::Cylinder;
use super::regions::cylinders;
use super::smooth_parts::SmoothParts;
use crate::contact::error::ContactError;
use crate::mesh::triangle_mesh::TriangleMesh;

/// A lattice of squares on a part of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) enum PartLattice {
    /// In a plane: from the mesh's frame to that of the lattice, which has the normal as its third
    /// axis.
    Flat(DMat3),
    /// On a cylinder.
    Round(RoundLattice),
    /// There is none.
    None,
}

/// A lattice of squares on a cylinder that closes around it.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoundLattice {
    cylinder: Cylinder,
    /// Metres in the cylinder's unit.
    unit: f64,
    /// Once around, in squares along the lattice's two directions.
    around: [i32; 2],
    /// The side of the squares, metres.
    side: f64,
}

/// Those of the parts of `mesh`, of squares `distance` wide, for a kernel with a reach (metres).
///
/// The longest border of a flat part, and the axis of a cylinder, are at an angle to the squares that
/// spreads the projections of a square lattice on them best.
///
/// # Errors
/// If there would be too many pieces.
pub(super) fn lattices(
    mesh: &TriangleMesh,
    parts: &SmoothParts,
    distance: f64,
    reach: f64,
) -> Result<Vec<PartLattice>, ContactError> {
    let mut found: Vec<PartLattice> = parts.bent.iter().map(|_| PartLattice::None).collect();
    for (part, cylinder) in cylinders(mesh, parts, reach)?.1 {
        let lattice = RoundLattice::new(cylinder, reach, distance);
        found[part as usize] = lattice.map_or(PartLattice::None, PartLattice::Round);
    }
    let mut longest = vec![0.0; found.len()];
    for (t, corners) in mesh.faces().enumerate() {
        let part = parts.of[t] as usize;
        if parts.bent[part] {
            continue;
        }
        if longest[part] == 0.0 {
            found[part] = PartLattice::Flat(DMat3::from_quat(generic()));
        }
        for [a, b] in parts.borders(mesh, t) {
            let [a, b] = [a, b].map(|v| mesh.vertices()[v as usize]);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let (Some(x), Some(z)) = ((b - a).try_normalize(), normal.try_normalize()) else {
                continue;
            };
            if a.distance(b) > longest[part] {
                let turn = DMat3::from_rotation_z(golden().to_angle());
                let face = DMat3::from_cols(x, z.cross(x), z).transpose();
                longest[part] = a.distance(b);
                found[part] = PartLattice::Flat(turn * face);
            }
        }
    }
    Ok(found)
}

/// A rotation after which no edge of a part is along a lattice, unless it is made so.
pub(super) fn generic() -> DQuat {
    DQuat::from_scaled_axis(DVec3::new(0.553, -0.709, 0.961))
}

/// The direction of a square lattice's side whose slope is the golden ratio.
fn golden() -> DVec2 {
    DVec2::new(1.0, 0.5 * (5f64.sqrt() - 1.0)).normalize()
}

impl PartLattice {
    /// The square in which a place is, whose sides are `distance` (metres) long in a plane.
    pub(super) fn place(&self, p: DVec3, distance: f64) -> Option<IVec3> {
        match self {
            Self::Flat(turn) => Some((*turn * p / distance).floor().as_ivec3().with_z(0)),
            Self::Round(lattice) => Some(lattice.place(p)),
            Self::None => None,
        }
    }
}

impl RoundLattice {
    /// None if the cylinder is too thin for squares of that size.
    fn new(cylinder: Cylinder, unit: f64, distance: f64) -> Option<Self> {
        let around = TAU * cylinder.radius() * unit;
        let squares = (golden() * (around / distance)).round();
        let side = around / squares.length();
        (squares.min_element() >= 1.0 && squares.max_element() < 1e9).then(|| Self {
            cylinder,
            unit,
            around: squares.as_ivec2().to_array(),
            side,
        })
    }

    fn place(&self, p: DVec3) -> IVec3 {
        let unrolled = self.cylinder.unrolled(p / self.unit) * (self.unit / self.side);
        let [m, n] = self.around;
        // Along the direction in which `m` and `n` squares are once around, and across.
        let once = DVec2::new(f64::from(m), f64::from(n)).normalize();
        let turned = DVec2::new(
            unrolled.x * once.x - unrolled.y * once.y,
            unrolled.x * once.y + unrolled.y * once.x,
        );
        let place = turned.floor().as_i64vec2();
        // A square that is crossed by the seam has two places, once around apart.
        let [m, n] = [m, n].map(i64::from);
        let turns = (place.x * m + place.y * n).div_euclid(m * m + n * n);
        IVec3::new(
            (place.x - turns * m) as i32,
            (place.y - turns * n) as i32,
            0,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// Squares are of one size, but for those that the ends cut, and none is cut by the seam.
    #[test]
    fn the_lattice_closes_around_a_cylinder() {
        let [radius, height, distance] = [0.005, 0.02, 0.0017];
        let mesh = shapes::cylinder(radius, height, 256).unwrap();
        let mesh = mesh.transformed(
            DQuat::from_scaled_axis(DVec3::new(0.3, 2.0, -0.5)),
            DVec3::ONE,
        );
        let parts = SmoothParts::new(&mesh);
        let lattices = lattices(&mesh, &parts, distance, 0.003).unwrap();
        let round = lattices.iter().find_map(|l| match l {
            PartLattice::Round(r) => Some(*r),
            _ => None,
        });
        let round = round.expect("the wall of a cylinder is one");
        assert!((round.side / distance - 1.0).abs() < 0.05, "{round:?}");
        let (u, v) = round.cylinder.along().any_orthonormal_pair();
        let middle = mesh.centroid();
        let mut count = std::collections::HashMap::new();
        // Places as densely as 30 a side, around and along.
        let [around, up] = [TAU * radius, height].map(|l| (30.0 * l / round.side) as usize);
        for i in 0..around {
            let angle = TAU * i as f64 / around as f64;
            for j in 0..up {
                let high = height * ((j as f64 + 0.5) / up as f64 - 0.5);
                let p = middle + radius * (angle.cos() * u + angle.sin() * v);
                *count
                    .entry(round.place(p + high * round.cylinder.along()))
                    .or_insert(0) += 1;
            }
        }
        // A square of 30 by 30; those at the ends hold less.
        let whole = count.values().filter(|n| (850..950).contains(*n)).count();
        let area = TAU * radius * height / round.side.powi(2);
        let cut = TAU * radius / round.side * 2.0 * 2.0;
        assert!(count.values().all(|n| *n < 950), "{count:?}");
        assert!(whole as f64 > area - cut, "{whole} of {}", count.len());
        assert!((count.len() as f64) < area + cut, "{}", count.len());
    }
}
