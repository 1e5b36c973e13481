//! What is true of a pair in a frame, and what an answer is off by.

use fft_correlate::{Pair, PairBuilder, Pose, Response, ScoreModel};
use pegfit_benches::frames::Frame;
use pegfit_benches::mates::Mates;
use pegfit_benches::table::{Table, percent};
use pegfit_benches::truths::{Parts, Truths};
use pegfit_benches::{Outcome, response_errors, timed};
use sdf_grid::Silent;
use sdf_grid::shapes::PegInHole;

/// A pair, both of its parts moved to a frame, and what is true of it by a reference that knows no
/// lattice.
pub(crate) struct Case {
    parts: Parts,
    frame: Frame,
    /// At random and in contact, of the parts as they were.
    poses: [Vec<Pose>; 2],
    truth: [Vec<Response>; 2],
    /// In words.
    pub(crate) title: String,
    /// How sure the truth is.
    pub(crate) uncertainty: Table,
}

impl Case {
    /// The pair that the words `pair=NAME`, `clearance=MM` and `turned` ask for; of the poses kept
    /// of it one in `every`.
    pub(crate) fn read(words: &[String], every: usize) -> Outcome<Self> {
        let (mut pair, mut clearance) = (Mates::Paper(PegInHole::Rectangular), 0.0);
        let (mut frame, mut how) = (Frame::OWN, "");
        for word in words {
            match word.split_once('=') {
                Some(("clearance", mm)) => clearance = mm.parse()?,
                Some(("pair", name)) => pair = Mates::named(name)?,
                None if word == "turned" => (frame, how) = (Frame::turned(), ", turned"),
                _ => {
                    let known = "pair=NAME, clearance=MM, turned";
                    return Err(format!("unknown word {word:?}; known: {known}").into());
                }
            }
        }
        let title = format!("Pair {}, clearance {clearance} mm{how}", pair.name());
        eprintln!("{title}");
        let parts = Parts::new(pair, clearance)?;
        let truths = Truths::read(&parts)?;
        let mean = truths.mean();
        let uncertain = [0, 1]
            .map(|k| response_errors(&parts.pair, &truths.poses[k], &mean[k], &truths.own[k]));
        Ok(Self {
            poses: truths.poses.map(|p| some(p, every)),
            truth: mean.map(|r| some(r, every)),
            uncertainty: uncertainty(&uncertain),
            parts,
            frame,
            title,
        })
    }

    /// The pair on a lattice of this spacing, its densities smoothed by so many spacings.
    pub(crate) fn build(&self, mm: f64, smoothing: Option<f64>) -> Outcome<Pair> {
        let builder = PairBuilder {
            spacing: Some(1e-3 * mm),
            // The same for all spacings: it is part of the model.
            halo: Some(self.parts.halo),
            smoothing,
            ..PairBuilder::default()
        };
        let [fixed, moving] = self.parts.meshes.each_ref().map(|m| self.frame.part(m));
        Ok(builder.build(&fixed, &moving, &ScoreModel::GUIDED, &Silent)?)
    }

    /// Half the edge of the cube that every pose's displacement is in, metres.
    pub(crate) fn reach(&self) -> f64 {
        let turned = |p: &Pose| self.frame.motion.rotation * self.parts.pair.displacement(p);
        let displacements = self.poses.iter().flatten().map(turned);
        displacements.fold(0.0, |most, d| f64::max(most, d.abs().max_element()))
    }

    /// Errors, and the median time of a query at a random pose, of anything that answers. Each query
    /// is timed by itself and its fastest run of three counts, so that other programs disturb little.
    pub(crate) fn compare(&self, answer: impl Fn(&Pose) -> Response) -> (f64, [Vec<f64>; 2]) {
        let mut times = Vec::new();
        let errors = [0, 1].map(|which| {
            let mut found = Vec::new();
            for pose in &self.poses[which] {
                let there = self.frame.pose(pose);
                let (response, seconds) = timed(3, || answer(&there));
                assert!(response.coverage > 0.999, "a pose is outside");
                found.push(self.frame.back(&response, &there));
                if which == 0 {
                    times.push(seconds);
                }
            }
            let pair = &self.parts.pair;
            response_errors(pair, &self.poses[which], &self.truth[which], &found)
        });
        times.sort_by(f64::total_cmp);
        (times[times.len() / 2], errors)
    }
}

/// One in `every`.
fn some<T>(all: Vec<T>, every: usize) -> Vec<T> {
    all.into_iter().step_by(every).collect()
}

fn uncertainty(uncertain: &[Vec<f64>]) -> Table {
    let about = "The truth here is the mean of two that know no lattice (polyhedra cut exactly by \
        each other's faces), one with cells along the parts' axes, one with cells that lie \
        obliquely: how far each of the two is from it bounds what the other tables can tell.";
    let columns = ["poses", "energy, %", "force, %", "torque, %"];
    let mut table = Table::new("reference", "How sure the truth is", about, &columns);
    for (poses, u) in ["random", "in contact"].iter().zip(uncertain) {
        table.push(std::iter::once((*poses).to_owned()).chain(u.iter().map(|e| percent(*e))));
    }
    table
}
