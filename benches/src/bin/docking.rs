//! Docking in every frame:
//! `docking [--quick] [--out DIR] [--starts N] [--seeds A..B] [--only PAIR] [--kinds LIST]
//! [--exhaustive] [PARTS_DIR]`.
//!
//! Whether docking finds a fit must not depend on how the parts lie in their frames. Both parts of
//! every pair are docked as they are, shifted by fractions of a cell, turned together, with the
//! moving part turned alone, and each turned by itself; the paper's pairs, generated ones
//! (`--seeds`), and the parts of a folder. Asks where the modelled pose comes, and whether the first
//! pose is the deepest: both go downhill on a lattice of half the spacing that docking ranks by, in
//! a frame of its own. Prints a line per start; writes `docking.csv` (a line per pair and kind)
//! and `docking-rankings.csv`.

use std::path::Path;
use std::sync::Arc;

use fft_correlate::testing::Descent;
use fft_correlate::{
    DirectEvaluator, DirectOptions, Docking, DockingRequest, DockingResult, Pair, PairBuilder,
    PairSetup, Pose,
};
use glam::DVec3;
use pegfit_benches::assemblies::{Assembly, generated, in_own_frame, modelled, random_rotation};
use pegfit_benches::frames::Frame;
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sdf_grid::Silent;

/// A pose this near the modelled one is it: angle, radians, and distance of the pivots, metres.
const SAME: (f64, f64) = (0.035, 5e-4);

/// A pose is as deep as the deepest within this share.
const AS_DEEP: f64 = 0.01;

/// A pose from which nothing on the way to the modelled one is shallower by more than this share of
/// its depth is the same one, leaning or turned in its play.
const PLAY: f64 = 0.1;

/// Poses on that way that are looked at, and how far the play goes at most: angle, radians, and
/// distance of the pivots, metres.
const LOOKS: u32 = 12;
const MOST_PLAY: (f64, f64) = (0.2, 1e-3);

/// Points of the evaluator that goes downhill before the full one.
const MERGED: usize = 40_000;

/// How both parts lie when docking begins.
#[derive(Debug, Clone, Copy)]
enum Kind {
    InPlace,
    Shifted,
    Together,
    Alone,
    Both,
}

const KINDS: [(&str, Kind); 5] = [
    ("in place", Kind::InPlace),
    ("shifted", Kind::Shifted),
    ("together", Kind::Together),
    ("alone", Kind::Alone),
    ("both", Kind::Both),
];

impl Kind {
    /// Motions of the fixed and the moving part before anything is computed. `cell` is that of the
    /// lattice on which rotations are scored, metres.
    fn motions(self, seed: u64, cell: f64) -> [Pose; 2] {
        let mut rng = SmallRng::seed_from_u64(seed);
        let mut place = |reach: f64| {
            reach * DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
        };
        let (shift, far) = (place(cell), [place(0.05), place(0.05)]);
        let turns = [random_rotation(&mut rng), random_rotation(&mut rng)];
        let [a, b] = [0, 1].map(|i| Pose::new(turns[i], far[i]));
        match self {
            Self::InPlace => [Pose::IDENTITY; 2],
            Self::Shifted => [Pose::from_translation(shift); 2],
            Self::Together => [a; 2],
            Self::Alone => [Pose::IDENTITY, b],
            Self::Both => [a, b],
        }
    }
}

