//! Working memory of one thread, and views of it under one rotation.

use std::ops::Range;

use super::buffer::Buffer;
use super::fused::Fused;
use super::image::Image;
use super::layout::{Layout, MAX_TERMS, planes};
use super::tile::Tile;
use crate::correlate::contract::{MovingRows, Sizes};
use crate::correlate::real::Real;

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
