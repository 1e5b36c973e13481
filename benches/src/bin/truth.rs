//! How sure the truth of contact is, and how far direct quadrature is from it:
//! `truth [--quick] [--out DIR] [pair=NAME]... [clearance=MM]...`.
//!
//! For each of the example pairs and clearances: energies against samples spread through both
//! solids, forces and torques against differences of the energy, all of them against the truth of
//! both parts turned and shifted (other cells, other fits), and then the direct evaluator at its
//! default spacing and at 1.4 mm. `--quick`: few poses, coarse cells.

use std::time::Instant;

use fft_correlate::pair::default_halo;
use fft_correlate::{
    DirectEvaluator, DirectOptions, Pair, PairBuilder, Pose, Response, ScoreModel, Twist, Wrench,
};
use glam::DVec3;
use pegfit_benches::frames::{Frame, contact_paths};
use pegfit_benches::table::{Table, percent, significant};
use pegfit_benches::{Arguments, Outcome, ask, random_poses, response_errors, rms};
use pegfit_truth::{TrueResponse, Truth, TruthOptions, sampled_energy};
use rand::{SeedableRng, rngs::SmallRng};
use rayon::prelude::*;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{Silent, TriangleMesh};

/// Random poses: rotations within this, degrees, displacements within this, metres.
const BALL: f64 = 7.2;
const REACH: f64 = 3.6e-3;

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
    let arguments = Arguments::parse()?;
    let effort = match arguments.quick {
        true => Effort {
            options: TruthOptions::COARSE,
            poses: [6, 4],
            stride: 6,
            samples: 20_000,
        },
        false => Effort {
            options: TruthOptions::FINE,
            poses: [24, 10],
            stride: 9,
            samples: 80_000,
        },
    };
    let (pairs, clearances) = chosen(&arguments.rest)?;
    let mut sure = Table::new("truth-sure", "How sure the truth is", SURE, &SURE_COLUMNS);
    let mut off = Table::new(
        "truth-direct",
        "Direct evaluation against the truth",
        OFF,
        &OFF_COLUMNS,
    );
    for which in pairs {
        for &mm in &clearances {
            let case = Case::new(which, mm, &effort)?;
            case.sure(&effort, &mut sure)?;
            case.off(&mut off)?;
        }
    }
    arguments.publish(&sure, None)?;
    arguments.publish(&off, None)
}

const SURE: &str = "Relative to the range of the energy and the rms of force and torque at the same \
    poses. Turned: both parts turned and shifted, so that cells and fits are others. Sampled: \
    energies at a few poses from densities at points spread through both solids, with its own \
    standard error. Differences: of the energy, for force and torque.";

