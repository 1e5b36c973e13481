//! True responses of pairs at random poses and in contact, kept in files since they take
//! minutes: `benches/truths/PAIR-MILLIMETRES.csv`. Those of the square pair were written by
//! `truth --write`, all others by `truth --write smallest=0.03 poses=12`.

use std::fs;
use std::path::{Path, PathBuf};

use fft_correlate::pair::default_halo;
use fft_correlate::{Pair, PairBuilder, Pose, Response, ScoreModel, Wrench};
use glam::{DQuat, DVec3};
use pegfit_truth::{TrueResponse, Truth, TruthOptions};
use rand::{SeedableRng, rngs::SmallRng};
use sdf_grid::{Silent, TriangleMesh};

use crate::frames::{Frame, contact_paths};
use crate::mates::Mates;
use crate::{Outcome, random_poses};

/// Random poses: rotations within this, degrees, displacements within this, metres.
pub const BALL: f64 = 7.2;
/// See [`BALL`].
pub const REACH: f64 = 3.6e-3;

/// Of each pose: energy, force, torque about the moving part's origin.
const NUMBERS: usize = 7;

/// The poses of a pair and what is true there.
#[derive(Debug, Clone)]
pub struct Truths {
    /// At random, and in contact.
    pub poses: [Vec<Pose>; 2],
    /// By cells along the parts' axes.
    pub own: [Vec<Response>; 2],
    /// By cells that lie obliquely in both parts, turned back.
    pub turned: [Vec<Response>; 2],
}

/// The parts of a pair, their halo and a coarse pair that poses are made of.
#[derive(Debug)]
pub struct Parts {
    /// What they are.
    pub which: Mates,
    /// Clearance, millimetres.
    pub clearance: f64,
    /// Fixed, moving.
    pub meshes: [TriangleMesh; 2],
    /// Default halo of the parts as they are, metres: part of the model.
    pub halo: f64,
    /// A pair of wide cells.
    pub pair: Pair,
}

impl Parts {
    /// A pair at `clearance` millimetres.
    ///
    /// # Errors
    /// If the clearance is out of range.
    pub fn new(which: Mates, clearance: f64) -> Outcome<Self> {
        let [hole, peg] = which.pair(1e-3 * clearance)?;
        let builder = PairBuilder {
            spacing: Some(4e-3),
            ..PairBuilder::default()
        };
        Ok(Self {
            which,
            clearance,
            halo: default_halo(&ScoreModel::GUIDED, &hole, &peg),
            pair: builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?,
            meshes: [hole, peg],
        })
    }

    /// `random` poses at random and thrice `each` in contact.
    #[must_use]
    pub fn poses(&self, random: usize, each: usize) -> [Vec<Pose>; 2] {
        let mut rng = SmallRng::seed_from_u64(9);
        let angle = BALL.to_radians();
        [
            random_poses(&self.pair, &mut rng, angle, REACH, random),
            contact_paths(&self.pair, angle, REACH, each),
        ]
    }

    /// Where what is true of them is kept.
    #[must_use]
    pub fn file(&self) -> PathBuf {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("truths");
        folder.join(format!("{}-{}.csv", self.which.name(), self.clearance))
    }
}

