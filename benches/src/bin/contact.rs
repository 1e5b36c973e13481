//! Accuracy where parts touch: `contact [--quick] [--out DIR] [pair=NAME]... [clearance=MM]...
//! [spacing=MM]... [smoothing=CELLS]... [points=N]...`.
//!
//! Energies, forces and torques at random poses and in contact, of cell averages and of smoothed
//! densities with their contact sum, for parts as they are, shifted by fractions of a cell, and
//! turned, all against smoothed densities of half the finest spacing in a frame of their own.

use std::time::Instant;

use fft_correlate::pair::default_halo;
use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergySource, PairBuilder, Pose, Response, ScoreModel,
};
use glam::{DQuat, DVec3};
use pegfit_benches::frames::{Frame, contact_paths};
use pegfit_benches::table::{Table, percent, significant};
use pegfit_benches::{Arguments, Outcome, random_poses, response_errors, rms};
use rand::{SeedableRng, rngs::SmallRng};
use rayon::prelude::*;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{Silent, TriangleMesh};

/// Random poses: rotations within this, degrees, displacements within this, metres.
const BALL: f64 = 7.2;
const REACH: f64 = 3.6e-3;

/// What is measured.
struct Plan {
    pairs: Vec<PegInHole>,
    clearances: Vec<f64>,
    spacings: Vec<f64>,
    smoothings: Vec<f64>,
    points: Vec<usize>,
    /// Random poses, and poses of each of three paths in contact.
    poses: [usize; 2],
}

impl Plan {
    fn parse(arguments: &Arguments) -> Outcome<Self> {
        let mut plan = Self {
            pairs: Vec::new(),
            clearances: Vec::new(),
            spacings: Vec::new(),
            smoothings: Vec::new(),
            points: Vec::new(),
            poses: if arguments.quick { [40, 14] } else { [200, 67] },
        };
        for word in &arguments.rest {
            match word.split_once('=') {
                Some(("pair", name)) => {
                    let known = PegInHole::ALL.into_iter().find(|p| p.name() == name);
                    plan.pairs
                        .push(known.ok_or_else(|| format!("no pair {name}"))?);
                }
                Some(("clearance", mm)) => plan.clearances.push(mm.parse()?),
                Some(("spacing", mm)) => plan.spacings.push(mm.parse()?),
                Some(("smoothing", cells)) => plan.smoothings.push(cells.parse()?),
                Some(("points", n)) => plan.points.push(n.parse()?),
                _ => return Err(format!("unknown {word}").into()),
            }
        }
        let or = |list: &mut Vec<f64>, default: &[f64]| {
            if list.is_empty() {
                *list = default.to_vec();
            }
        };
        or(&mut plan.clearances, &[0.0, 0.1, 0.3, 0.5]);
        or(&mut plan.spacings, &[1.4, 0.83]);
        or(&mut plan.smoothings, &[0.7]);
        if plan.pairs.is_empty() {
            plan.pairs = PegInHole::ALL.to_vec();
        }
        Ok(plan)
    }
}

/// One pair at one clearance.
struct Case {
    name: [String; 2],
    parts: [TriangleMesh; 2],
    halo: f64,
    poses: [Vec<Pose>; 2],
}

/// How densities are put on a lattice and read.
#[derive(Clone, Copy)]
struct Scheme {
    /// Spacing, metres.
    spacing: f64,
    /// In spacings; none for cell averages.
    smoothing: Option<f64>,
    /// At most so many points; none for all.
    points: Option<usize>,
}

/// What a scheme gave, and took.
struct Found {
    responses: [Vec<Response>; 2],
    /// Seconds of set-up.
    built: f64,
    /// Median seconds of a pose in contact.
    each: f64,
}

impl Case {
    fn new(which: PegInHole, mm: f64, plan: &Plan) -> Outcome<Self> {
        let (hole, peg) = which.pair(1e-3 * mm)?;
        let halo = default_halo(&ScoreModel::GUIDED, &hole, &peg);
        let builder = PairBuilder {
            spacing: Some(4e-3),
            ..PairBuilder::default()
        };
        let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
        let mut rng = SmallRng::seed_from_u64(9);
        let angle = BALL.to_radians();
        let random = random_poses(&pair, &mut rng, angle, REACH, plan.poses[0]);
        Ok(Self {
            name: [which.name().to_owned(), format!("{mm}")],
            parts: [hole, peg],
            halo,
            poses: [random, contact_paths(&pair, angle, REACH, plan.poses[1])],
        })
    }

