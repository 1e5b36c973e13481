//! Scores of a rotation and of the same followed by half turns about the lattice's axes, from one
//! transform of the moving fields.
//!
//! A half turn `S` about the pivot takes nodes to nodes, so the moving field turned by it is the
//! same samples, `b(c - m)` in place of `b(m)` along the two axes that `S` flips (the moving box is
//! symmetric, of `e = c + 1` nodes). With `f_S(u) = f(-u)` along those axes
//!
//! `sum_m f(w + m) b(c - m) = sum_m f_S(-(w + e - 1) + m) b(m)`:
//!
//! the correlation of the same moving field with the flipped fixed one, read at other places. And the
//! spectrum of a flipped real field is the old one, at `-k` along the flipped axes; where z is one
//! of them, `-k` is the conjugate of what stands at `k` along z and mirrored along the others:
//! blocks of kz stay blocks of kz. So the fixed spectra are read in another order, and nothing is
//! sampled, transformed or stored anew.

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;

use super::layout::Layout;
use super::stages::line;
use super::{Fused, MAX_TERMS, PlaneScratch, Spectra};
use crate::HalfTurn;
use crate::lane_fft::{LaneFft, transform};
use crate::lanes::{Line, Tile, ask_for};
use crate::radix::{add_mul, mul};
use crate::real::Real;

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
    order: Vec<usize>,
    /// Whether that is the column of `-ky`.
    mirrored: bool,
    /// Of the imaginary parts of the fixed spectra.
    sign: T,
}

/// A real output along z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Output<T> {
    /// Its index in the window, or beyond it.
    pub(super) index: usize,
    /// What it takes of the real and of the imaginary part.
    pub(super) factors: [T; 2],
}

/// One sum on its way back.
#[derive(Clone, Copy)]
pub(super) struct Sum<'a, T> {
    pub(super) image: &'a Image<T>,
    /// Lines along y of all blocks, and the half spectra of one, of which it takes one part.
    pub(super) lines: Tile<T>,
    pub(super) tile: Tile<T>,
    pub(super) part: usize,
    pub(super) planes: usize,
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
pub(super) struct Sizes<'a> {
    pub(super) layout: &'a Layout,
    pub(super) size: [usize; 3],
    pub(super) window: [usize; 3],
    /// Nodes of the moving box.
    pub(super) extent: [usize; 3],
    /// x planes of the sum.
    pub(super) planes: usize,
}

impl<T: Real> Image<T> {
    /// `back` transforms along x and y; `twist` are cosine and sine of `pi z / nz`.
    pub(super) fn new(
        turn: HalfTurn,
        of: &Sizes,
        [x, y]: [LaneFft<T>; 2],
        twist: &[[T; 2]],
    ) -> Self {
        let flips = turn.flips();
        let l = of.layout;
        // Window index of every output, or none.
        let indices = |axis: usize| {
            let (n, wanted) = (of.size[axis], of.window[axis]);
            let mut indices = vec![None; n];
            for w in 0..wanted {
                let (at, around) = output(flips[axis], w, of.extent[axis], n);
                indices[at] = Some((w, around));
            }
            indices
        };
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
        let depth = indices(2);
        let z_output = |z: usize, [a, b]: [T; 2]| {
            let (index, around) = depth[z].unwrap_or((usize::MAX, 0));
            // What goes around along z comes back with the opposite sign.
            let sign = if around % 2 == 0 { T::one() } else { -T::one() };
            Output {
                index,
                factors: [sign * a, sign * b],
            }
        };
        Self {
            x_to: indices(0)
                .iter()
                .map(|o| l.x_to(of.planes, index(o)))
                .collect(),
            y_to: indices(1).iter().map(|o| l.y_to(index(o))).collect(),
            z_to: (0..l.half)
                .zip(twist)
                .map(|(z, &[cos, sin])| {
                    [z_output(z, [cos, -sin]), z_output(z + l.half, [-sin, -cos])]
                })
                .collect(),
            x: x.with_first_output(first(0)),
            y: y.with_first_output(first(1)),
            order: order.collect(),
            mirrored: mirror_y,
            sign: if flips[2] { -T::one() } else { T::one() },
        }
    }
}

/// Columns in an order in which those of `ky` and `-ky` follow each other.
fn columns(ny: usize) -> impl Iterator<Item = usize> {
    (0..ny).map(move |i| {
        let pair = i.div_ceil(2);
        if i % 2 == 1 { pair } else { (ny - pair) % ny }
    })
}

