//! Scores of a rotation and of the same followed by half turns about the lattice's axes, from one
//! transform of the moving fields.
//!
//! A half turn `S` about the pivot takes nodes to nodes, so the moving field turned by it is the
//! same samples, `b(c - m)` in place of `b(m)` along the two axes that `S` flips (the moving box is
//! symmetric, of `e = c + 1` nodes). With `f_S(u) = f(-u)` along those axes
//!
//! `sum_m f(w + m) b(c - m) = sum_m f_S(-(w + e - 1) + m) b(m)`:
//!
//! the correlation of the same moving field with the flipped fixed one, read at other places. And
//! the spectrum of a flipped real field is the old one, at `-k` along the flipped axes; where z is
//! one of them, `-k` is the conjugate of what stands at `k` along z and mirrored along the others:
//! blocks of kz stay blocks of kz. So the fixed spectra are read in another order, and nothing is
//! sampled, transformed or stored anew.

use super::lane_fft::LaneFft;
use super::layout::Layout;
use crate::correlate::real::Real;
use crate::geometry::half_turn::HalfTurn;

/// How the sum for one half turn is read from the fixed spectra, and where its results come out.
pub(super) struct Image<T> {
    /// Transforms back along x and y.
    pub(super) x: LaneFft<T>,
    pub(super) y: LaneFft<T>,
    /// Where elements of the sum's x lines and of its lines along y begin; what is not wanted has a
    /// place where it harms no one.
    pub(super) x_to: Vec<usize>,
    pub(super) y_to: Vec<usize>,
    /// For each complex output along z the two real ones that it holds.
    pub(super) z_to: Vec<[Output<T>; 2]>,
    /// Where the fixed spectrum for each kx begins in its column, that of the real part.
    pub(super) order: Vec<usize>,
    /// Whether that is the column of `-ky`.
    pub(super) mirrored: bool,
    /// Of the imaginary parts of the fixed spectra.
    pub(super) sign: T,
}

/// A real output along z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Output<T> {
    /// Its index in the window, or beyond it.
    pub(super) index: usize,
    /// What it takes of the real and of the imaginary part.
    pub(super) factors: [T; 2],
}

/// Where the score for window index `w` comes out of a transform of `n` points, and how often it
/// has gone around to get there.
fn output(flipped: bool, w: usize, extent: usize, n: usize) -> (usize, i64) {
    if !flipped {
        return (w, 0);
    }
    let (at, n) = (-((w + extent) as i64 - 1), n as i64);
    (at.rem_euclid(n) as usize, at.div_euclid(n))
}

/// What makes an [`Image`].
pub(super) struct ImageSizes<'a> {
    pub(super) layout: &'a Layout,
    pub(super) size: [usize; 3],
    pub(super) window: [usize; 3],
    /// Nodes of the moving box.
    pub(super) extent: [usize; 3],
    /// x planes of the sum.
    pub(super) planes: usize,
}

impl ImageSizes<'_> {
    /// For every output along an axis the window index that it belongs to, and how often that has
    /// gone around.
    fn outputs(&self, axis: usize, flipped: bool) -> Vec<Option<(usize, i64)>> {
        let (n, wanted) = (self.size[axis], self.window[axis]);
        let mut indices = vec![None; n];
        for w in 0..wanted {
            let (at, around) = output(flipped, w, self.extent[axis], n);
            indices[at] = Some((w, around));
        }
        indices
    }
}

/// The real outputs that complex ones along z hold.
fn z_outputs<T: Real>(depth: &[Option<(usize, i64)>], twist: &[[T; 2]]) -> Vec<[Output<T>; 2]> {
    let output = |z: usize, [a, b]: [T; 2]| {
        let (index, around) = depth[z].unwrap_or((usize::MAX, 0));
        // What goes around along z comes back with the opposite sign.
        let sign = if around % 2 == 0 { T::one() } else { -T::one() };
        Output {
            index,
            factors: [sign * a, sign * b],
        }
    };
    let half = twist.len();
    let both = |(z, &[cos, sin]): (usize, &[T; 2])| {
        [output(z, [cos, -sin]), output(z + half, [-sin, -cos])]
    };
    twist.iter().enumerate().map(both).collect()
}

impl<T: Real> Image<T> {
    /// `back` transforms along x and y; `twist` are cosine and sine of `pi z / nz`.
    pub(super) fn new(
        turn: HalfTurn,
        of: &ImageSizes,
        [x, y]: [LaneFft<T>; 2],
        twist: &[[T; 2]],
    ) -> Self {
        let flips = turn.flips();
        let l = of.layout;
        let indices = |axis| of.outputs(axis, flips[axis]);
        let first = |axis: usize| {
            let (n, w) = (of.size[axis], of.window[axis]);
            let last = if flips[axis] { w - 1 } else { 0 };
            output(flips[axis], last, of.extent[axis], n).0
        };
        let index = |o: &Option<(usize, i64)>| o.map(|o| o.0);
        let radix = x.first_radix();
        let blocks = of.size[0] / radix;
        let [mirror_x, mirror_y] = [0, 1].map(|axis| flips[axis] != flips[2]);
        let order = (0..of.size[0]).map(|k| {
            let k = if mirror_x {
                (of.size[0] - k) % of.size[0]
            } else {
                k
            };
            // As packed: in the order in which the turning pass meets them.
            (k % blocks * 2 * radix + k / blocks) * 2 * l.lanes
        });
        Self {
            x_to: indices(0)
                .iter()
                .map(|o| l.x_to(of.planes, index(o)))
                .collect(),
            y_to: indices(1).iter().map(|o| l.y_to(index(o))).collect(),
            z_to: z_outputs(&indices(2), twist),
            x: x.with_first_output(first(0)),
            y: y.with_first_output(first(1)),
            order: order.collect(),
            mirrored: mirror_y,
            sign: if flips[2] { -T::one() } else { T::one() },
        }
    }
}
