//! Windowed correlation with lane-batched transforms, in three stages that each visit their data
//! once:
//!
//! 1. per x plane of the moving box: z transforms of bundles of y rows, a transposition of small
//!    blocks from lanes of y to lanes of kz;
//! 2. per block of kz lanes: y transforms; per column of x lines x transforms of every term,
//!    products with the fixed spectra, one x transform back; y transforms back. One block at a time
//!    lies in memory, small enough for the caches;
//! 3. per wanted x plane: blocks back to lanes of y, z transforms to real values.
//!
//! Only real parts are computed: `Re(A B) = Ar Br - Ai Bi`, two real transforms going in, and one
//! coming out of the sum of all products. Along z the period is `nz` but the frequencies are
//! `2 k + 1/2`: the sum over z of `b(z) e^{2 pi i z (2 k + 1/2) / nz}` is a complex transform of
//! `nz / 2` points of `(b(z) + i b(z + nz / 2)) e^{pi i z / nz}`, and those `nz / 2` values hold all
//! there is to know of a real line. No frequency is its own conjugate, so there is no zero and no
//! Nyquist frequency to treat apart and no half spectrum to split. What wraps around along z
//! returns with the opposite sign; nothing that wraps around is ever wanted.
//!
//! Lines that are zero going in are skipped, and so are those unwanted coming out. Half turns take
//! stages 2 and 3 from the products on ([`images`]).

mod images;
mod layout;
mod stages;

use std::f64::consts::PI;
use std::ops::Range;
use std::time::Instant;

use fearless_simd::Level;
use ndarray::{ArrayViewMut3, Axis};

use self::images::{Image, Sizes, Sum, multiply_images};
pub(crate) use self::layout::lanes;
use self::layout::{Layout, PLANES, plane_scratch, planes, spectrum_len};
use self::stages::{
    forward_block, forward_plane, inverse_block, inverse_plane, multiply_columns, resample_plane,
};
use crate::HalfTurn;
use crate::fft3::negative_spectra;
use crate::lane_fft::LaneFft;
use crate::lane_plan::{Ends, known};
use crate::lanes::{Buffer, Tile, dispatch_lanes};
use crate::real::Real;
use crate::spectral::{FixedTerm, Memory, MovingRows, StageTimes};

/// Transforms, sizes and fixed spectra; see the module.
pub(crate) struct Fused<T> {
    level: Level,
    size: [usize; 3],
    window: [usize; 3],
    layout: Layout,
    /// Numbers of one resampled bundle, and the bundles that a plane has room for.
    bundle: usize,
    plane_bundles: usize,
    terms: Vec<Term<T>>,
    /// Whether the fixed spectra are more than the second-level cache holds.
    is_large: bool,
    /// Along x and y those of the moving fields; along z both ways, `nz / 2` points.
    x: LaneFft<T>,
    y: LaneFft<T>,
    z: LaneFft<T>,
    /// Cosine and sine of `pi z / nz`.
    twist: Vec<[T; 2]>,
    /// Where the elements of bundles begin whose elements follow each other.
    places: Vec<usize>,
    /// The way back without a half turn, and, if they are provided for, with each of the others.
    images: Vec<Image<T>>,
}

struct Term<T> {
    /// Where the elements of the y lines of its half spectra begin.
    y_places: Vec<usize>,
    /// Per kz block, y and x: real and imaginary lanes of the spectrum of the real part, then of
    /// the imaginary part with its sign changed.
    spectrum: Buffer<T>,
    moving_shape: [usize; 3],
}

/// Working memory of one thread.
pub(crate) struct FusedScratch<T> {
    own: PlaneScratch<T>,
    /// Per term: the lines along y of all kz blocks, and the half spectra of one.
    lines: Vec<Buffer<T>>,
    spectra: Vec<Buffer<T>>,
    /// The same for the third and fourth half turn, if there are: the first two sums replace what
    /// is left of the first term.
    more: Option<[Buffer<T>; 2]>,
    /// Where the elements of the terms' x lines begin under the present rotation.
    x_from: Vec<Vec<usize>>,
}