/// The x lines of one kz block, for all terms and all sums: transforms there, products, and
/// transforms back to the sums' half spectra.
///
/// # Safety
/// No one else may use the spectra. The first sum may lie where those of the first term do, and
/// the second too.
#[simd]
pub(super) unsafe fn multiply_images<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    spectra: &[Spectra<'_, T>],
    sums: &[Sum<'_, T>],
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let [nx, ny, _] = f.size;
    let [done @ .., a, b] = &mut own.tiles;
    let work = [a.tile(), b.tile()];
    let column = nx * 4 * l.lanes;
    let fixed = |term: usize, y: usize| -> &[T] {
        &f.terms[term].spectrum.as_slice()[(block * ny + y) * column..][..column]
    };
    let part_offset = f.images[0].x.first_radix() * 2 * l.lanes;
    let filled = |term: &usize| !spectra[*term].filled.is_empty();
    let mut next = columns(ny).skip(2);
    for y in columns(ny) {
        let mut lines = [(work[0], 0, 0); 2 * MAX_TERMS];
        let mut count = 0;
        for term in (0..spectra.len()).filter(filled) {
            let moving = &spectra[term];
            for part in 0..2 {
                let to = done[count].tile();
                // SAFETY: laid out so, see the module.
                unsafe {
                    let from = line(moving.tile, l.column(moving.planes, part, y), moving.x_from);
                    let to = Line {
                        tile: to,
                        places: &f.places,
                    };
                    transform(simd, &f.x, work, from, to, [0, 0]);
                }
                lines[count] = (to, term, part * part_offset);
                count += 1;
            }
        }
        // The columns after the next are asked for meanwhile: else the products wait for them.
        let after = next.next().filter(|_| f.is_large);
        for (i, sum) in sums.iter().enumerate() {
            let from = if sum.image.mirrored { (ny - y) % ny } else { y };
            let share = column.div_ceil(sums.len());
            let share = (i * share).min(column)..((i + 1) * share).min(column);
            let line_of = |i: usize| {
                let (tile, term, offset) = lines[i];
                let ahead = match after {
                    Some(y) if offset == 0 => &fixed(term, y)[share.clone()],
                    _ => &[],
                };
                Factors {
                    moving: tile,
                    fixed: &fixed(term, from)[offset..],
                    ahead,
                }
            };
            // SAFETY: laid out so, see the module.
            unsafe {
                let to = line(sum.tile, l.column(sum.planes, sum.part, y), &sum.image.x_to);
                match count {
                    2 => sum_back(simd, sum.image, [line_of(0), line_of(1)], work, to),
                    _ => sum_back(
                        simd,
                        sum.image,
                        [line_of(0), line_of(1), line_of(2), line_of(3)],
                        work,
                        to,
                    ),
                }
            }
        }
    }
}

/// A line of the moving field and its column of the fixed spectra.
struct Factors<'a, T> {
    moving: Tile<T>,
    fixed: &'a [T],
    /// What is to be on its way to the second-level cache meanwhile.
    ahead: &'a [T],
}

/// The transform back along x of the sum of products of lines with fixed spectra.
///
/// # Safety
/// As [`LaneFft::process`]; the spectra must hold a column.
#[simd]
unsafe fn sum_back<S: Simd, T: Real, const LINES: usize>(
    simd: S,
    image: &Image<T>,
    lines: [Factors<'_, T>; LINES],
    work: [Tile<T>; 2],
    to: Line<'_, T>,
) {
    let sign = T::Native::<S>::splat(simd, image.sign);
    let share = lines[0].ahead.len().div_ceil(image.order.len());
    // SAFETY: as demanded.
    unsafe {
        image.x.process(
            simd,
            work,
            #[inline(always)]
            |k| {
                // Where the result goes has not been touched for a while.
                to.fetch::<S>(k, 0);
                let at = image.order[k];
                let mut sum = [sign; 2];
                for (i, line) in lines.iter().enumerate() {
                    if share > 0 {
                        ask_for(line.ahead, k * share, share.min(line.ahead.len()));
                    }
                    let [re, im] = Tile::shared(line.fixed).from(at).get(simd, 0);
                    let (a, b) = ([re, im * sign], line.moving.get(simd, k));
                    sum = if i == 0 {
                        mul(a, b)
                    } else {
                        add_mul(sum, a, b)
                    };
                }
                sum
            },
            #[inline(always)]
            |x, v| to.put(simd, x, v),
        );
    }
}
