//! Random pegs and the holes that they fit, broken edges, play and all.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, dvec2};

use super::profiled::{EdgeBreak, Profile, profiled};
use super::random_solid::Random;
use super::solids::circle;
use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;

/// The kinds of [`random_fit`], in the order in which seeds run through them.
pub const FIT_KINDS: [&str; 4] = ["rectangular", "round", "keyed", "stepped"];

/// Chords of a rounded corner, and of a round section.
const CHORDS: [u32; 2] = [4, 64];

/// How far a step goes inwards, and the most that is broken off an edge; of the narrow side.
const STEP: f64 = 0.2;
const WIDEST_BREAK: f64 = 0.08;

/// A peg and a block with the hole that it was made for; the identity is the assembled pose. The
/// axis is z, the mouth of the hole at height 0.
#[derive(Debug, Clone)]
pub struct RandomFit {
    /// The block.
    pub fixed: TriangleMesh,
    /// The peg.
    pub moving: TriangleMesh,
    /// `FIT_KINDS[seed % 4]`.
    pub kind: &'static str,
    /// Between the walls, metres.
    pub clearance: f64,
    /// Displacements along z between which the peg fills the hole alike, metres; both 0 if a floor
    /// or a shoulder stops it.
    pub slide: [f64; 2],
    /// Whether the hole is through.
    pub through: bool,
    /// Whether the block is a wall about a millimetre thick around the hole.
    pub thin: bool,
}

/// A random pair, 8 to 20 mm across, with 0.02 to 0.5 mm of clearance between its walls, blind or
/// through, in a block or in thin walls; the same for the same seed.
///
/// # Errors
/// None in practice: as [`profiled`].
pub fn random_fit(seed: u64) -> Result<RandomFit, MeshError> {
    let kind = (seed % 4) as usize;
    let mut random = Random::new(seed ^ 0x2545_f491_4f6c_dd1d);
    let size = random.between(0.008, 0.020);
    let (outline, narrow) = section(kind, size, &mut random);
    let clearance = 2e-5 * 25f64.powf(random.between(0.0, 1.0));
    let edge = edge_break(narrow, &mut random);
    let depth = random.between(0.5, 1.1) * size;
    let above = random.between(0.2, 0.8) * size;
    let (through, thin) = (random.next() & 1 == 1, random.next() & 1 == 1);
    let step = if kind == 3 { STEP * narrow } else { 0.0 };
    // What goes through sticks out below; what does not stands on the floor, or on the shoulder of
    // a stepped hole with a gap below.
    let below = if through { 0.3 * above } else { 0.0 };
    let gap = if kind == 3 && !through {
        clearance
    } else {
        0.0
    };
    let shoulder = -0.5 * depth;
    let mut peg = edge.at_foot(-depth - below, -step);
    let mut hole = edge.at_mouth(0.0, clearance);
    if kind == 3 {
        peg.extend([[shoulder, -step], [shoulder, 0.0]]);
        hole.extend([[shoulder, clearance], [shoulder, clearance - step]]);
    }
    peg.extend(edge.at_head(above, 0.0));
    hole.push([-depth - gap, clearance - step]);
    let floor = random.between(0.1, 0.3) * size;
    let bottom = if through {
        -depth
    } else {
        -depth - gap - floor
    };
    let block = block(&outline, size, thin, bottom, &mut random);
    let of = |levels| Profile {
        outline: outline.clone(),
        levels,
    };
    let moving = profiled(&of(peg), None)?;
    let fixed = profiled(&block, Some(&of(hole)))?;
    Ok(RandomFit {
        fixed,
        moving,
        kind: FIT_KINDS[kind],
        clearance,
        slide: if through && kind != 3 {
            [-above, below]
        } else {
            [0.0; 2]
        },
        through,
        thin,
    })
}

/// The section of a peg and its narrow side.
fn section(kind: usize, size: f64, random: &mut Random) -> (Vec<DVec2>, f64) {
    let aspect = random.between(0.5, 0.95);
    // Rounder than what chamfers and steps take from it.
    let narrowed = if kind == 3 { STEP } else { 0.0 };
    let corner = (narrowed + random.between(1.2 * WIDEST_BREAK, 0.15)) * aspect * size;
    match kind {
        1 => (circle(0.5 * size, CHORDS[1]), size),
        2 => (
            keyed(
                0.35 * size,
                dvec2(0.6 * size, random.between(0.1, 0.2) * size),
            ),
            0.7 * size,
        ),
        _ => {
            let half = 0.5 * size * dvec2(1.0, aspect);
            // Sharp corners once in three.
            let corner = if random.next().is_multiple_of(3) {
                0.0
            } else {
                corner
            };
            (rounded(half, corner), aspect * size)
        }
    }
}