/// Memory for one plane or column.
struct PlaneScratch<T> {
    /// Resampled bundles of [`PLANES`] moving planes, and the z ranges they fill.
    bundles: Buffer<T>,
    filled: Vec<Range<usize>>,
    /// One plane between its z and its y transforms.
    plane: Buffer<T>,
    tiles: [Buffer<T>; TILES],
}

/// The lines along y, and one block of the half spectra, of one term under the present rotation.
#[derive(Debug, Clone)]
pub(crate) struct Spectra<'a, T> {
    pub(crate) lines: Tile<T>,
    pub(crate) tile: Tile<T>,
    /// x planes that there is room for, and those that are not zero.
    pub(crate) planes: usize,
    pub(crate) filled: Range<usize>,
    pub(crate) x_from: &'a [usize],
}

/// The largest number of terms of one sum.
const MAX_TERMS: usize = 2;

/// Bytes of fixed spectra that still come fast enough by themselves.
const CACHED: u64 = 4 << 20;

/// Tiles of one thread: both parts of all terms, the sum, and one to spare.
const TILES: usize = 2 * MAX_TERMS + 2;

/// Whether all moving parts, and the window, fill no more than half of an axis.
fn halves(
    axis: usize,
    size: [usize; 3],
    window: [usize; 3],
    shapes: &[[usize; 3]],
) -> (bool, bool) {
    let half = size[axis] / 2;
    let from_half = shapes.iter().all(|s| s[axis] <= half);
    (from_half, window[axis] <= half)
}

fn layout_of<T: Real>(
    level: Level,
    size: [usize; 3],
    window: [usize; 3],
    shapes: &[[usize; 3]],
) -> Layout {
    let line = match halves(1, size, window, shapes) {
        (true, true) => size[1] / 2,
        _ => size[1],
    };
    Layout::new(size, line, lanes::<T>(level))
}

impl<T: Real> Fused<T> {
    /// Whether the kernels have all factors of this size.
    pub(crate) fn knows(size: [usize; 3]) -> bool {
        let [x, y, z] = size;
        z.is_multiple_of(2) && [x, y, z / 2].into_iter().all(known)
    }

    /// Bytes of the fixed spectra and of one thread's scratch.
    pub(crate) fn memory(
        level: Level,
        size: [usize; 3],
        window: [usize; 3],
        moving_shapes: &[[usize; 3]],
    ) -> Memory {
        let layout = layout_of::<T>(level, size, window, moving_shapes);
        let spectrum = spectrum_len(&layout, size) * moving_shapes.len();
        let spectra = moving_shapes.iter().enumerate();
        let room = |t, s| {
            let planes = planes(t, s, window);
            layout.lines(planes) + layout.block(planes)
        };
        let [bundles, _, plane, tile] = plane_scratch(&layout, size, moving_shapes);
        let planes = spectra.map(|(t, s)| room(t, *s)).sum::<usize>();
        let bytes = |numbers: usize| (numbers * size_of::<T>()) as u64;
        Memory {
            spectra: bytes(spectrum),
            scratch: bytes(planes + bundles + plane + TILES * tile),
            half_turns: moving_shapes.first().map_or(0, |s| bytes(room(0, *s))),
        }
    }

