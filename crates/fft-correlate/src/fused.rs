//! Windowed correlation with lane-batched transforms, in three stages that each visit their data
//! once:
//!
//! 1. per x plane of the moving box: z transforms of bundles of y rows, a transposition of small
//!    blocks from lanes of y to lanes of kz, y transforms;
//! 2. per column of x lines: x transforms of every term, products with the fixed spectra, one x
//!    transform back;
//! 3. per wanted x plane: y transforms, blocks back to lanes of y, z transforms to real values.
//!
//! Only real parts are computed: `Re(A B) = Ar Br - Ai Bi`, two real transforms going in, and one
//! coming out of the sum of all products. Along z the period is `nz` but the frequencies are
//! `2 k + 1/2`: the sum over z of `b(z) e^{2 pi i z (2 k + 1/2) / nz}` is a complex transform of
//! `nz / 2` points of `(b(z) + i b(z + nz / 2)) e^{pi i z / nz}`, and those `nz / 2` values hold all
//! there is to know of a real line. No frequency is its own conjugate, so there is no zero and no
//! Nyquist frequency to treat apart and no half spectrum to split. What wraps around along z
//! returns with the opposite sign; nothing that wraps around is ever wanted.
//!
//! Lines that are zero going in are skipped, and so are those unwanted coming out.

use std::f64::consts::PI;
use std::ops::Range;
use std::time::Instant;

use fearless_simd::Level;
use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use ndarray::{ArrayViewMut2, ArrayViewMut3, Axis};

use crate::fft3::negative_spectra;
use crate::lane_fft::{LaneFft, radices, transform};
use crate::lanes::{Buffer, Strided, Tile, dispatch_lanes, transpose};
use crate::radix::{inlined, mul};
use crate::real::Real;
use crate::spectral::{FixedTerm, MovingRows, StageTimes};

/// Numbers by which rows are apart beyond their length, so that equal places of many rows do not
/// fall into the same few cache sets.
const PAD: usize = 16;

/// Numbers that neighbouring y share in one visit of a plane: 1 KiB of f32.
const CHUNK: usize = 256;

/// Transforms, sizes and fixed spectra; see the module.
pub(crate) struct Fused<T> {
    level: Level,
    size: [usize; 3],
    window: [usize; 3],
    layout: Layout,
    /// Numbers of one resampled bundle.
    bundle: usize,
    terms: Vec<Term<T>>,
    x: LaneFft<T>,
    y: LaneFft<T>,
    /// `nz / 2` points.
    z: LaneFft<T>,
    /// Cosine and sine of `pi z / nz`.
    twist: Vec<[T; 2]>,
}

struct Term<T> {
    /// Per kz block, y and x: real and imaginary lanes of the spectrum of the real part, then of
    /// the imaginary part with its sign changed.
    spectrum: Buffer<T>,
    moving_shape: [usize; 3],
}

/// Where things lie. Half spectra of one term are `[kz block][part][y chunk][x][y in chunk]`, each
/// element real and imaginary lanes of kz.
#[derive(Debug, Clone, Copy)]
struct Layout {
    lanes: usize,
    /// Points of the complex z transforms, and blocks of lanes of kz.
    half: usize,
    blocks: usize,
    /// y in one chunk, a power of two as its binary logarithm; and chunks.
    chunk_bits: u32,
    chunks: usize,
    /// From x to x within a chunk.
    x_stride: usize,
    /// From bundle to bundle of y rows in a transformed plane.
    row: usize,
}

impl Layout {
    fn new(size: [usize; 3], lanes: usize) -> Self {
        let half = size[2] / 2;
        let blocks = half.div_ceil(lanes);
        let chunk_bits = (CHUNK / (2 * lanes)).ilog2();
        Self {
            lanes,
            half,
            blocks,
            chunk_bits,
            chunks: size[1].div_ceil(1 << chunk_bits),
            x_stride: CHUNK + PAD,
            row: blocks * lanes * 2 * lanes + PAD,
        }
    }

    /// Numbers of the half spectra of a term with this many x planes.
    fn spectra(&self, planes: usize) -> usize {
        self.blocks * 2 * self.chunks * self.chunk(planes)
    }

