//! Pairs whose removal path is known, in frames of their own, and whether an answer is that path.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use fft_correlate::Pose;
use glam::DVec3;
use pegfit_path::{Motion, Outcome as Found, PathResult};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sdf_grid::TriangleMesh;

use crate::Outcome;
use crate::assemblies::{modelled, random_rotation};
use crate::table::significant;

/// Clearances, metres: of the pairs that are made for one, and of nuts, whose facets take some of it.
pub const CLEARANCES: [f64; 4] = [2e-5, 6e-5, 2e-4, 5e-4];
const OF_NUTS: [f64; 3] = [4e-5, 1e-4, 3e-4];
/// Pitches of nuts, metres, and whether they are right-handed.
const THREADS: [(f64, bool); 3] = [(0.001, true), (0.002, false), (0.003, true)];

/// Directions closer than this, radians, and the play of a guide are one.
const ALIGNED: f64 = 0.12;
/// Length over which the shortest guide (the notch of the bayonet) leads, metres.
const GUIDE: f64 = 0.002;

/// A known insertion path, in the frame in which the parts were made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Known {
    /// At last straight along -z, or in either direction along z.
    Along {
        /// Whether both ends are open.
        either: bool,
    },
    /// Up along y, then across along x, without a turn.
    RoundTheCorner,
    /// Down along z, a quarter turn about it, and a little up.
    Bayonet,
    /// A helix about z; the pitch is negative of a left-handed thread, metres.
    Screw {
        /// Advance per turn.
        pitch: f64,
    },
    /// There is none.
    Stays,
}

/// Two parts whose assembled pose is the identity, and their path.
#[derive(Debug, Clone)]
pub struct KnownPair {
    /// What they are, and the clearance.
    pub name: String,
    /// Fixed and moving part.
    pub parts: (TriangleMesh, TriangleMesh),
    /// Between their walls, metres; 0 if it is not known.
    pub clearance: f64,
    /// Their path.
    pub path: Known,
}

/// Parts in a frame, each turned and shifted by itself.
#[derive(Debug, Clone)]
pub struct PlacedPair {
    /// The fixed part.
    pub fixed: TriangleMesh,
    /// The moving part.
    pub moving: TriangleMesh,
    /// The pose in which they fit.
    pub goal: Pose,
    /// Where the frame in which they were made lies.
    pub place: Pose,
}

/// All pairs: the paper's pegs, those of a folder if one is given, generated pegs, a dovetail, a spool
/// round a corner, a bayonet, a captive ball, nuts.
///
/// # Errors
/// If a part of the folder cannot be read.
pub fn known_pairs(folder: Option<&Path>) -> Outcome<Vec<KnownPair>> {
    let mut all = Vec::new();
    let mut add = |name: String, parts, clearance: f64, path| {
        all.push(KnownPair {
            name,
            parts,
            clearance,
            path,
        });
    };
    for pair in modelled(folder)? {
        let parts = ((*pair.fixed).clone(), (*pair.moving).clone());
        let path = Known::Along {
            either: pair.either,
        };
        add(pair.name, parts, 0.0, path);
    }
    for seed in 0..8 {
        let fit = pegfit_fixtures::random_fit(seed)?;
        let end = if fit.through { "through" } else { "blind" };
        let mm = millimetres(fit.clearance);
        let name = format!("peg {seed}, {}, {end}, {mm} mm", fit.kind);
        let either = fit.slide != [0.0; 2];
        let parts = (fit.fixed, fit.moving);
        add(name, parts, fit.clearance, Known::Along { either });
    }
    for c in CLEARANCES {
        let name = |what: &str| format!("{what}, {} mm", millimetres(c));
        let through = Known::Along { either: true };
        add(name("dovetail"), pegfit_fixtures::dovetail(c)?, c, through);
        let round = Known::RoundTheCorner;
        add(name("spool"), pegfit_fixtures::spool_in_slot(c)?, c, round);
        add(
            name("bayonet"),
            pegfit_fixtures::bayonet(c)?,
            c,
            Known::Bayonet,
        );
        let ball = pegfit_fixtures::captive_ball(c, 5e-4)?;
        add(name("captive ball"), ball, c, Known::Stays);
    }
    for (pitch, right_handed) in THREADS {
        for c in OF_NUTS {
            let hand = if right_handed { "right" } else { "left" };
            let name = format!(
                "nut, {} mm, {hand}, {} mm",
                millimetres(pitch),
                millimetres(c)
            );
            let signed = if right_handed { pitch } else { -pitch };
            let parts = bolt_and_nut(pitch, right_handed, c)?;
            add(name, parts, c, Known::Screw { pitch: signed });
        }
    }
    Ok(all)
}

fn bolt_and_nut(
    pitch: f64,
    right_handed: bool,
    clearance: f64,
) -> Outcome<(TriangleMesh, TriangleMesh)> {
    let thread = pegfit_fixtures::Thread {
        pitch,
        radius: 0.005,
        depth: 0.4 * pitch,
        right_handed,
        segments: 64,
    };
    let bolt = thread.bolt(4.0 * pitch, [0.008, 0.003])?;
    let nut = thread.nut([0.2 * pitch, 2.2 * pitch], 0.016, clearance)?;
    Ok((bolt, nut))
}

/// As in the names of pairs.
pub fn millimetres(length: f64) -> String {
    significant(1e3 * length, 2)
}

