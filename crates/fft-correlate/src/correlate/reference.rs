//! Windowed correlation line by line with rustfft and realfft: any size, and the measure of
//! [`crate::fused`]. Only real parts are computed: with half spectra of the real and imaginary
//! parts, `F = Ar conj(Br) - Ai conj(Bi)`, and transforming `B` with the positive exponent gives
//! the conjugates at once. All terms are summed before one inverse transform. Three stages:
//!
//! 1. per x plane of the moving box: z lines (one complex transform carries the real and the
//!    imaginary part, then splits into two half spectra), then y columns;
//! 2. per (y, z) column: x transforms of every term, products, one x inverse;
//! 3. per wanted x plane: y inverse, then z lines from half spectra to real values.

use std::ops::Range;

use std::time::Instant;

use ndarray::{Array3, ArrayViewMut3};
use num_complex::Complex;

use crate::fft3::{Lines, RealLines, transform_negative};
use crate::real::Real;
use crate::spectral::{FixedTerm, Memory, MovingRows, StageTimes};

/// Columns that are transformed together: eight complex f32 fill one cache line.
const TILE: usize = 8;

/// Transforms, sizes and the spectra of the fixed fields.
pub(crate) struct Reference<T: Real> {
    size: [usize; 3],
    window: [usize; 3],
    /// Half-spectrum length along z, and the same rounded up to whole tiles.
    half: usize,
    half_padded: usize,
    row: usize,
    plane: usize,
    terms: Vec<Term<T>>,
    x: Lines<T>,
    y: Lines<T>,
    z: Lines<T>,
    z_real: RealLines<T>,
}

struct Term<T> {
    /// Per y, tile, part (real, imaginary) and column: one x line.
    spectrum: Vec<Complex<T>>,
    moving_shape: [usize; 3],
}

/// Working memory of one thread.
pub(crate) struct ReferenceScratch<T> {
    line: Vec<Complex<T>>,
    real_line: Vec<T>,
    plane: Vec<Complex<T>>,
    tiles: [Vec<Complex<T>>; 3],
    fft: Vec<Complex<T>>,
    /// Per term: `[x][y][real half, imaginary half]`; the first also takes the result of stage 2.
    spectra: Vec<Vec<Complex<T>>>,
}

/// Layout numbers that follow from the transform size.
struct Layout {
    half: usize,
    half_padded: usize,
    row: usize,
    plane: usize,
}

impl Layout {
    fn new(size: [usize; 3]) -> Self {
        let half = size[2] / 2 + 1;
        let half_padded = half.next_multiple_of(TILE);
        // Power-of-two strides would map a column onto few cache sets.
        let row = 2 * half_padded + TILE;
        Self {
            half,
            half_padded,
            row,
            plane: size[1] * row + 3 * TILE,
        }
    }
}

impl<T: Real> Reference<T> {
    /// Bytes of the fixed spectra and of one thread's scratch for these sizes.
    pub(crate) fn memory(
        size: [usize; 3],
        window: [usize; 3],
        moving_shapes: &[[usize; 3]],
    ) -> Memory {
        let l = Layout::new(size);
        let complex = size_of::<Complex<T>>() as u64;
        let spectrum = (2 * l.half_padded) as u64 * size[0] as u64 * size[1] as u64;
        let planes: u64 = moving_shapes
            .iter()
            .enumerate()
            .map(|(t, s)| if t == 0 { s[0].max(window[0]) } else { s[0] } as u64)
            .sum();
        Memory {
            spectra: complex * spectrum * moving_shapes.len() as u64,
            scratch: complex * (planes + 1) * l.plane as u64,
            half_turns: 0,
        }
    }

    /// Transforms the fixed fields, all of one shape, for a window of this shape.
    pub(crate) fn new(size: [usize; 3], window: [usize; 3], terms: Vec<FixedTerm<T>>) -> Self {
        let Layout {
            half,
            half_padded,
            row,
            plane,
        } = Layout::new(size);
        Self {
            size,
            window,
            half,
            half_padded,
            row,
            plane,
            terms: terms
                .into_iter()
                .map(|t| Term {
                    moving_shape: t.moving_shape,
                    spectrum: packed_half_spectra(t.field, half_padded),
                })
                .collect(),
            x: Lines::new(size[0]),
            y: Lines::new(size[1]),
            z: Lines::new(size[2]),
            z_real: RealLines::new(size[2]),
        }
    }

