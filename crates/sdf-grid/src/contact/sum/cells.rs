//! Pieces of a curved surface in compact cells.

use glam::{DVec3, IVec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::gathered::Gathered;
use crate::contact::samples::SurfaceSample;

/// Steps of Lloyd's algorithm: more make cells rounder by a percent.
const STEPS: usize = 3;

/// Centres are at first at least this far apart, in units of the distance asked for: as many as
/// squares of that side.
const APART: f64 = 0.82;

/// Pieces belong to cells whose normals differ from theirs by an angle of this cosine at most.
const ALONG: f64 = 0.5;

/// Pieces are taken together first by boxes of this size, in units of the distance of cells.
const BOX: f64 = 0.2;

/// Pieces of a surface to be divided into cells.
pub(super) struct Cells {
    distance: f64,
    /// By part and box.
    pieces: FxHashMap<(u32, IVec3), Gathered>,
}

/// A cell's part, middle and normal.
#[derive(Clone, Copy)]
struct Centre {
    part: u32,
    place: DVec3,
    normal: DVec3,
}

/// Centres by boxes of the distance's size.
type Boxes = FxHashMap<IVec3, Vec<u32>>;

impl Cells {
    pub(super) fn new(distance: f64) -> Self {
        Self {
            distance,
            pieces: FxHashMap::default(),
        }
    }

    /// Adds a piece of a part.
    pub(super) fn add(&mut self, part: u32, piece: &SurfaceSample) {
        let place = (piece.position / (BOX * self.distance)).floor().as_ivec3();
        self.pieces.entry((part, place)).or_default().add(piece);
    }

    /// One sample for each cell.
    pub(super) fn samples(&self) -> Vec<SurfaceSample> {
        let mut order: Vec<_> = self.pieces.iter().collect();
        order.sort_unstable_by_key(|((part, place), _)| (*part, place.to_array()));
        let pieces = order.iter();
        let pieces = pieces.filter_map(|((part, _), sum)| Some((*part, sum.sample()?)));
        let pieces: Vec<(u32, SurfaceSample)> = pieces.collect();
        let mut centres: Vec<Centre> = Vec::new();
        let mut boxes = Boxes::default();
        for (part, piece) in &pieces {
            let at = Centre::of(*part, piece);
            let nearest = self.nearest(&at, &centres, &boxes);
            if nearest.is_none_or(|(_, off)| off >= APART * self.distance) {
                let place = self.place(at.place);
                boxes.entry(place).or_default().push(centres.len() as u32);
                centres.push(at);
            }
        }
        let mut cells = Vec::new();
        for _ in 0..STEPS {
            cells = vec![Gathered::default(); centres.len()];
            let all = pieces.par_iter();
            let nearest = all.map(|(part, piece)| {
                let at = Centre::of(*part, piece);
                self.nearest(&at, &centres, &boxes).map(|(i, _)| i)
            });
            for ((_, piece), nearest) in pieces.iter().zip(nearest.collect::<Vec<_>>()) {
                if let Some(i) = nearest {
                    cells[i].add(piece);
                }
            }
            boxes.clear();
            for (i, (centre, cell)) in centres.iter_mut().zip(&cells).enumerate() {
                if let Some(sample) = cell.sample() {
                    *centre = Centre::of(centre.part, &sample);
                }
                let place = self.place(centre.place);
                boxes.entry(place).or_default().push(i as u32);
            }
        }
        cells.iter().filter_map(Gathered::sample).collect()
    }

    fn place(&self, p: DVec3) -> IVec3 {
        (p / self.distance).floor().as_ivec3()
    }

    /// The nearest centre within about one and a half times the distance of cells, and how far it
    /// is.
    fn nearest(&self, at: &Centre, centres: &[Centre], boxes: &Boxes) -> Option<(usize, f64)> {
        let place = self.place(at.place);
        let around = (0..27).map(|i| place + IVec3::new(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1));
        let near = around.filter_map(|p| boxes.get(&p)).flatten();
        let near = near.map(|i| (*i as usize, &centres[*i as usize]));
        let alike = near.filter(|(_, c)| c.part == at.part && c.normal.dot(at.normal) > ALONG);
        let squared = alike.map(|(i, c)| (i, c.place.distance_squared(at.place)));
        let nearest = squared.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(i, squared)| (i, squared.sqrt()))
    }
}

impl Centre {
    fn of(part: u32, sample: &SurfaceSample) -> Self {
        Self {
            part,
            place: sample.position,
            normal: sample.area.normalize_or_zero(),
        }
    }
}
