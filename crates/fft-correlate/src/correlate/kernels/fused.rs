//! Transforms, sizes and fixed spectra of one correlation.

use std::f64::consts::PI;

use fearless_simd::Level;
use ndarray::Array3;
use num_complex::Complex;

use super::buffer::Buffer;
use super::image::{Image, ImageSizes};
use super::lane_fft::LaneFft;
use super::layout::{Layout, MAX_TERMS, halves, lanes, planes};
use super::spectrum::negative_spectrum;
use super::steps::Ends;
use crate::correlate::contract::{Memory, Sizes};
use crate::correlate::real::Real;
use crate::geometry::half_turn::HalfTurn;

/// Transforms, sizes and fixed spectra; see the folder's page.
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
        let y = |from_half, to_half| {
            let ends = Ends {
                from_half,
                to_half,
                ..Ends::default()
            };
            fft(size[1], ends)
        };
        let (x_from_half, x_to_half) = halves(&sizes, 0);
        let (y_from_half, y_to_half) = halves(&sizes, 1);
        let pair = LaneFft::pair(size[0], x_from_half, x_to_half);
        let [x, x_back] = pair.expect("lengths of factors 2, 3 and 5");
        let twist = twist(layout.half);
        let radix = x_back.first_radix();
        let images = images(&layout, &sizes, [x_back, y(false, y_to_half)], &twist);
        let terms = (0..sizes.moving.len()).map(|term| Term {
            y_places: layout.y_places(planes(&sizes, term), size[1]),
            spectrum: packed(&layout, size, radix, &fixed(term)),
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
            z: fft(layout.half, Ends::default()),
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
    layout: &Layout,
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
        for ((x, y, z), v) in negative_spectrum(field, part).indexed_iter() {
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