    pub(crate) fn scratch(&self) -> ReferenceScratch<T> {
        let zero = Complex::default();
        let longest = self.size[0].max(self.size[1]);
        let fft = [&self.x, &self.y, &self.z]
            .iter()
            .map(|l| l.scratch_len())
            .chain([self.z_real.scratch_len()])
            .max()
            .unwrap_or(0);
        let planes = |(t, term): (usize, &Term<T>)| {
            let own = term.moving_shape[0];
            if t == 0 { own.max(self.window[0]) } else { own }
        };
        ReferenceScratch {
            line: vec![zero; self.size[2]],
            real_line: vec![T::zero(); self.size[2]],
            plane: vec![zero; self.plane],
            tiles: std::array::from_fn(|_| vec![zero; TILE * longest]),
            fft: vec![zero; fft],
            spectra: self
                .terms
                .iter()
                .enumerate()
                .map(|t| vec![zero; planes(t) * self.plane])
                .collect(),
        }
    }

    /// Writes `f` at every window index to `out`, whose shape is the window's.
    pub(crate) fn correlate<M: MovingRows<T>>(
        &self,
        moving: &[M],
        scratch: &mut ReferenceScratch<T>,
        out: &mut ArrayViewMut3<T>,
    ) -> StageTimes {
        let began = Instant::now();
        assert_eq!(moving.len(), self.terms.len());
        assert_eq!(out.shape(), self.window);
        for (t, rows) in moving.iter().enumerate() {
            let bounds = rows.bounds();
            for x in bounds[0].clone() {
                self.forward_plane(t, rows, x, &bounds, scratch);
            }
        }
        if moving.iter().all(|m| m.bounds()[0].is_empty()) {
            out.fill(T::zero());
            return StageTimes::default();
        }
        let transformed = Instant::now();
        for y in 0..self.size[1] {
            for tile in 0..self.half.div_ceil(TILE) {
                self.multiply_columns(y, tile, moving, scratch);
            }
        }
        let multiplied = Instant::now();
        for x in 0..self.window[0] {
            self.inverse_plane(x, scratch, out);
        }
        StageTimes {
            resample: 0.0,
            forward: (transformed - began).as_secs_f64(),
            product: (multiplied - transformed).as_secs_f64(),
            inverse: multiplied.elapsed().as_secs_f64(),
        }
    }

    /// Stage 1: one x plane of one moving field to its half spectra over y and z.
    fn forward_plane<M: MovingRows<T>>(
        &self,
        term: usize,
        rows: &M,
        x: usize,
        bounds: &[Range<usize>; 3],
        scratch: &mut ReferenceScratch<T>,
    ) {
        let (zero, half) = (Complex::default(), T::nearest(0.5));
        let (ny, nz) = (self.size[1], self.size[2]);
        for y in bounds[1].clone() {
            let packed = &mut scratch.plane[y * self.row..][..2 * self.half_padded];
            scratch.line.fill(zero);
            if !rows.fill(x, y, &mut scratch.line) {
                packed.fill(zero);
                continue;
            }
            self.z.process(&mut scratch.line, &mut scratch.fft);
            let (re, im) = packed.split_at_mut(self.half_padded);
            for k in 0..self.half {
                let (a, b) = (scratch.line[k], scratch.line[(nz - k) % nz].conj());
                re[k] = (a + b) * half;
                // (a - b) / 2i
                im[k] = Complex::new(a.im - b.im, b.re - a.re) * half;
            }
        }
        let tile = &mut scratch.tiles[0][..TILE * ny];
        let to = &mut scratch.spectra[term][x * self.plane..][..self.plane];
        for part in 0..2 {
            for first in (0..self.half).step_by(TILE) {
                let column = part * self.half_padded + first;
                gather(&scratch.plane, column, self.row, bounds[1].clone(), tile);
                self.y.process(tile, &mut scratch.fft);
                scatter(tile, 0..ny, to, column, self.row);
            }
        }
    }

