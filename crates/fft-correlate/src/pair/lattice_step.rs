//! The distance between lattice nodes, as one asks for it.

use sdf_grid::TriangleMesh;

/// The distance between the nodes of both parts' lattices.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum LatticeStep {
    /// Metres.
    Spacing(f64),
    /// Nodes along the longest side of the larger part.
    Points(u32),
    /// Chosen from the parts.
    #[default]
    Automatic,
}

impl LatticeStep {
    /// Metres; `None` where it is to be chosen.
    pub fn spacing(&self, fixed: &TriangleMesh, moving: &TriangleMesh) -> Option<f64> {
        match *self {
            Self::Spacing(spacing) => Some(spacing),
            Self::Points(points) => {
                let longest = |m: &TriangleMesh| m.bounds().size().max_element();
                Some(longest(fixed).max(longest(moving)) / f64::from(points))
            }
            Self::Automatic => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use sdf_grid::shapes;

    use super::*;

    #[test]
    fn points_are_counted_along_the_longest_side_of_the_larger_part() {
        let small = shapes::cuboid(DVec3::new(0.01, 0.02, 0.03)).unwrap();
        let large = shapes::cuboid(DVec3::new(0.04, 0.08, 0.02)).unwrap();
        for (fixed, moving) in [(&small, &large), (&large, &small)] {
            let spacing = LatticeStep::Points(40).spacing(fixed, moving).unwrap();
            assert!((spacing - 0.002).abs() < 1e-12, "{spacing}");
        }
        assert_eq!(LatticeStep::Automatic.spacing(&small, &large), None);
        assert_eq!(LatticeStep::Spacing(0.5).spacing(&small, &large), Some(0.5));
    }
}
