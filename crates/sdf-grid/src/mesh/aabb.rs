//! Boxes along the axes.

use glam::DVec3;
use serde::Serialize;

/// An axis-aligned box, metres.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::Aabb;
///
/// let bounds = Aabb::around([DVec3::ZERO, DVec3::new(0.03, 0.04, 0.0)]);
/// assert!((bounds.diagonal() - 0.05).abs() < 1e-15);
/// assert!(bounds.grown(0.001).contains(DVec3::splat(-0.001)));
/// assert_eq!(Aabb::EMPTY.union(&bounds), bounds);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Aabb {
    /// Lowest corner.
    pub min: DVec3,
    /// Highest corner.
    pub max: DVec3,
}

impl Aabb {
    /// The box that holds nothing: the neutral element of [`Aabb::union`].
    pub const EMPTY: Self = Self {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
    };

    /// The smallest box around `points`; [`Aabb::EMPTY`] if there are none.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self {
            min: b.min.min(p),
            max: b.max.max(p),
        })
    }

    /// Edge lengths, metres; negative infinity for the empty box.
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// Length of the space diagonal, metres; 0 for the empty box.
    pub fn diagonal(&self) -> f64 {
        if self.min.cmple(self.max).all() {
            self.size().length()
        } else {
            0.0
        }
    }

    /// Midpoint, metres.
    pub fn center(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// The eight corners, metres; the first coordinate changes fastest.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let side = |axis: usize| [self.min, self.max][i >> axis & 1][axis];
            DVec3::new(side(0), side(1), side(2))
        })
    }

    /// The smallest box around both boxes.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// What both boxes share; if that is nothing, the point or side of this one that is nearest to the
    /// other.
    #[must_use]
    pub fn clipped(&self, to: &Self) -> Self {
        Self {
            min: self.min.max(to.min).min(self.max),
            max: self.max.min(to.max).max(self.min),
        }
    }

    /// The box moved outwards by `margin` metres on every side.
    #[must_use]
    pub fn grown(&self, margin: f64) -> Self {
        Self {
            min: self.min - margin,
            max: self.max + margin,
        }
    }

    /// True if `point` lies inside or on the box.
    pub fn contains(&self, point: DVec3) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// True if the boxes share at least a point.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }
}