const SURE_COLUMNS: [&str; 14] = [
    "pair",
    "clearance, mm",
    "set-up, s",
    "s per pose",
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

const OFF: &str = "Errors of the direct evaluator: of the energy's range, of the rms of force and \
    torque. The error of the wrench is the rms of force's and torque's, at random poses and in \
    contact.";

const OFF_COLUMNS: [&str; 9] = [
    "pair",
    "clearance, mm",
    "spacing, mm",
    "random: energy, %",
    "force, %",
    "torque, %",
    "in contact: force, %",
    "torque, %",
    "wrench, %",
];

/// The pairs and clearances (millimetres) that were asked for.
fn chosen(words: &[String]) -> Outcome<(Vec<PegInHole>, Vec<f64>)> {
    let (mut pairs, mut clearances) = (Vec::new(), Vec::new());
    for word in words {
        match word.split_once('=') {
            Some(("pair", name)) => {
                let known = PegInHole::ALL.into_iter().find(|p| p.name() == name);
                pairs.push(known.ok_or_else(|| format!("no pair {name}"))?);
            }
            Some(("clearance", mm)) => clearances.push(mm.parse()?),
            _ => return Err(format!("unknown {word}; known: pair=NAME, clearance=MM").into()),
        }
    }
    if pairs.is_empty() {
        pairs = vec![
            PegInHole::Rectangular,
            PegInHole::Circular,
            PegInHole::Combined,
        ];
    }
    if clearances.is_empty() {
        clearances = vec![0.0, 0.1, 0.3, 0.5];
    }
    Ok((pairs, clearances))
}

/// One pair with its true responses.
struct Case {
    name: [String; 2],
    meshes: [TriangleMesh; 2],
    default: Pair,
    truth: Truth,
    /// Seconds of set-up, and processor seconds of a pose.
    seconds: [f64; 2],
    /// At random, and in contact.
    poses: [Vec<Pose>; 2],
    found: [Vec<Response>; 2],
}

impl Case {
    fn new(which: PegInHole, mm: f64, effort: &Effort) -> Outcome<Self> {
        let (hole, peg) = which.pair(1e-3 * mm)?;
        let default = PairBuilder::default().build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
        let mut rng = SmallRng::seed_from_u64(9);
        let random = random_poses(
            &default,
            &mut rng,
            BALL.to_radians(),
            REACH,
            effort.poses[0],
        );
        let poses = [
            random,
            contact_paths(&default, BALL.to_radians(), REACH, effort.poses[1]),
        ];
        let began = Instant::now();
        let truth = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &effort.options)?;
        let set_up = began.elapsed().as_secs_f64();
        let began = Instant::now();
        let found = poses.each_ref().map(|p| responses(&truth.at_all(p)));
        let count = poses.iter().map(Vec::len).sum::<usize>() as f64;
        let threads = rayon::current_num_threads() as f64;
        let each = began.elapsed().as_secs_f64() * threads / count;
        eprintln!(
            "{} {mm} mm: {set_up:.0} s, {each:.2} s a pose",
            which.name()
        );
        Ok(Self {
            name: [which.name().to_owned(), format!("{mm}")],
            meshes: [hole, peg],
            default,
            truth,
            seconds: [set_up, each],
            poses,
            found,
        })
    }

    /// A row of how sure the truth is.
    fn sure(&self, effort: &Effort, table: &mut Table) -> Outcome<()> {
        let turned = self.turned(&effort.options)?;
        let errors =
            |n: usize| response_errors(&self.default, &self.poses[n], &self.found[n], &turned[n]);
        let all = || self.poses.iter().flatten().zip(self.found.iter().flatten());
        let energies = self.found.iter().flatten().map(|r| r.energy);
        let range = energies.clone().fold(f64::NEG_INFINITY, f64::max)
            - energies.fold(f64::INFINITY, f64::min);
        let (mut sampled, mut standard) = (Vec::new(), Vec::new());
        for (pose, response) in all().step_by(effort.stride) {
            let [hole, peg] = &self.meshes;
            let model = ScoreModel::GUIDED;
            let found = sampled_energy([hole, peg], &model, None, pose, effort.samples)?;
            sampled.push((found.energy - response.energy) / range);
            standard.push(found.error / range);
        }
        let chosen: Vec<_> = all().step_by(effort.stride).collect();
        let differences = chosen.par_iter().map(|(p, _)| self.difference(p));
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
        let seconds = self.seconds.map(|s| significant(s, 2));
        let cells = self.name.iter().cloned().chain(seconds);
        table.push(cells.chain(shares.map(percent)));
        Ok(())
    }

    /// The same responses from parts that are turned and shifted, turned back.
    fn turned(&self, options: &TruthOptions) -> Outcome<[Vec<Response>; 2]> {
        let frame = Frame::turned();
        let [hole, peg] = self.meshes.each_ref().map(|m| frame.part(m));
        // The halo is part of the model: that of the parts as they were.
        let [fixed, moving] = &self.meshes;
        let options = TruthOptions {
            halo: Some(default_halo(&ScoreModel::GUIDED, fixed, moving)),
            ..*options
        };
        let truth = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &options)?;
        Ok(self.poses.each_ref().map(|poses| {
            let there: Vec<Pose> = poses.iter().map(|p| frame.pose(p)).collect();
            let found = responses(&truth.at_all(&there));
            found
                .iter()
                .zip(&there)
                .map(|(r, p)| frame.back(r, p))
                .collect()
        }))
    }

    /// The wrench by differences of the energy.
    fn difference(&self, pose: &Pose) -> Wrench {
        let slope = |twist: Twist, length: f64| {
            let at = |s: f64| self.truth.at(&pose.perturbed(&(twist * s))).energy;
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

    /// Rows of how far direct evaluation is off.
    fn off(&self, table: &mut Table) -> Outcome<()> {
        let [hole, peg] = &self.meshes;
        let builder = PairBuilder {
            spacing: Some(1.4e-3),
            ..PairBuilder::default()
        };
        let coarse = builder.build(hole, peg, &ScoreModel::GUIDED, &Silent)?;
        for pair in [&self.default, &coarse] {
            let source = DirectEvaluator::new(pair, &DirectOptions::FULL)?;
            let [random, contact] = [0, 1].map(|n| {
                let answers = self.poses[n].par_iter().map(|p| ask(&source, p));
                let answers: Vec<Response> = answers.collect();
                response_errors(&self.default, &self.poses[n], &self.found[n], &answers)
            });
            let wrench = rms(random[1..].iter().chain(&contact[1..]).copied());
            let spacing = pair.fixed().lattice().spacing();
            let shares = random.iter().chain(&contact[1..]).chain([&wrench]);
            let names = self
                .name
                .iter()
                .cloned()
                .chain([significant(1e3 * spacing, 2)]);
            table.push(names.chain(shares.map(|s| percent(*s))));
        }
        Ok(())
    }
}

fn responses(found: &[TrueResponse]) -> Vec<Response> {
    let response = |r: &TrueResponse| Response {
        energy: r.energy,
        wrench: r.wrench,
        coverage: 1.0,
    };
    found.iter().map(response).collect()
}