    /// From bundle to bundle of y rows in a resampled plane.
    fn bundle(&self, moving_shapes: &[[usize; 3]]) -> usize {
        let longest = moving_shapes.iter().map(|s| s[2]).max().unwrap_or(0);
        (longest * 2 * self.lanes + PAD).next_multiple_of(PAD)
    }

    fn chunk(&self, planes: usize) -> usize {
        planes * self.x_stride
    }

    /// Offset of the element at x = 0 in a column.
    fn column(&self, planes: usize, block: usize, part: usize, y: usize) -> usize {
        let chunk = (block * 2 + part) * self.chunks + (y >> self.chunk_bits);
        chunk * self.chunk(planes) + (y & ((1 << self.chunk_bits) - 1)) * 2 * self.lanes
    }

    /// Bundles that hold `rows` rows.
    fn bundles(&self, rows: usize) -> usize {
        rows.div_ceil(self.lanes)
    }
}

/// Working memory of one thread.
pub(crate) struct FusedScratch<T> {
    own: PlaneScratch<T>,
    spectra: Vec<Buffer<T>>,
}

/// Memory for one plane or column.
struct PlaneScratch<T> {
    /// Resampled bundles of one moving plane, and the z ranges they fill.
    bundles: Buffer<T>,
    filled: Vec<Range<usize>>,
    /// One plane between its z and its y transforms.
    plane: Buffer<T>,
    tiles: [Buffer<T>; 4],
}

/// The half spectra of one term under the present rotation.
#[derive(Debug, Clone)]
pub(crate) struct Spectra<T> {
    pub(crate) tile: Tile<T>,
    /// x planes that there is room for, and those that are not zero.
    pub(crate) planes: usize,
    pub(crate) filled: Range<usize>,
}

/// The largest number of terms of one sum.
const MAX_TERMS: usize = 2;

impl<T: Real> Fused<T> {
    /// Whether the kernels have all factors of this size.
    pub(crate) fn knows(size: [usize; 3]) -> bool {
        let [x, y, z] = size;
        z.is_multiple_of(2) && [x, y, z / 2].iter().all(|n| radices(*n).is_some())
    }

    /// Bytes of the fixed spectra and of one thread's scratch.
    pub(crate) fn memory(
        level: Level,
        size: [usize; 3],
        window: [usize; 3],
        moving_shapes: &[[usize; 3]],
    ) -> (u64, u64) {
        let layout = Layout::new(size, lanes::<T>(level));
        let spectrum = spectrum_len(&layout, size) * moving_shapes.len();
        let spectra = moving_shapes.iter().enumerate();
        let planes = spectra.map(|(t, s)| layout.spectra(planes(t, *s, window)));
        let [bundles, _, plane, tile] = plane_scratch(&layout, size, moving_shapes);
        let scratch = planes.sum::<usize>() + bundles + plane + 4 * tile;
        let bytes = |numbers: usize| (numbers * size_of::<T>()) as u64;
        (bytes(spectrum), bytes(scratch))
    }