struct Wanted {
    starts: u64,
    only: Option<String>,
    kinds: Vec<(&'static str, Kind)>,
    seeds: std::ops::Range<u64>,
    exhaustive: bool,
}

fn main() -> Outcome<()> {
    let mut arguments = Arguments::parse_known()?;
    let wanted = wanted(&mut arguments)?;
    let mut all = modelled(arguments.rest.first().map(Path::new))?;
    all.extend(generated(wanted.seeds.clone())?);
    let mut table = Table::new("docking", "Docking in every frame", ABOUT, &COLUMNS);
    let mut everything = Vec::new();
    for pair in &all {
        let name = pair.name.as_str();
        if wanted
            .only
            .as_ref()
            .is_some_and(|part| !name.contains(part.as_str()))
        {
            continue;
        }
        println!("\n== {name}");
        let mut truth = None;
        for (kind, of) in &wanted.kinds {
            let starts = if matches!(of, Kind::InPlace) {
                1
            } else {
                wanted.starts
            };
            let mut done = Vec::new();
            for start in 0..starts {
                done.push(dock(pair, *of, start, wanted.exhaustive, &mut truth)?);
                println!("   {kind} {start}: {}", done[start as usize]);
            }
            table.push(summary(&[name, kind], &done));
            everything.append(&mut done);
        }
    }
    table.push(summary(&["all", "all"], &everything));
    arguments.publish(&table, None)?;
    arguments.publish(&rankings(&everything), None)
}

fn wanted(arguments: &mut Arguments) -> Outcome<Wanted> {
    let usage = "usage: docking [--quick] [--out DIR] [--starts N] [--seeds A..B] \
                 [--only PAIR] [--kinds LIST] [--exhaustive] [PARTS_DIR]";
    let mut wanted = Wanted {
        starts: if arguments.quick { 1 } else { 5 },
        only: None,
        kinds: KINDS.to_vec(),
        seeds: if arguments.quick { 0..4 } else { 0..50 },
        exhaustive: false,
    };
    let rest = &mut arguments.rest;
    while let Some(at) = rest.iter().position(|a| a.starts_with("--")) {
        let option = rest.remove(at);
        if option == "--exhaustive" {
            wanted.exhaustive = true;
            continue;
        }
        let value = if at < rest.len() {
            rest.remove(at)
        } else {
            return Err(usage.into());
        };
        match option.as_str() {
            "--starts" => wanted.starts = value.parse()?,
            "--only" => wanted.only = Some(value),
            "--kinds" => wanted
                .kinds
                .retain(|(name, _)| value.split(',').any(|k| k == *name)),
            "--seeds" => {
                let (a, b) = value.split_once("..").ok_or(usage)?;
                wanted.seeds = a.parse()?..b.parse()?;
            }
            _ => return Err(usage.into()),
        }
    }
    Ok(wanted)
}

const ABOUT: &str = "Fixed and moving part as they are, shifted by fractions of a cell, turned \
    together, the moving part turned alone, each turned by itself, then docked. First, among five: \
    starts whose first pose, or one of the first five, is the modelled one up to the part's symmetry \
    and the play of a slide, pivots within 0.5 mm and rotations within 2 degrees, or leaning or \
    turned in its play, where nothing on the way to it is shallower by more than a tenth. Deepest: \
    starts whose first pose is as deep, within 1 %, as the modelled one and all others returned, each gone \
    downhill on half the spacing. Fit: the depth of the modelled pose as a share of the first one's, \
    the median. Worst distance and angle of the best of the first five from the modelled pose. \
    Median seconds.";

const COLUMNS: [&str; 10] = [
    "pair",
    "start",
    "first",
    "among five",
    "deepest",
    "starts",
    "fit",
    "off, mm",
    "off, degrees",
    "seconds",
];

/// A name, and what a pose of a depth and a mating area counts.
type Ranking = (&'static str, fn(f64, f64) -> f64);

/// Ways to rank the poses returned, larger first: by their depth and their mating area, both as
/// shares of the largest.
const RANKINGS: [Ranking; 4] = [
    ("energy", |depth, _| depth),
    ("mating area", |_, area| area),
    ("sum of both shares", |depth, area| depth + area),
    ("product", |depth, area| depth * area),
];

/// The energies by which poses are judged, in a frame of their own.
struct Truth {
    frame: Frame,
    pair: Pair,
    sources: [DirectEvaluator; 2],
    descent: Descent,
    /// Of the modelled pose, joules.
    fit: f64,
}

impl Truth {
    fn new(pair: &Assembly, report: &DockingResult, motion: &Pose) -> Outcome<Self> {
        let frame = Frame::turned();
        let builder = PairBuilder {
            spacing: Some(0.5 * report.lattices.fine),
            halo: Some(report.lattices.halo),
            ..PairBuilder::default()
        };
        let parts = [&pair.fixed, &pair.moving].map(|part| frame.part(part));
        let built = builder.build(&parts[0], &parts[1], &report.model, &Silent)?;
        let merged = DirectOptions {
            max_points: Some(MERGED),
            ..DirectOptions::FULL
        };
        let sources = [
            DirectEvaluator::new(&built, &merged)?,
            DirectEvaluator::new(&built, &DirectOptions::FULL)?,
        ];
        let descent = Descent {
            pivot: (frame.motion * motion.inverse()).apply(report.lattices.pivot),
            radius: report.lattices.radius,
            first_step: built.spacing(),
            last_step: 5e-3 * built.spacing(),
            max_steps: 60,
        };
        let mut truth = Self {
            frame,
            pair: built,
            sources,
            descent,
            fit: 0.0,
        };
        truth.fit = truth.depth(&Pose::IDENTITY);
        Ok(truth)
    }

    /// Energy at the bottom below a pose of the parts as they were, joules.
    fn depth(&self, pose: &Pose) -> f64 {
        let [merged, full] = &self.sources;
        let (pose, _) = self.descent.run(merged, &self.frame.pose(pose));
        debug_assert!(self.pair.displacement(&pose).is_finite());
        full.evaluate_full(&pose).response.energy
    }

    /// Whether two poses of the parts as they were are one in its play: on the way that turns about
    /// `pivot` and leads it along a line.
    fn play(&self, a: &Pose, b: &Pose, pivot: DVec3) -> bool {
        let full = &self.sources[1];
        let at = |i: u32| {
            let share = f64::from(i) / f64::from(LOOKS);
            let rotation = a.rotation.slerp(b.rotation, share);
            let place = a.apply(pivot).lerp(b.apply(pivot), share);
            Pose::new(rotation, place - rotation * pivot)
        };
        let energy = |p: Pose| full.evaluate_full(&self.frame.pose(&p)).response.energy;
        (0..=LOOKS).all(|i| energy(at(i)) <= (1.0 - PLAY) * self.fit)
    }
}

/// What one start came to.
struct Start {
    /// Place of the modelled pose among those returned, from 1.
    rank: Option<usize>,
    /// Of the first five, or of the first, from the modelled pose: metres, radians.
    miss: (f64, f64),
    first: (f64, f64),
    deepest: bool,
    /// Depth of the modelled pose, of the first one's.
    fit: f64,
    /// Whether the modelled pose is first by each ranking.
    ranked_first: [bool; 4],
    /// The first poses: distance, metres, angle, radians, depth, mating area, square metres.
    poses: Vec<[f64; 4]>,
    seconds: f64,
    stages: Vec<f64>,
}

impl std::fmt::Display for Start {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let rank = self.rank.map_or("MISSING".into(), |r| format!("{r}"));
        let of = |(d, a): (f64, f64)| format!("{:.2} mm {:.2}°", 1e3 * d, a.to_degrees());
        let (first, best) = (of(self.first), of(self.miss));
        let deepest = if self.deepest {
            "deepest"
        } else {
            "NOT DEEPEST"
        };
        write!(
            f,
            "fit {rank}, {deepest}, fit/first {:.3}, first {first}, best {best}",
            self.fit
        )?;
        let stages: Vec<_> = self.stages.iter().map(|s| format!("{s:.1}")).collect();
        write!(f, "; {:.1} s = {}", self.seconds, stages.join(" + "))?;
        let wrong = self.rank != Some(1) || !self.deepest;
        for [d, a, depth, area] in self.poses.iter().filter(|_| wrong) {
            let (d, a) = (1e3 * d, a.to_degrees());
            write!(
                f,
                "\n      {d:.2} mm {a:.1}°, depth {depth:.3}, {:.1} mm²",
                1e6 * area
            )?;
        }
        Ok(())
    }
}

fn dock(
    pair: &Assembly,
    kind: Kind,
    seed: u64,
    exhaustive: bool,
    truth: &mut Option<Truth>,
) -> Outcome<Start> {
    let cell = 1e-3;
    let [fixed, moving] = kind.motions(seed, cell);
    let moved = |part: &sdf_grid::TriangleMesh, by: &Pose| {
        Arc::new(part.transformed(by.rotation, by.translation))
    };
    let setup = PairSetup::new(moved(&pair.fixed, &fixed), moved(&pair.moving, &moving));
    let options = DockingRequest {
        exhaustive,
        ..DockingRequest::default()
    };
    let report = Docking::new(&setup, options).run(&Silent)?;
    let truth = match truth {
        Some(truth) => truth,
        None => truth.insert(Truth::new(pair, &report, &moving)?),
    };
    let group = in_own_frame(&report.symmetries, &moving);
    let pivot = moving.inverse().apply(report.lattices.pivot);
    let own = |pose: &Pose| fixed.inverse() * *pose * moving;
    let poses: Vec<Pose> = report.poses.iter().map(|p| own(&p.found.pose)).collect();
    let misses: Vec<_> = poses.iter().map(|p| pair.miss(p, &group, pivot)).collect();
    let fits: Vec<bool> = (poses.iter().zip(&misses).enumerate())
        .map(|(i, (pose, miss))| {
            let near = |of: (f64, f64)| miss.0 < of.1 && miss.1 < of.0;
            let seat = pair.nearest(pose, &group, pivot).0;
            near(SAME) || (i < 5 && near(MOST_PLAY) && truth.play(pose, &seat, pivot))
        })
        .collect();
    let far = |m: &(f64, f64)| m.0 + 0.02 * m.1;
    let best = (misses.iter().take(5)).min_by(|a, b| far(a).total_cmp(&far(b)));
    let depths: Vec<f64> = poses.iter().take(3).map(|p| truth.depth(p)).collect();
    let deepest = depths.iter().copied().fold(truth.fit, f64::min);
    Ok(Start {
        rank: fits.iter().position(|f| *f).map(|i| i + 1),
        miss: *best.ok_or("no pose")?,
        first: misses[0],
        deepest: depths[0] <= (1.0 - AS_DEEP) * deepest,
        fit: truth.fit / depths[0],
        ranked_first: ranked_first(&report, &fits),
        poses: (report.poses.iter().zip(&misses).take(5))
            .map(|(p, m)| [m.0, m.1, p.depth, p.mating_area])
            .collect(),
        seconds: report.field_seconds + report.seconds(),
        stages: std::iter::once(report.field_seconds)
            .chain(report.stages.iter().map(|s| s.seconds))
            .collect(),
    })
}

/// Whether a modelled pose is first by each ranking.
fn ranked_first(report: &DockingResult, is_fit: &[bool]) -> [bool; 4] {
    let widest = report
        .poses
        .iter()
        .map(|p| p.mating_area)
        .fold(1e-12, f64::max);
    RANKINGS.map(|(_, of)| {
        let marks = report
            .poses
            .iter()
            .map(|p| of(p.depth, p.mating_area / widest));
        let best = marks.zip(is_fit).max_by(|a, b| a.0.total_cmp(&b.0));
        best.is_some_and(|(_, fit)| *fit)
    })
}

fn rankings(starts: &[Start]) -> Table {
    let about = "How often the modelled pose comes first among those returned, by each ranking; \
                 and where it was returned at all.";
    let mut table = Table::new(
        "docking-rankings",
        "What to rank by",
        about,
        &["by", "first", "returned", "starts"],
    );
    let returned = starts.iter().filter(|s| s.rank.is_some()).count();
    for (i, (name, _)) in RANKINGS.iter().enumerate() {
        let first = starts.iter().filter(|s| s.ranked_first[i]).count();
        let counts = [first, returned, starts.len()].map(|n| n.to_string());
        table.push(std::iter::once((*name).to_owned()).chain(counts));
    }
    table
}

fn summary(names: &[&str; 2], starts: &[Start]) -> [String; 10] {
    let count = |of: &dyn Fn(&Start) -> bool| starts.iter().filter(|s| of(s)).count().to_string();
    let worst = |of: fn(&Start) -> f64| starts.iter().map(of).fold(0.0, f64::max);
    let median = |of: fn(&Start) -> f64| {
        let mut values: Vec<f64> = starts.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    [
        names[0].to_owned(),
        names[1].to_owned(),
        count(&|s| s.rank == Some(1)),
        count(&|s| s.rank.is_some_and(|r| r <= 5)),
        count(&|s| s.deepest),
        starts.len().to_string(),
        significant(median(|s| s.fit), 3),
        significant(worst(|s| 1e3 * s.miss.0), 2),
        significant(worst(|s| s.miss.1.to_degrees()), 2),
        significant(median(|s| s.seconds), 2),
    ]
}