impl KnownPair {
    /// In one of many frames, the same for the same number.
    pub fn placed(&self, frame: u64) -> PlacedPair {
        let mut random = SmallRng::seed_from_u64(frame);
        let mut put = |mesh: &TriangleMesh| {
            let pose = random_pose(&mut random);
            (mesh.transformed(pose.rotation, pose.translation), pose)
        };
        let ((fixed, place), (moving, own)) = (put(&self.parts.0), put(&self.parts.1));
        PlacedPair {
            fixed,
            moving,
            goal: place * own.inverse(),
            place,
        }
    }

    /// Whether an answer between the parts as `placed` is the known one: a path without overlap by the
    /// known motions, or none after everything was tried.
    pub fn is_right(&self, placed: &PlacedPair, answer: &PathResult) -> bool {
        match answer.outcome {
            Found::Blocked { exhausted, .. } => self.path == Known::Stays && exhausted,
            Found::Free => {
                let own = placed.place.inverse();
                let motions = answer.motions.iter().map(|m| m.placed(&own));
                answer.is_free()
                    && self
                        .path
                        .is_by(&motions.collect::<Vec<_>>(), self.clearance)
            }
        }
    }
}

impl Known {
    /// Whether these motions, inwards, are the known path of parts with so much play, metres.
    fn is_by(self, motions: &[Motion], clearance: f64) -> bool {
        let along = |m: &Motion, axis: DVec3| {
            let play = (2.0 * clearance / m.length).min(0.2);
            direction(m).angle_between(axis) < ALIGNED + play
        };
        let (Some(first), Some(last)) = (motions.first(), motions.last()) else {
            return false;
        };
        match self {
            Self::Along { either } => {
                let inwards = along(last, -DVec3::Z) || (either && along(last, DVec3::Z));
                inwards && last.turn == 0.0
            }
            Self::RoundTheCorner => {
                motions.len() >= 2
                    && motions.iter().all(|m| m.turn == 0.0)
                    && along(first, DVec3::Y)
                    && along(last, DVec3::X)
            }
            Self::Bayonet => {
                let turned = motions.iter().filter(|m| m.turn > 0.2);
                let turn: f64 = turned.map(|m| m.turn).sum();
                // The lug has play all round, the notch is as long as this.
                let play = 2.0 * clearance / GUIDE;
                // Where there is play, it ends by righting itself.
                let mut ends = motions.iter().rev();
                let last = ends.find(|m| m.turn == 0.0 || m.turn > 0.2).unwrap_or(last);
                let back = direction(last).angle_between(DVec3::Z) < ALIGNED + play;
                along(first, -DVec3::Z)
                    && (turn - FRAC_PI_2).abs() < 0.3 + play
                    && (back || last.turn > 0.2)
            }
            Self::Screw { pitch } => {
                let screws = motions.iter().filter(|m| m.turn > 1.0);
                let most = screws.max_by(|a, b| a.turn.total_cmp(&b.turn));
                most.and_then(Motion::pitch)
                    .is_some_and(|found| (found / pitch - 1.0).abs() < 0.1)
            }
            Self::Stays => false,
        }
    }
}

/// Where a motion along an axis leads, a unit vector.
fn direction(motion: &Motion) -> DVec3 {
    motion.advance.signum() * DVec3::from_array(motion.axis)
}

/// Turned anyhow, shifted by up to 5 cm.
pub fn random_pose(random: &mut SmallRng) -> Pose {
    let shift = DVec3::from_array(std::array::from_fn(|_| random.random_range(-0.05..0.05)));
    Pose::new(random_rotation(random), shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(axis: DVec3, turn: f64, advance: f64) -> Motion {
        Motion {
            axis: axis.to_array(),
            point: [0.0; 3],
            turn,
            advance,
            length: advance.abs() + 0.005 * turn,
        }
    }

    #[test]
    fn known_paths_are_told_from_others() {
        let down = motion(-DVec3::Z, 0.0, 0.01);
        let across = motion(DVec3::X, 0.0, 0.008);
        let up = motion(DVec3::Y, 0.0, 0.01);
        let blind = Known::Along { either: false };
        assert!(blind.is_by(&[across, down], 1e-4));
        assert!(!blind.is_by(&[down.reversed()], 1e-4) && !blind.is_by(&[down, across], 1e-4));
        assert!(Known::Along { either: true }.is_by(&[down.reversed()], 1e-4));
        assert!(!blind.is_by(&[motion(-DVec3::Z, 1.0, 0.01)], 1e-4) && !blind.is_by(&[], 1e-4));
        assert!(Known::RoundTheCorner.is_by(&[up, across], 1e-4));
        assert!(!Known::RoundTheCorner.is_by(&[across, up], 1e-4));
        let quarter = motion(DVec3::Z, FRAC_PI_2, 0.0);
        let back = motion(DVec3::Z, 0.0, 0.002);
        assert!(Known::Bayonet.is_by(&[down, quarter, back], 1e-4));
        let tilt = motion(DVec3::X, 0.1, 0.0);
        assert!(Known::Bayonet.is_by(&[down, quarter, tilt], 1e-4));
        assert!(!Known::Bayonet.is_by(&[down, back], 1e-4));
        assert!(!Known::Bayonet.is_by(&[down, tilt], 1e-4));
        let thread = Known::Screw { pitch: -0.002 };
        let turns = |pitch: f64| motion(DVec3::Z, 12.0, pitch * 12.0 / std::f64::consts::TAU);
        assert!(thread.is_by(&[down, turns(-0.00202)], 1e-4));
        assert!(!thread.is_by(&[turns(0.002)], 1e-4) && !thread.is_by(&[turns(-0.003)], 1e-4));
        assert!(!Known::Stays.is_by(&[down], 1e-4));
    }
}