    /// Transforms the fixed fields, all of one shape that the kernels know.
    ///
    /// # Panics
    /// If the kernels lack a factor of the size.
    pub(crate) fn new(
        level: Level,
        size: [usize; 3],
        window: [usize; 3],
        terms: Vec<FixedTerm<T>>,
    ) -> Self {
        let layout = Layout::new(size, lanes::<T>(level));
        let fft = |len| LaneFft::new(len).expect("a size that `knows` accepted");
        let angle = |z: usize| PI * z as f64 / size[2] as f64;
        assert!(terms.len() <= MAX_TERMS, "at most two terms");
        let shapes: Vec<_> = terms.iter().map(|t| t.moving_shape).collect();
        let fused = Self {
            bundle: layout.bundle(&shapes),
            level,
            size,
            window,
            layout,
            terms: Vec::new(),
            x: fft(size[0]),
            y: fft(size[1]),
            z: fft(layout.half),
            twist: (0..layout.half)
                .map(|z| [angle(z).cos(), angle(z).sin()].map(T::nearest))
                .collect(),
        };
        let terms = terms.into_iter().map(|t| Term {
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
        let parts = negative_spectra(&term.field);
        let mut packed = Buffer::zeroed(spectrum_len(&self.layout, self.size));
        let to = packed.as_mut_slice();
        for (part, (spectrum, scale)) in parts.iter().zip([scale, -scale]).enumerate() {
            let scale = T::nearest(scale);
            for ((x, y, z), v) in spectrum.indexed_iter() {
                let element = ((z / lanes * ny + y) * nx + x) * 4 * lanes;
                let at = element + part * 2 * lanes + z % lanes;
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
        FusedScratch {
            own: PlaneScratch {
                bundles: Buffer::zeroed(bundles),
                filled: vec![0..0; filled],
                plane: Buffer::zeroed(plane),
                tiles: std::array::from_fn(|_| Buffer::zeroed(tile)),
            },
            spectra: self
                .terms
                .iter()
                .enumerate()
                .map(|t| Buffer::zeroed(self.layout.spectra(planes(t))))
                .collect(),
        }
    }

    /// The y line at `x` in the half spectra.
    ///
    /// # Safety
    /// `x` must be one of the planes.
    #[inline(always)]
    unsafe fn y_line(&self, of: &Spectra<T>, block: usize, part: usize, x: usize) -> Strided<T> {
        let l = &self.layout;
        let at = l.column(of.planes, block, part, 0) + x * l.x_stride;
        Strided {
            // SAFETY: as demanded.
            tile: unsafe { of.tile.from(at) },
            range: 0..self.size[1],
            bits: l.chunk_bits,
            far: l.chunk(of.planes),
            near: 2 * l.lanes,
        }
    }

    /// The x line at `y` in the half spectra.
    ///
    /// # Safety
    /// The range must lie within the planes.
    #[inline(always)]
    unsafe fn x_line(
        &self,
        of: &Spectra<T>,
        block: usize,
        part: usize,
        y: usize,
        range: Range<usize>,
    ) -> Strided<T> {
        let l = &self.layout;
        let at = l.column(of.planes, block, part, y) + range.start * l.x_stride;
        // SAFETY: as demanded.
        Strided::even(unsafe { of.tile.from(at) }, range, l.x_stride)
    }

    /// Writes `f` at every window index to `out`, whose shape is the window's.
    pub(crate) fn correlate<M: MovingRows<T>>(
        &self,
        moving: &[M],
        scratch: &mut FusedScratch<T>,
        out: &mut ArrayViewMut3<T>,
    ) -> StageTimes {
        assert_eq!(moving.len(), self.terms.len());
        assert_eq!(out.shape(), self.window);
        let mut times = StageTimes::default();
        if moving.iter().all(|m| m.bounds()[0].is_empty()) {
            out.fill(T::zero());
            return times;
        }
        let FusedScratch { own, spectra } = scratch;
        let views: [Spectra<T>; MAX_TERMS] = std::array::from_fn(|t| {
            let t = t.min(moving.len() - 1);
            Spectra {
                tile: spectra[t].tile(),
                planes: planes(t, self.terms[t].moving_shape, self.window),
                filled: moving[t].bounds()[0].clone(),
            }
        });
        let views = &views[..moving.len()];
        for (field, to) in moving.iter().zip(views) {
            for x in to.filled.clone() {
                let began = Instant::now();
                dispatch_lanes!(self.level, simd => resample_plane(simd, self, field, x, own));
                let sampled = Instant::now();
                let rows = field.bounds()[1].clone();
                // SAFETY: the spectra are borrowed, and only this call uses them.
                dispatch_lanes!(self.level, simd => unsafe {
                    forward_plane(simd, self, x, rows, to, own)
                });
                times.resample += (sampled - began).as_secs_f64();
                times.forward += sampled.elapsed().as_secs_f64();
            }
        }
        let began = Instant::now();
        for block in 0..self.layout.blocks {
            // SAFETY: as above.
            dispatch_lanes!(self.level, simd => unsafe {
                multiply_columns(simd, self, block, 0..self.size[1], views, own)
            });
        }
        let multiplied = Instant::now();
        for (x, mut plane) in out.axis_iter_mut(Axis(0)).enumerate() {
            // SAFETY: as above.
            dispatch_lanes!(self.level, simd => unsafe {
                inverse_plane(simd, self, x, &views[0], own, &mut plane)
            });
        }
        times.product = (multiplied - began).as_secs_f64();
        times.inverse = multiplied.elapsed().as_secs_f64();
        times
    }
}

/// x planes of a term's half spectra: the first term's also take the sum of all.
fn planes(term: usize, moving_shape: [usize; 3], window: [usize; 3]) -> usize {
    if term == 0 {
        moving_shape[0].max(window[0])
    } else {
        moving_shape[0]
    }
}

fn spectrum_len(layout: &Layout, [nx, ny, _]: [usize; 3]) -> usize {
    layout.blocks * ny * nx * 4 * layout.lanes
}

/// Numbers in the bundles of a moving plane, bundles, numbers in a plane between its transforms,
/// numbers in a tile.
fn plane_scratch(layout: &Layout, size: [usize; 3], moving_shapes: &[[usize; 3]]) -> [usize; 4] {
    let bundles = layout.bundles(size[1]);
    let longest = size[0].max(size[1]).max(layout.half);
    [
        bundles * layout.bundle(moving_shapes),
        bundles,
        2 * bundles * layout.row,
        (longest + layout.lanes) * 2 * layout.lanes,
    ]
}

/// Lanes of this machine's vectors of `T`.
pub(crate) fn lanes<T: Real>(level: Level) -> usize {
    dispatch_lanes!(level, simd => lanes_of::<_, T>(simd))
}

#[inline(always)]
fn lanes_of<S: Simd, T: Real>(_: S) -> usize {
    T::Native::<S>::LEN
}

/// Samples one x plane of a moving field.
#[simd]
fn resample_plane<S: Simd, T: Real, M: MovingRows<T>>(
    simd: S,
    f: &Fused<T>,
    field: &M,
    x: usize,
    own: &mut PlaneScratch<T>,
) {
    let rows = field.bounds()[1].clone();
    let bundles = own.bundles.as_mut_slice().chunks_exact_mut(f.bundle);
    for ((b, bundle), filled) in bundles.enumerate().zip(&mut own.filled) {
        let y = rows.start + b * f.layout.lanes;
        if y >= rows.end {
            break;
        }
        *filled = field.fill_lanes(simd, x, y, bundle);
    }
}

/// Stage 1: one x plane of a moving field, y rows `rows`, to its half spectra over y and z.
///
/// # Safety
/// No one else may use plane `x` of the spectra.
#[simd]
unsafe fn forward_plane<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    x: usize,
    rows: Range<usize>,
    to: &Spectra<T>,
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let (plane, bundles) = (own.plane.tile(), own.bundles.tile());
    let [a, b, lines, _] = &mut own.tiles;
    let (a, b, lines) = (a.tile(), b.tile(), lines.tile());
    let count = l.bundles(rows.len());
    // SAFETY (of all memory accesses below): offsets stay within what `scratch` laid out for this
    // size, and the scratch is borrowed; plane x of the spectra is the caller's promise.
    for bundle in 0..count {
        // SAFETY: as said above.
        let from = unsafe { bundles.from(bundle * f.bundle) };
        for part in 0..2 {
            // SAFETY: as said above.
            let to = unsafe { plane.from((2 * bundle + part) * l.row) };
            // SAFETY: as said above.
            unsafe { z_forward(simd, f, from, part, own.filled[bundle].clone(), to, [a, b]) };
        }
    }
    for block in 0..l.blocks {
        for part in 0..2 {
            for bundle in 0..count {
                let offset = (2 * bundle + part) * l.row + block * l.lanes * 2 * l.lanes;
                // SAFETY: as said above.
                unsafe {
                    let from = plane.from(offset);
                    transpose_block(simd, from, lines.from(bundle * l.lanes * 2 * l.lanes));
                }
            }
            // SAFETY: as said above.
            unsafe {
                let from = Strided::even(lines, rows.clone(), 2 * l.lanes);
                transform(simd, &f.y, [a, b], &from, &f.y_line(to, block, part, x));
            }
        }
    }
}

/// The half spectra of one part (0 real, 1 imaginary) of a bundle of lines that is zero outside
/// `filled`, written as a bundle.
///
/// # Safety
/// The bundle must hold the filled elements, `to` half the period, the tiles whatever `f` asks for;
/// no one else may use them.
#[inline(always)]
unsafe fn z_forward<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    from: Tile<T>,
    part: usize,
    filled: Range<usize>,
    to: Tile<T>,
    tiles: [Tile<T>; 2],
) {
    let half = f.layout.half;
    let lanes = f.layout.lanes;
    let zero = T::Native::<S>::splat(simd, T::zero());
    let store = inlined(
        #[inline(always)]
        // SAFETY: as said above.
        |k: usize, v| unsafe { to.put(simd, k, v) },
    );
    if filled.is_empty() {
        for k in 0..half {
            store(k, [zero; 2]);
        }
        return;
    }
    let read = inlined(
        #[inline(always)]
        |z: usize| {
            if filled.contains(&z) {
                // SAFETY: as said above.
                unsafe { from.load(simd, (2 * z + part) * lanes) }
            } else {
                zero
            }
        },
    );
    let twist = inlined(
        #[inline(always)]
        |z: usize| {
            let [cos, sin] = f.twist[z];
            [
                T::Native::<S>::splat(simd, cos),
                T::Native::<S>::splat(simd, sin),
            ]
        },
    );
    // SAFETY: as demanded.
    unsafe {
        let load = inlined(
            #[inline(always)]
            |z: usize| mul([read(z), read(z + half)], twist(z)),
        );
        f.z.process(simd, tiles, load, store);
    }
}

/// One block of elements, lanes of which become elements and the other way round.
///
/// # Safety
/// Both must hold as many elements as there are lanes; no one else may use them.
#[inline(always)]
unsafe fn transpose_block<S: Simd, T: Real>(simd: S, from: Tile<T>, to: Tile<T>) {
    let lanes = T::Native::<S>::LEN;
    // SAFETY: as demanded.
    unsafe {
        transpose(simd, from, 2 * lanes, to, 2 * lanes);
        transpose(simd, from.from(lanes), 2 * lanes, to.from(lanes), 2 * lanes);
    }
}

/// Stage 2: the x lines of one kz block and of the y in `rows`, for all terms; the sum's lines
/// replace those of the first term's real part.
///
/// # Safety
/// No one else may use these columns of the spectra.
#[simd]
unsafe fn multiply_columns<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    rows: Range<usize>,
    spectra: &[Spectra<T>],
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let [nx, ny, _] = f.size;
    let [work, re, im, sum] = &mut own.tiles;
    let (work, re, im) = (work.tile(), re.tile(), im.tile());
    let sum = if spectra.len() == 1 { re } else { sum.tile() };
    let zero = [T::Native::<S>::splat(simd, T::zero()); 2];
    for y in rows {
        // SAFETY (of all memory accesses below): as in `forward_plane`; spectra of fixed fields
        // hold four vectors for every x, y and block.
        let mut first = true;
        for (term, moving) in f.terms.iter().zip(spectra) {
            if moving.filled.is_empty() {
                continue;
            }
            for (part, to) in [re, im].into_iter().enumerate() {
                // SAFETY: as said above.
                unsafe {
                    let from = f.x_line(moving, block, part, y, moving.filled.clone());
                    let to = Strided::even(to, 0..nx, 2 * l.lanes);
                    transform(simd, &f.x, f.x.tiles_to(to.tile, work), &from, &to);
                }
            }
            let fixed = &term.spectrum.as_slice()[(block * ny + y) * nx * 4 * l.lanes..];
            for (k, a) in fixed
                .chunks_exact(4 * T::Native::<S>::LEN)
                .take(nx)
                .enumerate()
            {
                let vector = inlined(
                    #[inline(always)]
                    |i: usize| T::Native::<S>::from_slice(simd, &a[i * l.lanes..][..l.lanes]),
                );
                // SAFETY: as said above.
                let (br, bi) = unsafe { (re.get(simd, k), im.get(simd, k)) };
                let start = if first {
                    zero
                } else {
                    // SAFETY: as said above.
                    unsafe { sum.get(simd, k) }
                };
                let v = add_mul(start, [vector(0), vector(1)], br);
                let v = add_mul(v, [vector(2), vector(3)], bi);
                // SAFETY: as said above.
                unsafe { sum.put(simd, k, v) };
            }
            first = false;
        }
        // SAFETY: as said above.
        unsafe {
            let from = Strided::even(sum, 0..nx, 2 * l.lanes);
            let to = f.x_line(&spectra[0], block, 0, y, 0..f.window[0]);
            transform(simd, &f.x, [sum, work], &from, &to);
        }
    }
}

/// Stage 3: one x plane of the sum to real values.
///
/// # Safety
/// No one else may write to the plane.
#[simd]
unsafe fn inverse_plane<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    x: usize,
    sum: &Spectra<T>,
    own: &mut PlaneScratch<T>,
    out: &mut ArrayViewMut2<'_, T>,
) {
    let l = f.layout;
    let plane = own.plane.tile();
    let [a, b, lines, real] = &mut own.tiles;
    let (a, b, lines, real) = (a.tile(), b.tile(), lines.tile(), real.tile());
    let [_, wy, wz] = f.window;
    let count = l.bundles(wy);
    // SAFETY (of all memory accesses below): as in `forward_plane`.
    for block in 0..l.blocks {
        // SAFETY: as said above.
        unsafe {
            let to = Strided::even(lines, 0..wy, 2 * l.lanes);
            transform(simd, &f.y, [a, b], &f.y_line(sum, block, 0, x), &to);
        }
        for bundle in 0..count {
            let offset = 2 * bundle * l.row + block * l.lanes * 2 * l.lanes;
            // SAFETY: as said above.
            unsafe {
                let from = lines.from(bundle * l.lanes * 2 * l.lanes);
                transpose_block(simd, from, plane.from(offset));
            }
        }
    }
    let row = wz.next_multiple_of(l.lanes);
    for bundle in 0..count {
        // SAFETY: as said above.
        unsafe {
            let from = plane.from(2 * bundle * l.row);
            z_inverse(simd, f, from, lines, [a, b]);
            for z in (0..wz).step_by(l.lanes) {
                transpose(simd, lines.from(z * l.lanes), l.lanes, real.from(z), row);
            }
        }
        for lane in 0..l.lanes.min(wy - bundle * l.lanes) {
            // SAFETY: as said above.
            let values = unsafe { real.slice(lane * row, wz) };
            let to = out.row_mut(bundle * l.lanes + lane);
            to.into_iter().zip(values).for_each(|(to, v)| *to = *v);
        }
    }
}

