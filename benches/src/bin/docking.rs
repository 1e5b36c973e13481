//! Docking in every frame: `docking [--quick] [--out DIR] [--starts N] [--seeds A..B]
//! [--joints [A..B]] [--every N] [--folder DIR] [--only PAIR] [--kinds LIST] [--rank contact|energy]
//! [--exhaustive] [PARTS_DIR]`.
//!
//! Whether docking finds where a part belongs must not depend on how the parts lie in their frames.
//! Both parts of every pair are docked as they are, shifted by fractions of a cell, turned together,
//! with the moving part turned alone, and each turned by itself: the paper's pairs, generated fits
//! (`--seeds`), the parts of a folder; or the generated joints of `pegfit_fixtures` (`--joints`, one of
//! `--every` so many), or pairs in folders with their right places (`--folder`). Prints a line per
//! start; writes `docking.csv` (a line per pair or kind of pair, and start) and
//! `docking-rankings.csv`.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use fft_correlate::dock::Ranking;
use fft_correlate::{Docking, DockingPose, DockingRequest, DockingResult, PairSetup, Pose};
use glam::DVec3;
use pegfit_benches::assemblies::{generated, in_own_frame, modelled, random_rotation};
use pegfit_benches::docking_cases::{Case, axis_error, folder, generated_joints};
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome, parse_range};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sdf_grid::{Silent, TriangleMesh};

/// An axis this near the known one is it: radians (0.5 degrees), metres.
const SAME_AXIS: (f64, f64) = (8.727e-3, 2e-4);

