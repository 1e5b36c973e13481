//! Transforms, sizes and fixed spectra of one correlation, and the working memory of one thread.
//!
//! The fixed spectra are made once, without normalization. "Negative" means the kernel
//! `e^{-2 pi i k x / n}`.

use std::f64::consts::PI;
use std::ops::Range;

use fearless_simd::Level;
use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use ndarray::{Array3, ArrayViewMut1, Axis};
use num_complex::Complex;

use crate::correlate::contract::{Memory, MovingRows, Sizes};
use crate::correlate::kernels::image::{Image, ImageSizes};
use crate::correlate::kernels::lane_fft::{LaneFft, LineEnds, transform};
use crate::correlate::kernels::layout::{Layout, MAX_TERMS, halves, lanes, planes};
use crate::correlate::kernels::tile::{Buffer, Line, Tile};
use crate::correlate::real::Real;
use crate::geometry::half_turn::HalfTurn;
use crate::vectors::dispatch_lanes;

/// Transforms, sizes and fixed spectra; see the documentation of the folder.
pub(crate) struct Fused<T> {
    pub(super) level: Level,
    pub(super) sizes: Sizes,
    pub(super) layout: Layout,
    /// Numbers of one resampled bundle, and the bundles that a plane has room for.
    pub(super) bundle: usize,
    pub(super) plane_bundles: usize,
    pub(super) terms: Vec<Term<T>>,
    /// Whether the fixed spectra are more than the second-level cache holds.
    pub(super) is_large: bool,
    /// Along x and y those of the moving fields; along z both ways, `nz / 2` points.
    pub(super) x: LaneFft<T>,
    pub(super) y: LaneFft<T>,
    pub(super) z: LaneFft<T>,
    /// Cosine and sine of `pi z / nz`.
    pub(super) twist: Vec<[T; 2]>,
    /// Where the elements of bundles begin whose elements follow each other.
    pub(super) places: Vec<usize>,
    /// The way back without a half turn, and, if they are provided for, with each of the others.
    pub(super) images: Vec<Image<T>>,
}

pub(super) struct Term<T> {
    /// Where the elements of the y lines of its half spectra begin.
    pub(super) y_places: Vec<usize>,
    /// Per kz block, y and x: real and imaginary lanes of the spectrum of the real part, then of
    /// the imaginary part with its sign changed.
    pub(super) spectrum: Buffer<T>,
    /// Whether nothing of its moving field lies beyond half of the period along z.
    pub(super) half_deep: bool,
}

/// Bytes of fixed spectra that still come fast enough by themselves.
const CACHED: u64 = 4 << 20;

impl<T: Real> Fused<T> {
    /// Bytes of the fixed spectra, of what making them takes, and of one thread's scratch.
    pub(crate) fn memory(level: Level, sizes: &Sizes) -> Memory {
        let layout = Layout::new(sizes, lanes::<T>(level));
        let spectra = |term| {
            let planes = planes(sizes, term);
            layout.lines(planes) + layout.block(planes)
        };
        let plane = layout.plane(sizes);
        let terms = sizes.moving.len();
        let mut scratch = (0..terms).map(spectra).sum::<usize>();
        scratch += plane.bundles * plane.bundle + plane.plane + (2 + 2 * MAX_TERMS) * plane.tile;
        if sizes.half_turns && terms > 0 {
            scratch += spectra(0);
        }
        let bytes = |numbers: usize| numbers as u64 * size_of::<T>() as u64;
        let points: usize = sizes.transform.iter().product();
        Memory {
            spectra: bytes(layout.spectrum(sizes.transform)) * terms as u64,
            // A fixed field, complex, and the half spectra of one of its parts.
            building: bytes(3 * points),
            scratch: bytes(scratch),
        }
    }

