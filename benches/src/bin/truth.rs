//! How sure the truth of contact is:
//! `truth [--quick] [--out DIR] [--write] [pair=NAME]... [clearance=MM]... [poses=N] [smallest=S]`.
//!
//! For each of the pairs and clearances: energies against samples spread through both
//! solids, forces and torques against differences of the energy, all of them against the truth of
//! both parts turned and shifted (other cells, other fits). `--write` computes both truths only and
//! keeps them in `benches/truths`, for `contact` and others. `--quick`: few poses, coarse cells.
//! `smallest`: the edge of the smallest cells, of the narrowest extent of the smaller part.

use std::time::Instant;

use fft_correlate::{Pose, ScoreModel, Twist, Wrench};
use glam::DVec3;
use pegfit_benches::mates::Mates;
use pegfit_benches::table::{Table, percent, significant};
use pegfit_benches::truths::{Parts, Truths};
use pegfit_benches::{Arguments, Outcome, response_errors, rms};
use pegfit_truth::{Truth, TruthOptions, sampled_energy};
use rayon::prelude::*;

/// Half a step of differences, metres; angles are this over the parts' radius.
const STEP: f64 = 3e-5;
const RADIUS: f64 = 0.015;

/// How much is measured.
struct Effort {
    options: TruthOptions,
    /// Random poses, and poses of each of three paths in contact.
    poses: [usize; 2],
    /// Every so many poses, energies are sampled and differentiated.
    stride: usize,
    samples: usize,
}

fn main() -> Outcome<()> {
    let arguments = Arguments::parse_known()?;
    let mut effort = match arguments.quick {
        true => Effort {
            options: TruthOptions::COARSE,
            poses: [6, 4],
            stride: 6,
            samples: 20_000,
        },
        false => Effort {
            options: TruthOptions::FINE,
            poses: [24, 8],
            stride: 9,
            samples: 80_000,
        },
    };
    let chosen = Chosen::parse(&arguments.rest)?;
    if let Some(poses) = chosen.poses {
        effort.poses = [poses, poses.div_ceil(3)];
    }
    if let Some(smallest) = chosen.smallest {
        effort.options.smallest = smallest;
    }
    let mut sure = Table::new("truth-sure", "How sure the truth is", SURE, &SURE_COLUMNS);
    for &which in &chosen.pairs {
        for &mm in &chosen.clearances {
            let case = Case::new(which, mm, &effort)?;
            match chosen.write {
                true => case.found.write(&case.parts)?,
                false => case.sure(&effort, &mut sure)?,
            }
        }
    }
    match chosen.write {
        true => Ok(()),
        false => arguments.publish(&sure, None),
    }
}

const SURE: &str = "Relative to the range of the energy and the rms of force and torque at the same \
    poses. Turned: both parts turned and shifted, so that cells and fits are others. Sampled: \
    energies at a few poses from densities at points spread through both solids, with its own \
    standard error. Differences: of the energy, for force and torque.";

const SURE_COLUMNS: [&str; 13] = [
    "pair",
    "clearance, mm",
    "s per pose, set-up among them",
    "random: energy, turned, %",
    "force, %",
    "torque, %",
    "in contact: energy, turned, %",
    "force, %",
    "torque, %",
    "sampled energy, %",
    "its standard error, %",
    "differences: force, %",
    "torque, %",
];

/// What was asked for.
struct Chosen {
    pairs: Vec<Mates>,
    /// Millimetres.
    clearances: Vec<f64>,
    poses: Option<usize>,
    smallest: Option<f64>,
    write: bool,
}

impl Chosen {
    fn parse(words: &[String]) -> Outcome<Self> {
        let mut chosen = Self {
            pairs: Vec::new(),
            clearances: Vec::new(),
            poses: None,
            smallest: None,
            write: false,
        };
        for word in words {
            match word.split_once('=') {
                Some(("pair", name)) => chosen.pairs.push(Mates::named(name)?),
                Some(("clearance", mm)) => chosen.clearances.push(mm.parse()?),
                Some(("poses", n)) => chosen.poses = Some(n.parse()?),
                Some(("smallest", share)) => chosen.smallest = Some(share.parse()?),
                None if word == "--write" => chosen.write = true,
                _ => return Err(format!("unknown {word}; known: {KNOWN}").into()),
            }
        }
        if chosen.pairs.is_empty() {
            chosen.pairs = Mates::ALL.to_vec();
        }
        if chosen.clearances.is_empty() {
            chosen.clearances = vec![0.0, 0.1, 0.3, 0.5];
        }
        Ok(chosen)
    }
}