    /// Transforms the fixed fields, all of one shape that the kernels know. With `half_turns` there
    /// are images for them, and all moving boxes must be one, symmetric about the pivot.
    ///
    /// # Panics
    /// If the kernels lack a factor of the size.
    pub(crate) fn new(
        level: Level,
        size: [usize; 3],
        window: [usize; 3],
        terms: Vec<FixedTerm<T>>,
        half_turns: bool,
    ) -> Self {
        let accepted = "a size that `knows` accepted";
        let fft = |len, ends| LaneFft::new(len, ends).expect(accepted);
        let angle = |z: usize| PI * z as f64 / size[2] as f64;
        assert!(terms.len() <= MAX_TERMS, "at most two terms");
        let shapes: Vec<_> = terms.iter().map(|t| t.moving_shape).collect();
        let layout = layout_of::<T>(level, size, window, &shapes);
        let halves = |axis: usize| halves(axis, size, window, &shapes);
        let y = |from_half, to_half| {
            let ends = Ends {
                from_half,
                to_half,
                ..Ends::default()
            };
            fft(size[1], ends)
        };
        let [x, x_back] = LaneFft::pair(size[0], halves(0).0, halves(0).1).expect(accepted);
        let y_back = y(false, halves(1).1);
        let twist: Vec<_> = (0..layout.half)
            .map(|z| [angle(z).cos(), angle(z).sin()].map(T::nearest))
            .collect();
        let sizes = Sizes {
            layout: &layout,
            size,
            window,
            extent: shapes[0],
            planes: planes(0, shapes[0], window),
        };
        let turns = &HalfTurn::ALL[..if half_turns { 4 } else { 1 }];
        let image = |turn: &HalfTurn| {
            let back = [x_back.clone(), y_back.clone()];
            Image::new(*turn, &sizes, back, &twist)
        };
        let fused = Self {
            images: turns.iter().map(image).collect(),
            bundle: layout.bundle(&shapes),
            plane_bundles: layout.bundles(size[1]),
            level,
            size,
            window,
            layout,
            terms: Vec::new(),
            is_large: Self::memory(level, size, window, &shapes).spectra > CACHED,
            x,
            y: y(halves(1).0, false),
            z: fft(layout.half, Ends::default()),
            twist,
            places: (0..layout.line_elements.max(size[0]).max(size[1]))
                .map(|y| y * 2 * layout.lanes)
                .collect(),
        };
        let terms = terms.into_iter().enumerate().map(|(i, t)| Term {
            y_places: layout.y_places(planes(i, t.moving_shape, window), size[1]),
            moving_shape: t.moving_shape,
            spectrum: fused.packed(t),
        });
        Self {
            terms: terms.collect(),
            ..fused
        }
    }

    /// Both half spectra of a fixed field, divided by the number of points, as stage 2 reads them.
    fn packed(&self, term: FixedTerm<T>) -> Buffer<T> {
        let [nx, ny, _] = self.size;
        let Layout { lanes, half, .. } = self.layout;
        let scale = 1.0 / (nx * ny * half) as f64;
        let radix = self.images[0].x.first_radix();
        let blocks = nx / radix;
        let parts = negative_spectra(&term.field);
        let mut packed = Buffer::zeroed(spectrum_len(&self.layout, self.size));
        let to = packed.as_mut_slice();
        for (part, (spectrum, scale)) in parts.iter().zip([scale, -scale]).enumerate() {
            let scale = T::nearest(scale);
            for ((x, y, z), v) in spectrum.indexed_iter() {
                // The order in which the turning pass meets them.
                let (p, j) = (x % blocks, x / blocks);
                let element = ((z / lanes * ny + y) * nx + p * radix) * 2 + part * radix + j;
                let at = element * 2 * lanes + z % lanes;
                to[at] = v.re * scale;
                to[at + lanes] = v.im * scale;
            }
        }
        packed
    }

    pub(crate) fn scratch(&self) -> FusedScratch<T> {
        let planes = |(t, term): (usize, &Term<T>)| planes(t, term.moving_shape, self.window);
        let shapes: Vec<_> = self.terms.iter().map(|t| t.moving_shape).collect();
        let [bundles, filled, plane, tile] = plane_scratch(&self.layout, self.size, &shapes);
        let buffers = |len: &dyn Fn(usize) -> usize| -> Vec<Buffer<T>> {
            let terms = self.terms.iter().enumerate();
            terms.map(|t| Buffer::zeroed(len(planes(t)))).collect()
        };
        FusedScratch {
            own: PlaneScratch {
                bundles: Buffer::zeroed(bundles),
                filled: vec![0..0; filled],
                plane: Buffer::zeroed(plane),
                tiles: std::array::from_fn(|_| Buffer::zeroed(tile)),
            },
            lines: buffers(&|p| self.layout.lines(p)),
            spectra: buffers(&|p| self.layout.block(p)),
            more: (self.images.len() > 1).then(|| {
                let planes = planes((0, &self.terms[0]));
                [self.layout.lines(planes), self.layout.block(planes)].map(Buffer::zeroed)
            }),
            x_from: vec![vec![0; self.size[0]]; shapes.len()],
        }
    }