    /// Transforms the fixed fields, `A[i]` of each term at `i - i0` in the periodic box, where
    /// `i0` is the first moving index plus the first window index; scaled by everything the result
    /// is to be multiplied with. They are asked for one after the other.
    ///
    /// # Panics
    /// If the kernels lack a factor of the size.
    pub(crate) fn new(
        level: Level,
        sizes: Sizes,
        fixed: impl Fn(usize) -> Array3<Complex<T>>,
    ) -> Self {
        let size = sizes.transform;
        let fft = |len, ends| LaneFft::new(len, ends).expect("lengths of factors 2, 3 and 5");
        assert!(
            (1..=MAX_TERMS).contains(&sizes.moving.len()),
            "one or two terms"
        );
        let layout = Layout::new(&sizes, lanes::<T>(level));
        // Transforms along each axis; halves of the box that are zero save passes.
        let y = |from_half, to_half| {
            let ends = LineEnds {
                from_half,
                to_half,
                ..LineEnds::default()
            };
            fft(size[1], ends)
        };
        let (x_from_half, x_to_half) = halves(&sizes, 0);
        let (y_from_half, y_to_half) = halves(&sizes, 1);
        let pair = LaneFft::pair(size[0], x_from_half, x_to_half);
        let [x, x_back] = pair.expect("lengths of factors 2, 3 and 5");
        // The fixed spectra, in the order in which the products read them.
        let twist = twist(layout.half);
        let radix = x_back.first_radix();
        let images = images(&layout, &sizes, [x_back, y(false, y_to_half)], &twist);
        let terms = (0..sizes.moving.len()).map(|term| Term {
            y_places: layout.y_places(planes(&sizes, term), size[1]),
            spectrum: packed((level, &layout), size, radix, &fixed(term)),
            half_deep: sizes.moving[term][2] <= layout.half,
        });
        Self {
            terms: terms.collect(),
            images,
            bundle: layout.plane(&sizes).bundle,
            plane_bundles: layout.bundles(size[1]),
            is_large: Self::memory(level, &sizes).spectra > CACHED,
            x,
            y: y(y_from_half, false),
            z: fft(layout.half, LineEnds::default()),
            twist,
            places: (0..layout.line_elements.max(size[0]).max(size[1]))
                .map(|y| y * 2 * layout.lanes)
                .collect(),
            level,
            sizes,
            layout,
        }
    }
}

/// Cosine and sine of `pi z / nz` for z below `half`, half of `nz`.
fn twist<T: Real>(half: usize) -> Vec<[T; 2]> {
    let angle = |z: usize| PI * z as f64 / (2 * half) as f64;
    (0..half)
        .map(|z| [angle(z).cos(), angle(z).sin()].map(T::nearest))
        .collect()
}

/// The ways back; `back` transforms along x and y.
fn images<T: Real>(
    layout: &Layout,
    sizes: &Sizes,
    back: [LaneFft<T>; 2],
    twist: &[[T; 2]],
) -> Vec<Image<T>> {
    let of = ImageSizes {
        layout,
        size: sizes.transform,
        window: sizes.window,
        extent: sizes.moving[0],
        planes: planes(sizes, 0),
    };
    let turns = &HalfTurn::ALL[..if sizes.half_turns { 4 } else { 1 }];
    let image = |turn: &HalfTurn| Image::new(*turn, &of, back.clone(), twist);
    turns.iter().map(image).collect()
}