const KNOWN: &str = "--quick, --out, --write, pair=NAME, clearance=MM, poses=N, smallest=SHARE";

/// One pair with its true responses.
struct Case {
    parts: Parts,
    found: Truths,
    /// Processor seconds of a pose, set-up among them.
    seconds: f64,
}

impl Case {
    fn new(which: Mates, mm: f64, effort: &Effort) -> Outcome<Self> {
        let parts = Parts::new(which, mm)?;
        let began = Instant::now();
        let poses = parts.poses(effort.poses[0], effort.poses[1]);
        let count = 2.0 * poses.iter().map(Vec::len).sum::<usize>() as f64;
        let found = Truths::new(&parts, poses, &effort.options)?;
        let threads = rayon::current_num_threads() as f64;
        let seconds = began.elapsed().as_secs_f64() * threads / count;
        eprintln!("{} {mm} mm: {seconds:.2} s a pose", which.name());
        Ok(Self {
            parts,
            found,
            seconds,
        })
    }

    /// A row of how sure the truth is.
    fn sure(&self, effort: &Effort, table: &mut Table) -> Outcome<()> {
        let Truths { poses, own, turned } = &self.found;
        let errors = |n: usize| response_errors(&self.parts.pair, &poses[n], &own[n], &turned[n]);
        let all = || poses.iter().flatten().zip(own.iter().flatten());
        let energies = own.iter().flatten().map(|r| r.energy);
        let range = energies.clone().fold(f64::NEG_INFINITY, f64::max)
            - energies.fold(f64::INFINITY, f64::min);
        let (mut sampled, mut standard) = (Vec::new(), Vec::new());
        let [hole, peg] = &self.parts.meshes;
        let model = ScoreModel::GUIDED;
        for (pose, response) in all().step_by(effort.stride) {
            let found = sampled_energy([hole, peg], &model, None, pose, effort.samples)?;
            sampled.push((found.energy - response.energy) / range);
            standard.push(found.error / range);
        }
        let truth = Truth::new(hole, peg, &model, &effort.options)?;
        let chosen: Vec<_> = all().step_by(effort.stride).collect();
        let differences = chosen.par_iter().map(|(p, _)| difference(&truth, p));
        let differences: Vec<Wrench> = differences.collect();
        let each = || {
            chosen
                .iter()
                .zip(&differences)
                .map(|((_, r), d)| r.wrench - *d)
        };
        let force = rms(each().map(|w| w.force.length()))
            / rms(all().map(|(_, r)| r.wrench.force.length()));
        let torque = rms(each().map(|w| w.torque.length()))
            / rms(all().map(|(_, r)| r.wrench.torque.length()));
        let shares = errors(0).into_iter().chain(errors(1));
        let shares = shares.chain([rms(sampled), rms(standard), force, torque]);
        let cells = [
            self.parts.which.name().to_owned(),
            format!("{}", self.parts.clearance),
            significant(self.seconds, 2),
        ];
        table.push(cells.into_iter().chain(shares.map(percent)));
        Ok(())
    }
}

/// The wrench by differences of the energy.
fn difference(truth: &Truth, pose: &Pose) -> Wrench {
    let slope = |twist: Twist, length: f64| {
        let at = |s: f64| truth.at(&pose.perturbed(&(twist * s))).energy;
        -(at(1.0) - at(-1.0)) / (2.0 * length)
    };
    let force = DVec3::AXES.map(|axis| {
        let linear = axis * STEP;
        let angular = DVec3::ZERO;
        slope(Twist { angular, linear }, STEP)
    });
    let torque = DVec3::AXES.map(|axis| {
        let angular = axis * (STEP / RADIUS);
        let linear = DVec3::ZERO;
        slope(Twist { angular, linear }, STEP / RADIUS)
    });
    Wrench {
        torque: DVec3::from_array(torque),
        force: DVec3::from_array(force),
    }
}