    /// Stage 2: the x lines of one tile of columns.
    fn multiply_columns<M: MovingRows<T>>(
        &self,
        y: usize,
        tile: usize,
        moving: &[M],
        scratch: &mut ReferenceScratch<T>,
    ) {
        let nx = self.size[0];
        let len = TILE * nx;
        let column = y * self.row + tile * TILE;
        let [re, im, sum] = &mut scratch.tiles;
        let (re, im, sum) = (&mut re[..len], &mut im[..len], &mut sum[..len]);
        sum.fill(Complex::default());
        for ((term, field), moving) in self.terms.iter().zip(moving).zip(&scratch.spectra) {
            let range = field.bounds()[0].clone();
            if range.is_empty() {
                continue;
            }
            gather(moving, column, self.plane, range.clone(), re);
            gather(
                moving,
                column + self.half_padded,
                self.plane,
                range.clone(),
                im,
            );
            self.x.process(re, &mut scratch.fft);
            self.x.process(im, &mut scratch.fft);
            let at = (y * self.half_padded / TILE + tile) * 2 * len;
            let (ar, ai) = term.spectrum[at..at + 2 * len].split_at(len);
            for k in 0..len {
                sum[k] += ar[k] * re[k] - ai[k] * im[k];
            }
        }
        self.x.process(sum, &mut scratch.fft);
        scatter(
            sum,
            0..self.window[0],
            &mut scratch.spectra[0],
            column,
            self.plane,
        );
    }

    /// Stage 3: one x plane of the summed half spectrum to real values.
    fn inverse_plane(
        &self,
        x: usize,
        scratch: &mut ReferenceScratch<T>,
        out: &mut ArrayViewMut3<T>,
    ) {
        let ny = self.size[1];
        let from = &scratch.spectra[0][x * self.plane..][..self.plane];
        let tile = &mut scratch.tiles[0][..TILE * ny];
        for column in (0..self.half).step_by(TILE) {
            gather(from, column, self.row, 0..ny, tile);
            self.y.process(tile, &mut scratch.fft);
            scatter(
                tile,
                0..self.window[1],
                &mut scratch.plane,
                column,
                self.row,
            );
        }
        for y in 0..self.window[1] {
            let half = &mut scratch.plane[y * self.row..][..self.half];
            let line = &mut scratch.real_line;
            self.z_real.process(half, line, &mut scratch.fft);
            for (z, value) in line[..self.window[2]].iter().enumerate() {
                out[[x, y, z]] = *value;
            }
        }
    }
}

/// Copies rows `range` of the `TILE` columns that begin at `column` into lines, zero elsewhere.
fn gather<T: Real>(
    from: &[Complex<T>],
    column: usize,
    stride: usize,
    range: Range<usize>,
    lines: &mut [Complex<T>],
) {
    let len = lines.len() / TILE;
    for line in lines.chunks_exact_mut(len) {
        line[..range.start].fill(Complex::default());
        line[range.end..].fill(Complex::default());
    }
    for r in range {
        let row = &from[column + r * stride..][..TILE];
        for (b, value) in row.iter().enumerate() {
            lines[b * len + r] = *value;
        }
    }
}

/// Copies entries `range` of the `TILE` lines into rows `range` of the columns from `column` on.
fn scatter<T: Real>(
    lines: &[Complex<T>],
    range: Range<usize>,
    to: &mut [Complex<T>],
    column: usize,
    stride: usize,
) {
    let len = lines.len() / TILE;
    for r in range {
        let row = &mut to[column + r * stride..][..TILE];
        for (b, value) in row.iter_mut().enumerate() {
            *value = lines[b * len + r];
        }
    }
}

/// The half spectra of a field's real and imaginary parts, divided by the number of points, in the
/// order stage 2 reads them: `[y][tile][part][column][x]`.
fn packed_half_spectra<T: Real>(
    mut field: Array3<Complex<T>>,
    half_padded: usize,
) -> Vec<Complex<T>> {
    let (nx, ny, nz) = field.dim();
    transform_negative(&mut field);
    let scale = T::nearest(0.5 / (nx * ny * nz) as f64);
    let mut packed = vec![Complex::default(); 2 * half_padded * nx * ny];
    for x in 0..nx {
        for y in 0..ny {
            for z in 0..=nz / 2 {
                let a = field[[x, y, z]];
                let b = field[[(nx - x) % nx, (ny - y) % ny, (nz - z) % nz]].conj();
                let re = (a + b) * scale;
                let im = Complex::new(a.im - b.im, b.re - a.re) * scale;
                let block = (y * half_padded + z) / TILE * 2 * TILE * nx;
                let at = block + z % TILE * nx + x;
                packed[at] = re;
                packed[at + TILE * nx] = im;
            }
        }
    }
    packed
}