    /// As [`crate::spectral::Spectral::correlate`].
    pub(crate) fn correlate<M: MovingRows<T>>(
        &self,
        moving: &[M],
        turns: &[HalfTurn],
        scratch: &mut FusedScratch<T>,
        outs: &mut [ArrayViewMut3<T>],
    ) -> StageTimes {
        assert_eq!(moving.len(), self.terms.len());
        let count = outs.len();
        assert_eq!(count, turns.len().max(1));
        assert!(outs.iter().all(|out| out.shape() == self.window));
        let mut times = StageTimes::default();
        if moving.iter().all(|m| m.bounds()[0].is_empty()) {
            outs.iter_mut().for_each(|out| out.fill(T::zero()));
            return times;
        }
        let FusedScratch {
            own,
            lines,
            spectra,
            more,
            x_from,
        } = scratch;
        let planes = |t: usize| planes(t, self.terms[t].moving_shape, self.window);
        for (t, (places, field)) in x_from.iter_mut().zip(moving).enumerate() {
            let [filled, ..] = field.bounds();
            for (x, place) in places.iter_mut().enumerate() {
                *place = self.layout.x_from(planes(t), &filled, x);
            }
        }
        let views: [Spectra<T>; MAX_TERMS] = std::array::from_fn(|t| {
            let t = t.min(moving.len() - 1);
            Spectra {
                lines: lines[t].tile(),
                tile: spectra[t].tile(),
                planes: planes(t),
                filled: moving[t].bounds()[0].clone(),
                x_from: &x_from[t],
            }
        });
        let views = &views[..moving.len()];
        let mut sum = |i: usize| {
            let (lines, tile) = match (i, &mut *more) {
                (0 | 1, _) => (views[0].lines, views[0].tile),
                (_, Some([lines, tile])) => (lines.tile(), tile.tile()),
                _ => panic!("scratch without room for half turns"),
            };
            Sum {
                image: &self.images[turns.get(i).map_or(0, |turn| *turn as usize)],
                lines,
                tile,
                part: i % 2,
                planes: views[0].planes,
            }
        };
        let sums: [Sum<T>; 4] = std::array::from_fn(|i| sum(i.min(count - 1)));
        let sums = &sums[..count];
        for ((field, to), term) in moving.iter().zip(views).zip(&self.terms) {
            let rows = field.bounds()[1].clone();
            for first in to.filled.clone().step_by(PLANES) {
                let began = Instant::now();
                let sampled = first..(first + PLANES).min(to.filled.end);
                for (slot, x) in sampled.clone().enumerate() {
                    dispatch_lanes!(self.level, simd => resample_plane(simd, self, field, x, slot, own));
                }
                let done = Instant::now();
                for (slot, x) in sampled.enumerate() {
                    // SAFETY: the spectra are borrowed, and only this call uses them.
                    dispatch_lanes!(self.level, simd => unsafe {
                        forward_plane(simd, self, term, [x, slot], rows.clone(), to, own)
                    });
                }
                times.resample += (done - began).as_secs_f64();
                times.forward += done.elapsed().as_secs_f64();
            }
        }
        for block in 0..self.layout.blocks {
            let began = Instant::now();
            // SAFETY: as above.
            dispatch_lanes!(self.level, simd => unsafe {
                forward_block(simd, self, block, views, own)
            });
            let forward = Instant::now();
            // SAFETY: as above.
            dispatch_lanes!(self.level, simd => unsafe {
                match turns {
                    [] => multiply_columns(simd, self, block, views, &sums[0], own),
                    _ => multiply_images(simd, self, block, views, sums, own),
                }
            });
            let multiplied = Instant::now();
            for sum in sums {
                // SAFETY: as above.
                dispatch_lanes!(self.level, simd => unsafe {
                    inverse_block(simd, self, block, sum, own)
                });
            }
            times.forward += (forward - began).as_secs_f64();
            times.product += (multiplied - forward).as_secs_f64();
            times.inverse += multiplied.elapsed().as_secs_f64();
        }
        let began = Instant::now();
        for (sum, out) in sums.iter().zip(outs) {
            for (x, mut plane) in out.axis_iter_mut(Axis(0)).enumerate() {
                // SAFETY: as above.
                dispatch_lanes!(self.level, simd => unsafe {
                    inverse_plane(simd, self, x, sum, own, &mut plane)
                });
            }
        }
        times.inverse += began.elapsed().as_secs_f64();
        times
    }
}
