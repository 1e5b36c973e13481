//! Held-out poses, the responses there that count as true, and what an answer is off by.

use fft_correlate::{Condition, DirectEvaluator, DirectOptions, Pair, Pose, Response};
use glam::{DQuat, DVec3};
use pegfit_benches::table::{Table, percent, significant};
use pegfit_benches::{Outcome, ask, random_poses, response_errors, timed};
use rand::{SeedableRng, rngs::SmallRng};
use rayon::prelude::*;

use crate::{BALL, Parts, REACH, Sweep, build};

/// Held-out poses and the true responses there.
pub(crate) struct Truth {
    pub(crate) pair: Pair,
    pub(crate) random: Vec<Pose>,
    pub(crate) paths: Vec<Pose>,
    pub(crate) truth: [Vec<Response>; 2],
    /// How sure it is.
    pub(crate) uncertainty: Table,
}

/// The mean of densities smoothed by 0.7 and by 1 spacing on a fine lattice.
pub(crate) fn reference(parts: &Parts, sweep: &Sweep) -> Outcome<Truth> {
    let mm = sweep.reference_mm;
    let pairs = [0.7, 1.0].map(|smoothing| build(parts, mm, Some(smoothing)));
    let [points, averages] = pairs;
    let (points, pair) = (points?, averages?);
    let mut rng = SmallRng::seed_from_u64(9);
    let (angle, reach) = ((0.9 * BALL).to_radians(), 0.9 * REACH);
    let random = random_poses(&pair, &mut rng, angle, reach, sweep.random);
    let paths = contact_paths(&pair, parts.turn, sweep.along);
    let sources = [&points, &pair].map(|p| DirectEvaluator::new(p, &DirectOptions::FULL));
    let [a, b] = sources;
    let (a, b) = (a?, b?);
    let mut uncertain = Vec::new();
    let truth = [&random, &paths].map(|poses| {
        let each = |s: &DirectEvaluator| poses.par_iter().map(|p| ask(s, p)).collect::<Vec<_>>();
        let (a, b) = (each(&a), each(&b));
        let mean: Vec<Response> = a.iter().zip(&b).map(|(a, b)| middle(a, b)).collect();
        uncertain.push(response_errors(&pair, poses, &mean, &b));
        mean
    });
    let rounding = rounding(&pair, &b, random.iter().chain(&paths));
    Ok(Truth {
        pair,
        random,
        paths,
        truth,
        uncertainty: uncertainty(mm, &uncertain, rounding),
    })
}

/// Median and largest condition number of the score at some poses, and the share of the sum of
/// absolute terms that single precision loses at most.
fn rounding<'a>(
    pair: &Pair,
    source: &DirectEvaluator,
    poses: impl Iterator<Item = &'a Pose>,
) -> [f64; 3] {
    let mut numbers: Vec<(f64, f64)> = poses
        .step_by(8)
        .map(|pose| {
            let exact = Condition::at(pair, pose);
            let rounding = (source.score(pose).re - exact.score).abs() / exact.magnitude;
            (exact.number(), rounding)
        })
        .collect();
    numbers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let worst = numbers.iter().map(|n| n.1).fold(0.0, f64::max);
    [
        numbers[numbers.len() / 2].0,
        numbers[numbers.len() - 1].0,
        worst,
    ]
}

fn uncertainty(mm: f64, uncertain: &[Vec<f64>], [median, largest, lost]: [f64; 3]) -> Table {
    let about = format!(
        "The truth here is the mean of point samples and cell averages every {mm} mm, each cell a \
         point: how far each of the two is from it bounds what the other tables can tell. The \
         condition number of the score is {} in the median and {} at most, and single precision \
         loses at most {lost:.1e} of the sum of absolute terms: rounding plays no part.",
        significant(median, 2),
        significant(largest, 2)
    );
    let columns = ["poses", "energy, %", "force, %", "torque, %"];
    let mut table = Table::new("reference", "How sure the reference is", &about, &columns);
    for (poses, u) in ["random", "in contact"].iter().zip(uncertain) {
        table.push(std::iter::once((*poses).to_owned()).chain(u.iter().map(|e| percent(*e))));
    }
    table
}

fn middle(a: &Response, b: &Response) -> Response {
    let mut mean = *a;
    mean.energy = 0.5 * (a.energy + b.energy);
    mean.wrench.force = 0.5 * (a.wrench.force + b.wrench.force);
    mean.wrench.torque = 0.5 * (a.wrench.torque + b.wrench.torque);
    mean
}

/// Sliding in along a wall, pressing from wall to wall, and turning in the hole, for parts turned
/// by `turn`.
fn contact_paths(pair: &Pair, turn: DQuat, count: usize) -> Vec<Pose> {
    let reach = 0.9 * REACH;
    let at = |k: usize| k as f64 / (count - 1) as f64;
    let pose =
        |rotation, displacement| pair.pose(turn * rotation * turn.conjugate(), turn * displacement);
    let slide = (0..count).map(|k| {
        let tilt = DQuat::from_rotation_y(0.01);
        pose(tilt, DVec3::new(3e-4, 0.0, reach * (1.0 - at(k))))
    });
    let press = (0..count).map(|k| {
        let across = reach * (at(k) - 0.5);
        pose(DQuat::IDENTITY, DVec3::new(across, 1e-4, 2e-4))
    });
    let spin = (0..count).map(|k| {
        let angle = (0.9 * BALL).to_radians() * (2.0 * at(k) - 1.0);
        pose(DQuat::from_rotation_z(angle), DVec3::new(2e-4, -1e-4, 3e-4))
    });
    slide.chain(press).chain(spin).collect()
}

/// Errors, and the median time of a query at a random pose, of anything that answers. Each query is
/// timed by itself and its fastest run of three counts, so that other programs disturb little.
pub(crate) fn compare(truth: &Truth, answer: impl Fn(&Pose) -> Response) -> (f64, [Vec<f64>; 2]) {
    let mut times = Vec::new();
    let errors = [(&truth.random, 0), (&truth.paths, 1)].map(|(poses, which)| {
        let found: Vec<(Response, f64)> = poses.iter().map(|p| timed(3, || answer(p))).collect();
        if which == 0 {
            times.extend(found.iter().map(|f| f.1));
        }
        let found: Vec<Response> = found.into_iter().map(|f| f.0).collect();
        response_errors(&truth.pair, poses, &truth.truth[which], &found)
    });
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], errors)
}