/// Both half spectra of a fixed field, divided by the number of points, as stage 2 reads them;
/// `radix` is that of its turning pass.
fn packed<T: Real>(
    (level, layout): (Level, &Layout),
    size: [usize; 3],
    radix: usize,
    field: &Array3<Complex<T>>,
) -> Buffer<T> {
    let [nx, ny, _] = size;
    let Layout { lanes, half, .. } = *layout;
    let scale = 1.0 / (nx * ny * half) as f64;
    let blocks = nx / radix;
    let mut packed = Buffer::zeroed(layout.spectrum(size));
    let to = packed.as_mut_slice();
    for (part, scale) in [scale, -scale].into_iter().enumerate() {
        let scale = T::nearest(scale);
        for ((x, y, z), v) in negative_spectrum(level, field, part).indexed_iter() {
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

/// Working memory of one thread.
pub(crate) struct FusedScratch<T> {
    /// What it was made for.
    pub(super) sizes: Sizes,
    pub(super) plane: PlaneScratch<T>,
    /// One for each term. The first sum replaces what is left of the first one.
    pub(super) terms: Vec<TermScratch<T>>,
    /// For the third and fourth half turn, if there are.
    pub(super) more: Option<SpectraScratch<T>>,
}

/// Memory for one plane or column.
pub(super) struct PlaneScratch<T> {
    /// Resampled bundles of some moving planes, and the z ranges they fill.
    pub(super) bundles: Buffer<T>,
    pub(super) filled: Vec<Range<usize>>,
    /// One plane between its z and its y transforms.
    pub(super) plane: Buffer<T>,
    /// Lines between the passes of their transforms.
    pub(super) work: [Buffer<T>; 2],
    /// Lines that wait for others: both parts of all terms; on the way back lines along z, and
    /// their transposition.
    pub(super) parts: [Buffer<T>; 2 * MAX_TERMS],
}

/// Memory of one term.
pub(super) struct TermScratch<T> {
    spectra: SpectraScratch<T>,
    /// Where the elements of its x lines begin under the present rotation.
    x_from: Vec<usize>,
}

/// Both parts of a term's spectra, or two sums.
pub(super) struct SpectraScratch<T> {
    /// Lines along y of all kz blocks.
    lines: Buffer<T>,
    /// The half spectra of one of them.
    block: Buffer<T>,
}

/// One term's memory under one rotation.
#[derive(Clone)]
pub(super) struct Spectra<'a, T> {
    pub(super) lines: Tile<'a, T>,
    pub(super) block: Tile<'a, T>,
    /// x planes that there is room for, and those that are not zero.
    pub(super) planes: usize,
    pub(super) filled: Range<usize>,
    pub(super) x_from: &'a [usize],
}

/// One sum on its way back.
#[derive(Clone, Copy)]
pub(super) struct Sum<'a, T> {
    pub(super) image: &'a Image<T>,
    /// Memory for two sums, of which it takes one part.
    pub(super) lines: Tile<'a, T>,
    pub(super) block: Tile<'a, T>,
    pub(super) part: usize,
    pub(super) planes: usize,
}

impl<T: Real> SpectraScratch<T> {
    fn new(layout: &Layout, planes: usize) -> Self {
        Self {
            lines: Buffer::zeroed(layout.lines(planes)),
            block: Buffer::zeroed(layout.block(planes)),
        }
    }
}

/// The spectra of each term, the memory for more sums if there is any, and that of one plane.
pub(super) type Views<'a, T> = (
    [Spectra<'a, T>; MAX_TERMS],
    Option<[Tile<'a, T>; 2]>,
    &'a mut PlaneScratch<T>,
);

impl<T: Real> FusedScratch<T> {
    pub(crate) fn new(f: &Fused<T>) -> Self {
        let plane = f.layout.plane(&f.sizes);
        let spectra = |term| SpectraScratch::new(&f.layout, planes(&f.sizes, term));
        let terms = (0..f.terms.len()).map(|term| TermScratch {
            spectra: spectra(term),
            x_from: vec![0; f.sizes.transform[0]],
        });
        Self {
            sizes: f.sizes.clone(),
            plane: PlaneScratch {
                bundles: Buffer::zeroed(plane.bundles * plane.bundle),
                filled: vec![0..0; plane.bundles],
                plane: Buffer::zeroed(plane.plane),
                work: std::array::from_fn(|_| Buffer::zeroed(plane.tile)),
                parts: std::array::from_fn(|_| Buffer::zeroed(plane.tile)),
            },
            terms: terms.collect(),
            more: f.sizes.half_turns.then(|| spectra(0)),
        }
    }

    /// Views of the terms' memory, filled by `moving`, of the memory for more sums, and the rest.
    pub(super) fn views<'a, M: MovingRows<T>>(
        &'a mut self,
        f: &Fused<T>,
        moving: &[M],
    ) -> Views<'a, T> {
        let terms = self.terms.iter_mut().zip(moving).enumerate();
        let mut terms = terms.map(|(term, (scratch, rows))| {
            let [filled, ..] = rows.bounds();
            let planes = planes(&f.sizes, term);
            for (x, place) in scratch.x_from.iter_mut().enumerate() {
                *place = f.layout.x_from(planes, &filled, x);
            }
            Spectra {
                lines: scratch.spectra.lines.tile(),
                block: scratch.spectra.block.tile(),
                planes,
                filled,
                x_from: &scratch.x_from,
            }
        });
        let first = terms.next().expect("a term");
        let second = terms.next().unwrap_or_else(|| first.clone());
        let more = self.more.as_mut();
        let more = more.map(|s| [s.lines.tile(), s.block.tile()]);
        ([first, second], more, &mut self.plane)
    }
}