    fn found(&self, scheme: Scheme, frame: &Frame) -> Outcome<Found> {
        let began = Instant::now();
        let [hole, peg] = self.parts.each_ref().map(|m| frame.part(m));
        let builder = PairBuilder {
            spacing: Some(scheme.spacing),
            halo: Some(self.halo),
            smoothing: scheme.smoothing,
            ..PairBuilder::default()
        };
        let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
        let options = DirectOptions {
            max_points: scheme.points,
            ..match scheme.points {
                Some(_) => DirectOptions::REAL_TIME,
                None => DirectOptions::FULL,
            }
        };
        let source = DirectEvaluator::new(&pair, &options)?;
        let built = began.elapsed().as_secs_f64();
        let responses = self.poses.each_ref().map(|poses| {
            let answer = |pose: &Pose| {
                let there = frame.pose(pose);
                frame.back(&source.evaluate(&there, &mut source.scratch()), &there)
            };
            poses.par_iter().map(answer).collect()
        });
        let mut scratch = source.scratch();
        let mut times: Vec<f64> = self.poses[1]
            .iter()
            .map(|pose| {
                let there = frame.pose(pose);
                let began = Instant::now();
                std::hint::black_box(source.evaluate(&there, &mut scratch));
                began.elapsed().as_secs_f64()
            })
            .collect();
        times.sort_by(f64::total_cmp);
        Ok(Found {
            responses,
            built,
            each: times[times.len() / 2],
        })
    }
}

const COLUMNS: [&str; 15] = [
    "pair",
    "clearance, mm",
    "spacing, mm",
    "smoothing, cells",
    "points",
    "frame",
    "set-up, s",
    "us per pose",
    "wrench, %",
    "random: energy, %",
    "force, %",
    "torque, %",
    "in contact: energy, %",
    "force, %",
    "torque, %",
];

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let plan = Plan::parse(&arguments)?;
    let about = "Relative to the range of the energy and the rms of force and torque; the wrench's \
        error is the rms of its four. The reference is the method itself at 0.45 mm.";
    let mut table = Table::new("contact", "Accuracy where parts touch", about, &COLUMNS);
    for &which in &plan.pairs {
        for &mm in &plan.clearances {
            let case = Case::new(which, mm, &plan)?;
            rows(&case, &plan, &mut table)?;
            print!("{}", table.to_text());
        }
    }
    arguments.publish(&table, None)
}

fn rows(case: &Case, plan: &Plan, table: &mut Table) -> Outcome<()> {
    let reference = Scheme {
        spacing: 4.5e-4,
        smoothing: Some(0.8),
        points: None,
    };
    let turn = DQuat::from_scaled_axis(DVec3::new(-0.4, 0.9, 0.5));
    let own = Frame {
        motion: Pose::new(turn, DVec3::new(-2.1e-3, 0.4e-3, 5.2e-3)),
    };
    let truth = case.found(reference, &own)?;
    let builder = PairBuilder {
        spacing: Some(4e-3),
        ..PairBuilder::default()
    };
    let [hole, peg] = &case.parts;
    let pair = builder.build(hole, peg, &ScoreModel::GUIDED, &Silent)?;
    let frames = [
        ("own", Frame::OWN),
        ("shifted", Frame::shifted()),
        ("turned", Frame::turned()),
    ];
    for scheme in schemes(plan) {
        for (name, frame) in &frames {
            let found = case.found(scheme, frame)?;
            let [random, contact] = [0, 1].map(|n| {
                let (a, b) = (&truth.responses[n], &found.responses[n]);
                response_errors(&pair, &case.poses[n], a, b)
            });
            let wrench = rms(random[1..].iter().chain(&contact[1..]).copied());
            let names = case.name.iter().cloned().chain([
                significant(1e3 * scheme.spacing, 2),
                scheme.smoothing.map_or("none".into(), |s| format!("{s}")),
                scheme.points.map_or("all".into(), |n| format!("{n}")),
                (*name).to_owned(),
                significant(found.built, 2),
                significant(1e6 * found.each, 3),
            ]);
            let shares = [wrench].into_iter().chain(random).chain(contact);
            table.push(names.chain(shares.map(percent)));
        }
    }
    Ok(())
}

fn schemes(plan: &Plan) -> Vec<Scheme> {
    let mut schemes = Vec::new();
    for &mm in &plan.spacings {
        let spacing = 1e-3 * mm;
        let mut add = |smoothing, points| {
            schemes.push(Scheme {
                spacing,
                smoothing,
                points,
            });
        };
        add(None, None);
        for &smoothing in &plan.smoothings {
            add(Some(smoothing), None);
            for &points in &plan.points {
                add(Some(smoothing), Some(points));
            }
        }
    }
    schemes
}