/// The real lines of a bundle of half spectra: one vector per wanted z.
///
/// # Safety
/// As [`z_forward`].
#[inline(always)]
unsafe fn z_inverse<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    from: Tile<T>,
    to: Tile<T>,
    tiles: [Tile<T>; 2],
) {
    let (half, wanted, lanes) = (f.layout.half, f.window[2], f.layout.lanes);
    let load = inlined(
        #[inline(always)]
        // SAFETY: as said above.
        |k: usize| unsafe { from.get(simd, k) },
    );
    let store = inlined(
        #[inline(always)]
        |z: usize, [re, im]: [T::Native<S>; 2]| {
            if z < wanted {
                let [cos, sin] = f.twist[z];
                let (cos, sin) = (
                    T::Native::<S>::splat(simd, cos),
                    T::Native::<S>::splat(simd, sin),
                );
                // SAFETY: as demanded.
                unsafe { to.store::<S>(z * lanes, re.mul_sub(cos, im * sin)) };
                if z + half < wanted {
                    // SAFETY: as demanded.
                    unsafe { to.store::<S>((z + half) * lanes, -re.mul_add(sin, im * cos)) };
                }
            }
        },
    );
    // SAFETY: as demanded.
    unsafe { f.z.process(simd, tiles, load, store) };
}

/// `sum + a b`.
#[inline(always)]
fn add_mul<S: Simd, V: SimdFloat<S>>(sum: [V; 2], a: [V; 2], b: [V; 2]) -> [V; 2] {
    let re = a[0].mul_add(b[0], sum[0]);
    let im = a[0].mul_add(b[1], sum[1]);
    [a[1].mul_add(-b[1], re), a[1].mul_add(b[0], im)]
}