fn edge_break(narrow: f64, random: &mut Random) -> EdgeBreak {
    let size = random.between(0.02, WIDEST_BREAK) * narrow;
    match random.next() & 1 {
        0 => EdgeBreak::Chamfer(size),
        _ => EdgeBreak::Fillet(size),
    }
}

/// A block from a height up to the mouth of its hole.
fn block(section: &[DVec2], size: f64, thin: bool, bottom: f64, random: &mut Random) -> Profile {
    let (outline, offset) = match thin {
        // Beyond the clearance and the broken edge of the mouth.
        true => {
            let wall = 0.001 + WIDEST_BREAK * size + random.between(0.0, 0.0015);
            (section.to_vec(), wall)
        }
        false => {
            let wider = dvec2(random.between(0.9, 1.4), random.between(0.9, 1.4));
            (rounded(size * wider, 0.0), 0.0)
        }
    };
    Profile {
        outline,
        levels: [bottom, 0.0].map(|z| [z, offset]).to_vec(),
    }
}

/// A rectangle with corners rounded by a radius, counter-clockwise.
fn rounded(half: DVec2, radius: f64) -> Vec<DVec2> {
    let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(DVec2::from);
    let chords = if radius > 0.0 { CHORDS[0] } else { 0 };
    let arc = |(quarter, sign): (usize, DVec2)| {
        (0..=chords).map(move |i| {
            let turn = f64::from(i) / f64::from(chords.max(1));
            let angle = FRAC_PI_2 * (quarter as f64 + turn);
            sign * (half - radius) + radius * DVec2::from_angle(angle)
        })
    };
    corners.into_iter().enumerate().flat_map(arc).collect()
}

/// A circle with a key along x that ends at `key.x`, `key.y` to either side.
fn keyed(radius: f64, key: DVec2) -> Vec<DVec2> {
    let start = (key.y / radius).asin();
    let (arc, steps) = (4.0 * FRAC_PI_2 - 2.0 * start, CHORDS[1]);
    let mut outline = vec![dvec2(key.x, -key.y), key];
    outline.extend(
        (0..=steps)
            .map(|i| radius * DVec2::from_angle(start + arc * f64::from(i) / f64::from(steps))),
    );
    outline
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::bvh::tree::Bvh;

    /// Every pair is closed, in its range, and apart by the clearance wherever it is not to touch.
    #[test]
    fn pegs_fit_their_holes() {
        let (mut blind, mut thin) = (0, 0);
        for seed in 0..40 {
            let fit = random_fit(seed).unwrap();
            assert_eq!(fit.kind, FIT_KINDS[seed as usize % 4]);
            let size = fit.moving.bounds().size();
            let across = size.x.max(size.y);
            assert!((0.007..0.021).contains(&across), "{seed}: {across}");
            assert!(fit.moving.volume() > 0.0 && fit.fixed.volume() > 0.0);
            let hole = Bvh::build(&fit.fixed);
            for p in fit.moving.vertices() {
                let distance = hole.signed_distance(*p);
                assert!(distance > -1e-9, "{seed}: {p} is {distance} m outside");
            }
            // Half way down, at the corner farthest from the axis.
            let z = 0.3 * fit.moving.bounds().min.z;
            let walls = fit.moving.vertices().iter().map(|p| p.truncate());
            let far = walls
                .max_by(|a, b| a.length().total_cmp(&b.length()))
                .unwrap();
            let distance = hole.nearest(far.extend(z)).distance;
            let play = (0.9 * fit.clearance)..(1.5 * fit.clearance);
            assert!(
                play.contains(&distance),
                "{seed}: {distance} of {}",
                fit.clearance
            );
            blind += u32::from(!fit.through);
            thin += u32::from(fit.thin);
        }
        assert!(
            (10..30).contains(&blind) && (10..30).contains(&thin),
            "{blind} {thin}"
        );
    }
}