/// The negative-exponent transform of a complex field, in place.
///
/// # Panics
/// If the kernels lack a factor of the size.
fn transform_negative<T: Real>(level: Level, field: &mut Array3<Complex<T>>) {
    for axis in 0..3 {
        dispatch_lanes!(level, simd => transform_axis(simd, field, Axis(axis)));
    }
}

/// Transforms as many lines at once as a vector has lanes. Conjugates before and after turn the
/// positive exponent of the kernels into the negative one.
#[simd]
fn transform_axis<S: Simd, T: Real>(simd: S, field: &mut Array3<Complex<T>>, axis: Axis) {
    let (len, lanes) = (field.len_of(axis), T::Native::<S>::LEN);
    let fft = LaneFft::new(len, LineEnds::default()).expect("lengths of factors 2, 3 and 5");
    let places: Vec<usize> = (0..len).map(|i| 2 * lanes * i).collect();
    let [mut bundle, mut a, mut b] = [(); 3].map(|()| Buffer::zeroed(2 * lanes * len));
    let mut rest = field.lanes_mut(axis).into_iter();
    loop {
        let mut lines: Vec<ArrayViewMut1<Complex<T>>> = rest.by_ref().take(lanes).collect();
        if lines.is_empty() {
            return;
        }
        let numbers = bundle.as_mut_slice();
        for (lane, line) in lines.iter().enumerate() {
            for (place, v) in places.iter().zip(line) {
                numbers[place + lane] = v.re;
                numbers[place + lanes + lane] = -v.im;
            }
        }
        let at = Line::new(bundle.tile(), 0, &places);
        transform(simd, &fft, [a.tile(), b.tile()], at, at, [0, 0]);
        let numbers = bundle.as_slice();
        for (lane, line) in lines.iter_mut().enumerate() {
            for (place, v) in places.iter().zip(line) {
                *v = Complex::new(numbers[place + lane], -numbers[place + lanes + lane]);
            }
        }
    }
}

/// The negative-exponent spectrum of a field's real (`part` 0) or imaginary (1) part, of even
/// length `nz` along z, at the frequencies `2 k + 1/2`, k below `nz / 2`, along z (see the folder's
/// page) and all whole ones along x and y.
fn negative_spectrum<T: Real>(
    level: Level,
    field: &Array3<Complex<T>>,
    part: usize,
) -> Array3<Complex<T>> {
    let (nx, ny, nz) = field.dim();
    let half = nz / 2;
    let twist: Vec<Complex<T>> = (0..half)
        .map(|z| -PI * z as f64 / nz as f64)
        .map(|angle| Complex::new(T::nearest(angle.cos()), T::nearest(angle.sin())))
        .collect();
    let value = |x, y, z| {
        let v: Complex<T> = field[[x, y, z]];
        if part == 0 { v.re } else { v.im }
    };
    let mut spectrum = Array3::from_shape_fn([nx, ny, half], |(x, y, z)| {
        Complex::new(value(x, y, z), -value(x, y, z + half)) * twist[z]
    });
    transform_negative(level, &mut spectrum);
    spectrum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vectors::levels;
    use num_complex::Complex32;

    /// A plane wave becomes one peak at its frequency.
    #[test]
    fn the_transform_has_the_negative_exponent_and_no_factor() {
        let shape = [3, 4, 5];
        let wave = [2usize, 1, 3];
        let field = Array3::from_shape_fn(shape, |(i, j, k)| {
            let turns = |a: usize, x: usize| (wave[a] * x) as f32 / shape[a] as f32;
            Complex32::cis(std::f32::consts::TAU * (turns(0, i) + turns(1, j) + turns(2, k)))
        });
        for level in levels() {
            let mut field = field.clone();
            transform_negative(level, &mut field);
            for (at, value) in field.indexed_iter() {
                let peak = if at == wave.into() { 60.0 } else { 0.0 };
                assert!((value - peak).norm() < 1e-4, "{at:?}: {value}");
            }
        }
    }
}
