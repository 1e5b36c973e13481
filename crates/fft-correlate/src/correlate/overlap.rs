//! Index arithmetic of windowed correlations: what to keep of each field, and how long the
//! periodic transform must be so that nothing wraps into the wanted window.

/// A half-open box of integer indices, `lo <= index < hi` per axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct IndexBox {
    pub(crate) lo: [i64; 3],
    pub(crate) hi: [i64; 3],
}

impl IndexBox {
    /// The box of a whole array.
    pub(crate) fn of_shape(shape: [usize; 3]) -> Self {
        Self {
            lo: [0; 3],
            hi: shape.map(|s| s as i64),
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        (0..3).any(|a| self.hi[a] <= self.lo[a])
    }

    /// Indices along each axis; zero where empty.
    pub(crate) fn shape(&self) -> [usize; 3] {
        std::array::from_fn(|a| (self.hi[a] - self.lo[a]).max(0) as usize)
    }

    /// All indices, the last one fastest; none may be negative.
    pub(crate) fn indices(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let range = |a: usize| self.lo[a] as usize..self.hi[a] as usize;
        let [x, y, z] = [0, 1, 2].map(range);
        x.flat_map(move |i| {
            let z = z.clone();
            y.clone()
                .flat_map(move |j| z.clone().map(move |k| [i, j, k]))
        })
    }

    /// The smallest box that holds both.
    pub(crate) fn hull(&self, other: &Self) -> Self {
        Self {
            lo: std::array::from_fn(|a| self.lo[a].min(other.lo[a])),
            hi: std::array::from_fn(|a| self.hi[a].max(other.hi[a])),
        }
    }

    pub(crate) fn intersect(&self, other: &Self) -> Self {
        Self {
            lo: std::array::from_fn(|a| self.lo[a].max(other.lo[a])),
            hi: std::array::from_fn(|a| self.hi[a].min(other.hi[a])),
        }
    }
}

/// One correlation `f[n] = sum_i A[i] B[i - n]` for `n` in a window, made ready for a periodic
/// transform.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Overlap {
    /// The part of `A` that reaches the window.
    pub(crate) fixed: IndexBox,
    /// The part of `B` that reaches the window.
    pub(crate) moving: IndexBox,
    /// The shortest period per axis that keeps the window free of wrap-around and holds the moving
    /// box.
    pub(crate) min_period: [usize; 3],
}

/// Crops the supports of `A` and `B` to what the window can see; `None` if they never meet.
///
/// Along each axis the differences `i - j` of the cropped boxes span `[d0, d1]`; a period `P` is
/// long enough when no `n + m P` with `n` wanted and `m != 0` lies in that span.
pub(crate) fn overlap(fixed: IndexBox, moving: IndexBox, window: IndexBox) -> Option<Overlap> {
    let (mut fixed, mut moving) = (fixed, moving);
    for _ in 0..2 {
        if fixed.is_empty() || moving.is_empty() || window.is_empty() {
            return None;
        }
        fixed = fixed.intersect(&reachable_indices(&moving, &window));
        moving = moving.intersect(&IndexBox {
            lo: std::array::from_fn(|a| fixed.lo[a] - (window.hi[a] - 1)),
            hi: std::array::from_fn(|a| fixed.hi[a] - window.lo[a]),
        });
    }
    if fixed.is_empty() || moving.is_empty() {
        return None;
    }
    Some(Overlap {
        fixed,
        moving,
        min_period: min_period(&fixed, &moving, &window),
    })
}

impl Overlap {
    /// The same with the moving box made symmetric about the index `middle / 2`, and the part of
    /// `fixed`, the support of `A`, that this one reaches.
    pub(crate) fn symmetric(&self, fixed: IndexBox, window: IndexBox, middle: [i64; 3]) -> Self {
        let moving = self.moving;
        let moving = IndexBox {
            lo: std::array::from_fn(|a| moving.lo[a].min(middle[a] - moving.hi[a] + 1)),
            hi: std::array::from_fn(|a| moving.hi[a].max(middle[a] - moving.lo[a] + 1)),
        };
        let fixed = fixed.intersect(&reachable_indices(&moving, &window));
        Self {
            fixed,
            moving,
            min_period: min_period(&fixed, &moving, &window),
        }
    }
}

/// The indices of `A` that a moving box meets from some place of the window.
fn reachable_indices(moving: &IndexBox, window: &IndexBox) -> IndexBox {
    IndexBox {
        lo: std::array::from_fn(|a| moving.lo[a] + window.lo[a]),
        hi: std::array::from_fn(|a| moving.hi[a] + window.hi[a] - 1),
    }
}

fn min_period(fixed: &IndexBox, moving: &IndexBox, window: &IndexBox) -> [usize; 3] {
    std::array::from_fn(|a| {
        let (d0, d1) = (
            fixed.lo[a] - (moving.hi[a] - 1),
            fixed.hi[a] - 1 - moving.lo[a],
        );
        let above = d1 - window.lo[a] + 1;
        let below = window.hi[a] - 1 - d0 + 1;
        let sizes = [
            above,
            below,
            moving.hi[a] - moving.lo[a],
            window.hi[a] - window.lo[a],
        ];
        sizes.into_iter().max().unwrap_or(1).max(1) as usize
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No pair of kept indices may alias into the window, and dropping what was cropped may lose
    /// no pair that the window wants: checked by listing every pair along one axis.
    #[test]
    fn cropping_loses_nothing_and_the_period_is_the_shortest_without_wrap() {
        for (a, b, w) in [
            ((0, 9), (0, 4), (-3, 5)),
            ((2, 30), (-5, 2), (-4, 4)),
            ((0, 3), (-20, 20), (1, 6)),
            ((0, 5), (0, 5), (-4, 5)),
            ((0, 40), (3, 9), (0, 1)),
        ] {
            let on = |(lo, hi)| IndexBox {
                lo: [lo, 0, 0],
                hi: [hi, 1, 1],
            };
            let window = IndexBox {
                lo: [w.0, 0, 0],
                hi: [w.1, 1, 1],
            };
            let o = overlap(on(a), on(b), window).unwrap();
            let kept = |i: i64, j: i64| {
                (o.fixed.lo[0]..o.fixed.hi[0]).contains(&i)
                    && (o.moving.lo[0]..o.moving.hi[0]).contains(&j)
            };
            let wraps = |period: i64| {
                (w.0..w.1).any(|n| {
                    (a.0..a.1).any(|i| {
                        (b.0..b.1).any(|j| kept(i, j) && i - j != n && (i - j - n) % period == 0)
                    })
                })
            };
            for i in a.0..a.1 {
                for j in b.0..b.1 {
                    assert!(!(w.0..w.1).contains(&(i - j)) || kept(i, j), "{i} {j}");
                }
            }
            let period = o.min_period[0] as i64;
            assert!(!wraps(period), "{a:?} {b:?} {w:?} {o:?}");
            let floor = (w.1 - w.0).max(o.moving.hi[0] - o.moving.lo[0]);
            assert!(
                period == floor || wraps(period - 1),
                "{a:?} {b:?} {w:?} {o:?}"
            );
        }
    }

    #[test]
    fn supports_that_never_meet_give_nothing() {
        let far = IndexBox {
            lo: [100; 3],
            hi: [110; 3],
        };
        let near = IndexBox::of_shape([5; 3]);
        let window = IndexBox {
            lo: [-3; 3],
            hi: [4; 3],
        };
        assert!(overlap(far, near, window).is_none());
        assert!(overlap(near, near, window).is_some());
    }
}