impl Truths {
    /// Computes them: seconds a pose.
    ///
    /// # Errors
    /// If an option is out of range.
    pub fn new(parts: &Parts, poses: [Vec<Pose>; 2], options: &TruthOptions) -> Outcome<Self> {
        let at = |frame: &Frame| -> Outcome<[Vec<Response>; 2]> {
            let [hole, peg] = parts.meshes.each_ref().map(|m| frame.part(m));
            let options = TruthOptions {
                halo: Some(parts.halo),
                ..*options
            };
            let truth = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &options)?;
            Ok(poses.each_ref().map(|poses| {
                let there: Vec<Pose> = poses.iter().map(|p| frame.pose(p)).collect();
                let found = truth.at_all(&there);
                let back = |(r, p): (&TrueResponse, &Pose)| frame.back(&response(r), p);
                found.iter().zip(&there).map(back).collect()
            }))
        };
        Ok(Self {
            own: at(&Frame::OWN)?,
            turned: at(&Frame::turned())?,
            poses,
        })
    }

    /// What counts as true: the mean of both.
    #[must_use]
    pub fn mean(&self) -> [Vec<Response>; 2] {
        std::array::from_fn(|k| {
            let both = self.own[k].iter().zip(&self.turned[k]);
            both.map(|(a, b)| Response {
                energy: 0.5 * (a.energy + b.energy),
                wrench: (a.wrench + b.wrench) * 0.5,
                coverage: 1.0,
            })
            .collect()
        })
    }

    /// Those kept of a pair.
    ///
    /// # Errors
    /// If there is no such file, or it holds something else.
    pub fn read(parts: &Parts) -> Outcome<Self> {
        let path = parts.file();
        let which = format!("pair={} clearance={}", parts.which.name(), parts.clearance);
        let text = fs::read_to_string(&path)
            .map_err(|e| format!("{}: {e}; `truth --write {which}` makes it", path.display()))?;
        let mut found = Self {
            poses: [Vec::new(), Vec::new()],
            own: [Vec::new(), Vec::new()],
            turned: [Vec::new(), Vec::new()],
        };
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        for (n, record) in reader.records().enumerate() {
            let record = record?;
            let wrong = || format!("{}: row {n}: not of this form", path.display());
            let kind = KINDS.iter().position(|k| Some(*k) == record.get(0));
            let kind = kind.ok_or_else(wrong)?;
            let numbers = record.iter().skip(1).map(str::parse);
            let numbers = numbers.collect::<Result<Vec<f64>, _>>()?;
            let (pose, rest) = numbers.split_at_checked(7).ok_or_else(wrong)?;
            let (own, turned) = rest.split_at_checked(NUMBERS).ok_or_else(wrong)?;
            let rotation = DQuat::from_slice(&pose[3..]).normalize();
            found.poses[kind].push(Pose::new(rotation, DVec3::from_slice(pose)));
            found.own[kind].push(unpacked(own));
            found.turned[kind].push(unpacked(turned.get(..NUMBERS).ok_or_else(wrong)?));
        }
        Ok(found)
    }

    /// Keeps them.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, parts: &Parts) -> Outcome<()> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let names = ["energy", "fx", "fy", "fz", "tx", "ty", "tz"];
        let again = names.map(|n| format!("{n}_turned"));
        let pose = ["kind", "x", "y", "z", "qx", "qy", "qz", "qw"];
        let header = pose.into_iter().chain(names);
        writer.write_record(header.chain(again.iter().map(String::as_str)))?;
        for (k, kind) in KINDS.into_iter().enumerate() {
            for ((pose, a), b) in self.poses[k].iter().zip(&self.own[k]).zip(&self.turned[k]) {
                let [t, q] = [
                    pose.translation.to_array().to_vec(),
                    pose.rotation.to_array().to_vec(),
                ];
                let numbers = [t, q, packed(a), packed(b)].concat();
                let words = numbers.iter().map(|v| format!("{v:e}"));
                writer.write_record(std::iter::once(kind.to_owned()).chain(words))?;
            }
        }
        let path = parts.file();
        fs::create_dir_all(path.parent().ok_or("no folder")?)?;
        Ok(fs::write(path, writer.into_inner()?)?)
    }
}

const KINDS: [&str; 2] = ["random", "contact"];

/// A true response as a source's.
#[must_use]
pub fn response(r: &TrueResponse) -> Response {
    Response {
        energy: r.energy,
        wrench: r.wrench,
        coverage: 1.0,
    }
}

fn packed(r: &Response) -> Vec<f64> {
    let (f, t) = (r.wrench.force, r.wrench.torque);
    [r.energy, f.x, f.y, f.z, t.x, t.y, t.z].to_vec()
}

fn unpacked(numbers: &[f64]) -> Response {
    Response {
        energy: numbers[0],
        wrench: Wrench {
            force: DVec3::from_slice(&numbers[1..]),
            torque: DVec3::from_slice(&numbers[4..]),
        },
        coverage: 1.0,
    }
}