/// Shifts of parts as they are, metres: fractions of a cell.
const CELL: f64 = 1e-3;

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
    /// Motions of the fixed and the moving part before anything is computed.
    fn motions(self, seed: u64) -> [Pose; 2] {
        let mut rng = SmallRng::seed_from_u64(seed);
        let mut place = |reach: f64| {
            reach * DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
        };
        let (shift, far) = (place(CELL), [place(0.05), place(0.05)]);
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
    only: String,
    kinds: Vec<(&'static str, Kind)>,
    /// Generated fits; with them the paper's.
    seeds: Option<Range<u64>>,
    joints: Option<Range<u64>>,
    every: usize,
    folder: Option<PathBuf>,
    request: DockingRequest,
}

const USAGE: &str = "usage: docking [--quick] [--out DIR] [--starts N] [--seeds A..B] \
    [--joints [A..B]] [--every N] [--folder DIR] [--only PAIR] [--kinds LIST] \
    [--rank contact|energy] [--exhaustive] [PARTS_DIR]";

fn main() -> Outcome<()> {
    let mut arguments = Arguments::parse_known()?;
    let wanted = wanted(&mut arguments)?;
    let parts = arguments.rest.first().map(Path::new);
    let mut rows = Rows::default();
    for case in cases(&wanted, parts)? {
        println!("\n== {}", case.name);
        for (kind, of) in &wanted.kinds {
            let starts = match of {
                Kind::InPlace => 1,
                _ => wanted.starts,
            };
            for start in 0..starts {
                let done = dock(&case, of.motions(start), &wanted.request);
                println!("   {kind} {start}: {done}");
                rows.add([case.set, &case.group, kind], done);
            }
        }
    }
    arguments.publish(&rows.summary(), None)?;
    arguments.publish(&rows.rankings(), None)
}

fn wanted(arguments: &mut Arguments) -> Outcome<Wanted> {
    let quick = arguments.quick;
    let mut wanted = Wanted {
        starts: if quick { 1 } else { 5 },
        only: String::new(),
        kinds: KINDS.to_vec(),
        seeds: None,
        joints: None,
        every: 1,
        folder: None,
        request: DockingRequest::default(),
    };
    let rest = &mut arguments.rest;
    while let Some(at) = rest.iter().position(|a| a.starts_with("--")) {
        let option = rest.remove(at);
        match option.as_str() {
            "--exhaustive" => {
                wanted.request.exhaustive = true;
                continue;
            }
            "--joints" => {
                let given = rest.get(at).and_then(|text| parse_range(text));
                if given.is_some() {
                    rest.remove(at);
                }
                wanted.joints = Some(given.unwrap_or(1..2));
                continue;
            }
            _ => {}
        }
        if at == rest.len() {
            return Err(USAGE.into());
        }
        let value = rest.remove(at);
        match option.as_str() {
            "--starts" => wanted.starts = value.parse()?,
            "--only" => wanted.only = value,
            "--every" => wanted.every = value.parse::<usize>()?.max(1),
            "--folder" => wanted.folder = Some(value.into()),
            "--seeds" => wanted.seeds = Some(parse_range(&value).ok_or(USAGE)?),
            "--rank" if value == "contact" => wanted.request.ranking = Ranking::Contact,
            "--rank" if value == "energy" => wanted.request.ranking = Ranking::Energy,
            "--kinds" => wanted
                .kinds
                .retain(|(name, _)| value.split(',').any(|k| k == *name)),
            _ => return Err(USAGE.into()),
        }
    }
    if wanted.joints.is_none() && wanted.folder.is_none() && wanted.seeds.is_none() {
        wanted.seeds = Some(if quick { 0..4 } else { 0..50 });
    }
    Ok(wanted)
}

fn cases(wanted: &Wanted, parts: Option<&Path>) -> Outcome<Vec<Case>> {
    let mut all = Vec::new();
    if let Some(seeds) = &wanted.seeds {
        let paper = modelled(parts)?.into_iter();
        all.extend(paper.map(|pair| Case::assembled("paper and parts", pair)));
        let fits = generated(seeds.clone())?.into_iter();
        all.extend(fits.map(|pair| Case::assembled("generated fits", pair)));
        all.retain(|case| case.name.contains(&wanted.only));
    }
    if let Some(seeds) = &wanted.joints {
        all.extend(generated_joints(seeds.clone(), &wanted.only, wanted.every)?);
    }
    if let Some(path) = &wanted.folder {
        all.extend(folder(path, &wanted.only)?);
    }
    match all.is_empty() {
        true => Err("no such pair".into()),
        false => Ok(all),
    }
}

/// A name, and what a pose counts by it; the largest is first.
type By = (&'static str, fn(&DockingPose) -> f64);

/// Ways to rank the poses returned.
const RANKINGS: [By; 6] = [
    ("rank", |p| p.rank),
    ("information", |p| p.hold.information),
    ("energy", |p| -p.found.energy),
    ("mating area", |p| p.mating_area),
    ("least overlap", |p| -p.overlap),
    ("hold alone", |p| p.hold.hold),
];

/// What one start came to.
struct Start {
    /// Why docking failed.
    failure: Option<String>,
    /// Place of a right pose among those returned, from 1.
    rank: Option<usize>,
    /// Where the first pose is right and its joint is known: whether the kind of joint, and the axis,
    /// are as stated.
    joint: Option<[bool; 2]>,
    /// The best of the first five from the assembled pose, if that is one: metres, radians.
    miss: Option<(f64, f64)>,
    /// Whether a right pose is first by each ranking.
    ranked_first: [bool; RANKINGS.len()],
    seconds: f64,
    /// What is said of the joint and, where the first pose is wrong, of the poses.
    said: String,
}

impl std::fmt::Display for Start {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(failure) = &self.failure {
            return write!(f, "FAILED: {failure}");
        }
        match self.rank {
            Some(rank) => write!(f, "right {rank}")?,
            None => write!(f, "MISSING")?,
        }
        if let Some((distance, angle)) = self.miss {
            let (distance, angle) = (1e3 * distance, angle.to_degrees());
            write!(f, ", off {distance:.2} mm {angle:.2}°")?;
        }
        write!(f, "{}", self.said)
    }
}

fn dock(case: &Case, motions: [Pose; 2], request: &DockingRequest) -> Start {
    let moved =
        |part: &TriangleMesh, by: &Pose| Arc::new(part.transformed(by.rotation, by.translation));
    let [fixed, moving] = [0, 1].map(|i| moved(&case.parts[i], &motions[i]));
    let setup = PairSetup::new(fixed, moving);
    match Docking::new(&setup, request.clone()).run(&Silent) {
        Ok(report) => judged(case, motions, &report),
        Err(error) => Start {
            failure: Some(error.to_string()),
            rank: None,
            joint: None,
            miss: None,
            ranked_first: [false; RANKINGS.len()],
            seconds: 0.0,
            said: String::new(),
        },
    }
}

/// What a report came to whose parts were moved before.
fn judged(case: &Case, [fixed, moving]: [Pose; 2], report: &DockingResult) -> Start {
    let own = |pose: &Pose| fixed.inverse() * *pose * moving;
    // The first right one among a pose and those alike, and the place where it is.
    let right = |p: &DockingPose| {
        let mut all = std::iter::once(&p.found.pose).chain(&p.alike).map(own);
        all.find_map(|pose| {
            let place = case.right.find((pose.rotation, pose.translation))?;
            Some((pose, place))
        })
    };
    let found: Vec<Option<(Pose, usize)>> = report.poses.iter().map(right).collect();
    let is_right: Vec<bool> = found.iter().map(Option::is_some).collect();
    let rank = is_right.iter().position(|right| *right).map(|i| i + 1);
    let miss = case.assembly.as_ref().and_then(|pair| {
        let group = in_own_frame(&report.symmetries, &moving);
        let pivot = moving.inverse().apply(report.lattices.pivot);
        let poses = report.poses.iter().take(5).map(|p| own(&p.found.pose));
        let misses = poses.map(|pose| pair.miss(&pose, &group, pivot));
        let far = |m: &(f64, f64)| m.0 + 0.02 * m.1;
        misses.min_by(|a, b| far(a).total_cmp(&far(b)))
    });
    let mut said = String::new();
    let first = found.first().copied().flatten();
    let joint = first.zip(case.joint).map(|((pose, place), freedom)| {
        let p = &report.poses[0];
        let (turn, shift) = case.right.places()[place];
        // From the pair as it lies to the first pose, by way of the pose that is right.
        let to = p.found.pose * (pose * moving.inverse()).inverse() * Pose::new(turn, shift);
        let (angle, distance) = axis_error(&freedom, &to, &p.joint);
        let kind = p.joint.kind.name() == freedom.name();
        let axis = angle < SAME_AXIS.0 && distance < SAME_AXIS.1;
        if !(kind && axis) {
            said += &format!(
                ", {} for {}, axis off {:.2} mm {:.2}°",
                p.joint.kind.name(),
                freedom.name(),
                1e3 * distance,
                angle.to_degrees(),
            );
        }
        [kind, axis]
    });
    let seconds = report.field_seconds + report.seconds();
    let stages = report.stages.iter().map(|s| format!("{:.1}", s.seconds));
    let stages: Vec<String> = stages.collect();
    said += &format!(
        "; {seconds:.1} s = {:.1} + {}",
        report.field_seconds,
        stages.join(" + ")
    );
    if rank != Some(1) {
        let poses = report.poses.iter().zip(&is_right).take(5);
        poses.for_each(|(p, right)| said += &described(p, *right));
    }
    Start {
        failure: None,
        rank,
        joint,
        miss,
        ranked_first: RANKINGS.map(|(_, by)| is_first(&report.poses, &is_right, by)),
        seconds,
        said,
    }
}

fn described(p: &DockingPose, right: bool) -> String {
    let (place, area) = (if right { "right" } else { "wrong" }, 1e6 * p.mating_area);
    format!(
        "\n      {place}: rank {:.1}, hold {:.1}, {area:.1} mm², {:.2} % overlap, {}",
        p.rank,
        p.hold.hold,
        100.0 * p.overlap,
        p.joint.kind.name(),
    )
}

/// Whether a right pose counts most, and more than any returned before it.
fn is_first(poses: &[DockingPose], is_right: &[bool], by: fn(&DockingPose) -> f64) -> bool {
    let (mut most, mut first) = (f64::NEG_INFINITY, false);
    for (pose, right) in poses.iter().zip(is_right) {
        if by(pose) > most {
            (most, first) = (by(pose), *right);
        }
    }
    first
}

/// Starts by set, group and kind of start, in the order in which they came.
#[derive(Default)]
struct Rows(Vec<([String; 3], Vec<Start>)>);

impl Rows {
    fn add(&mut self, names: [&str; 3], start: Start) {
        match self.0.iter_mut().find(|(of, _)| *of == names) {
            Some((_, starts)) => starts.push(start),
            None => self.0.push((names.map(str::to_owned), vec![start])),
        }
    }

    /// Names of all sets, and their starts.
    fn sets(&self) -> Vec<(&str, Vec<&Start>)> {
        let mut sets: Vec<(&str, Vec<&Start>)> = Vec::new();
        for ([set, ..], starts) in &self.0 {
            match sets.iter_mut().find(|(of, _)| of == set) {
                Some((_, all)) => all.extend(starts),
                None => sets.push((set, starts.iter().collect())),
            }
        }
        sets
    }

    /// Whether all are generated joints.
    fn are_joints(&self) -> bool {
        self.0.iter().all(|([set, ..], _)| set == "joints")
    }

    fn summary(&self) -> Table {
        let title = match self.are_joints() {
            true => "Joints of machines in every frame",
            false => "Docking in every frame",
        };
        let mut table = Table::new("docking", title, ABOUT, &COLUMNS);
        for ([_, group, kind], starts) in &self.0 {
            table.push(summary([group, kind], &starts.iter().collect::<Vec<_>>()));
        }
        for (set, starts) in self.sets() {
            table.push(summary([&format!("all: {set}"), "all"], &starts));
        }
        table
    }

    fn rankings(&self) -> Table {
        let about = "How often a right pose comes first among those returned, by each ranking (ties \
             in the order returned): what docking ranks by; the information of contact; the lowest \
             energy; the largest mating area; the least overlap; the hold without the overlap. And \
             how often a right pose was returned at all.";
        let columns = RANKINGS.iter().map(|by| by.0);
        let columns = std::iter::once("set").chain(columns);
        let columns: Vec<&str> = columns.chain(["returned", "starts"]).collect();
        let title = match self.are_joints() {
            true => "What to rank joints by",
            false => "What to rank by",
        };
        let mut table = Table::new("docking-rankings", title, about, &columns);
        for (set, starts) in self.sets() {
            let returned = starts.iter().filter(|s| s.rank.is_some()).count();
            let first = |i: usize| starts.iter().filter(|s| s.ranked_first[i]).count();
            let counts = (0..RANKINGS.len()).map(first);
            let counts = counts.chain([returned, starts.len()]);
            table.push(std::iter::once(set.to_owned()).chain(counts.map(|n| n.to_string())));
        }
        table
    }
}

const ABOUT: &str = "Fixed and moving part as they are, shifted by fractions of a cell, turned \
    together, the moving part turned alone, each turned by itself, then docked. First, among five: \
    starts whose first pose, or one of the first five, or one that is held alike, is right: 99 % of \
    the moving part's surface lies within 2 % of its diagonal of where it lies in a right place. \
    Joint, axis: where the first is right and the joint is known, starts whose kind of joint is as \
    stated, and whose axis is within 0.5 degrees and 0.2 mm of the stated one, of so many known. Off: \
    worst distance and angle of the best of the first five from the modelled pose, up to the part's \
    symmetry and the play of a slide. Median seconds.";

const COLUMNS: [&str; 11] = [
    "pair",
    "start",
    "first",
    "among five",
    "starts",
    "joint",
    "axis",
    "known",
    "off, mm",
    "off, degrees",
    "seconds",
];

fn summary(names: [&str; 2], starts: &[&Start]) -> [String; 11] {
    let count = |of: &dyn Fn(&Start) -> bool| starts.iter().filter(|s| of(s)).count();
    let worst = |of: fn((f64, f64)) -> f64| {
        let misses = starts.iter().filter_map(|s| s.miss).map(of);
        let worst = misses.reduce(f64::max);
        worst.map_or("-".into(), |off| significant(off, 2))
    };
    let known = count(&|s| s.joint.is_some());
    let of_joint = |i: usize| match known {
        0 => "-".into(),
        _ => count(&|s| s.joint.is_some_and(|j| j[i])).to_string(),
    };
    let done = starts.iter().filter(|s| s.failure.is_none());
    let mut seconds: Vec<f64> = done.map(|s| s.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let median = seconds.get(seconds.len() / 2).copied();
    [
        names[0].to_owned(),
        names[1].to_owned(),
        count(&|s| s.rank == Some(1)).to_string(),
        count(&|s| s.rank.is_some_and(|r| r <= 5)).to_string(),
        starts.len().to_string(),
        of_joint(0),
        of_joint(1),
        if known == 0 {
            "-".into()
        } else {
            known.to_string()
        },
        worst(|m| 1e3 * m.0),
        worst(|m| m.1.to_degrees()),
        median.map_or("-".into(), |s| significant(s, 2)),
    ]
}
