//! Insertion paths, found in every frame: `path [--quick] [--out DIR] [--frames N or FROM..TO] [--only PAIR]
//! [--seconds S] [--scenes DIR] [PARTS_DIR]`.
//!
//! Both parts of pairs whose path is known (`pegfit_benches::known_paths`) are turned and shifted,
//! with clearances from 0.02 to 0.5 mm, and a burr whose only first piece is known. Prints how often
//! the answer was the known path, the time it took, and what was looked at. With `--scenes` nothing is
//! looked for: a scene of each pair in each frame is written there, for other tools.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;
use pegfit_benches::known_paths::{
    CLEARANCES, Known, KnownPair, known_pairs, millimetres, random_pose,
};
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome};
use pegfit_fixtures as shapes;
use pegfit_path::{
    AssemblyPart, DisassemblyRequest, DisassemblyResult, DisassemblySearch, DisassemblyStep,
    PathRequest, PathResult, PathSearch,
};
use rand::{SeedableRng, rngs::SmallRng, seq::SliceRandom};
use sdf_grid::{Silent, mesh_io};

const ABOUT: &str = "Paths found by `pegfit path` without energies, both parts turned and shifted by \
    themselves: how often the answer was the known path (or that there is none), told by its motions; \
    overlap of the solids along the path at points twice as dense as those of the search. Of the burr: \
    whether the one piece that can be first is, and all others follow.";

const COLUMNS: [&str; 8] = [
    "pair",
    "frames",
    "right",
    "seconds",
    "longest",
    "looked",
    "nodes",
    "overlap, mm",
];

/// Edge of the burr's cells, metres.
const EDGE: f64 = 0.004;

struct Wanted {
    frames: Range<u64>,
    only: Option<String>,
    limit: Duration,
    scenes: Option<PathBuf>,
}

impl Wanted {
    fn chosen(&self, name: &str) -> bool {
        let only = self.only.as_ref();
        only.is_none_or(|part| name.contains(part.as_str()))
    }
}

/// What came out in the frames of a row.
#[derive(Default)]
struct Tally {
    right: usize,
    seconds: Vec<f64>,
    poses_checked: usize,
    nodes: usize,
    /// Metres; none of parts that stay.
    overlap: Option<f64>,
}

fn main() -> Outcome<()> {
    let mut arguments = Arguments::parse_known()?;
    let wanted = wanted(&mut arguments)?;
    let folder = arguments.rest.first().map(Path::new);
    let chosen: Vec<KnownPair> = known_pairs(folder)?
        .into_iter()
        .filter(|known| wanted.chosen(&known.name))
        .collect();
    let burr = |clearance: f64| format!("burr, {} mm", millimetres(clearance));
    if let (true, Some(name)) = (chosen.is_empty(), &wanted.only)
        && !CLEARANCES.into_iter().any(|c| wanted.chosen(&burr(c)))
    {
        return Err(format!("no pair is called anything like \"{name}\"").into());
    }
    if let Some(folder) = &wanted.scenes {
        return chosen
            .iter()
            .try_for_each(|known| write_scenes(known, &wanted.frames, folder));
    }
    let mut table = Table::new("path", "Insertion paths", ABOUT, &COLUMNS);
    let mut told = |name: &str, tally: Tally| {
        table.push(tally.row(name));
        println!("{}", table.to_text().lines().last().unwrap_or_default());
    };
    for known in &chosen {
        told(&known.name, of_pair(known, &wanted)?);
    }
    for clearance in CLEARANCES {
        let name = burr(clearance);
        if wanted.chosen(&name) {
            told(&name, of_burr(clearance, &wanted)?);
        }
    }
    arguments.publish(&table, None)
}

fn wanted(arguments: &mut Arguments) -> Outcome<Wanted> {
    let usage = "usage: path [--quick] [--out DIR] [--frames N or FROM..TO] [--only PAIR] \
                 [--seconds S] [--scenes DIR] [PARTS_DIR]";
    let mut wanted = Wanted {
        frames: 0..if arguments.quick { 1 } else { 20 },
        only: None,
        limit: Duration::from_secs(60),
        scenes: None,
    };
    let rest = &mut arguments.rest;
    while let Some(at) = rest.iter().position(|a| a.starts_with("--")) {
        let option = rest.remove(at);
        if at >= rest.len() {
            return Err(usage.into());
        }
        let value = rest.remove(at);
        match option.as_str() {
            "--frames" => wanted.frames = frames(&value).ok_or(usage)?,
            "--only" => wanted.only = Some(value),
            "--seconds" => wanted.limit = Duration::try_from_secs_f64(value.parse()?)?,
            "--scenes" => wanted.scenes = Some(value.into()),
            _ => return Err(usage.into()),
        }
    }
    Ok(wanted)
}

/// `N`, the first N, or `FROM..TO`; one at least.
fn frames(text: &str) -> Option<Range<u64>> {
    let (from, to) = text.split_once("..").unwrap_or(("0", text));
    let range = from.parse().ok()?..to.parse().ok()?;
    (!range.is_empty()).then_some(range)
}

impl Tally {
    fn row(mut self, name: &str) -> Vec<String> {
        self.seconds.sort_by(f64::total_cmp);
        let frames = self.seconds.len();
        vec![
            name.to_owned(),
            frames.to_string(),
            self.right.to_string(),
            significant(self.seconds[frames / 2], 2),
            significant(self.seconds[frames - 1], 2),
            (self.poses_checked / frames).to_string(),
            (self.nodes / frames).to_string(),
            self.overlap
                .map_or("-".to_owned(), |o| significant(1e3 * o, 2)),
        ]
    }
}

/// A pair in its frames.
fn of_pair(known: &KnownPair, wanted: &Wanted) -> Outcome<Tally> {
    let mut tally = Tally::default();
    for frame in wanted.frames.clone() {
        let placed = known.placed(frame);
        let options = PathRequest {
            time_limit: wanted.limit,
            others: 0.0,
            ..PathRequest::default()
        };
        let began = Instant::now();
        let (fixed, moving) = (placed.fixed.clone(), placed.moving.clone());
        let search = PathSearch::new(Arc::new(fixed), Arc::new(moving), options)?;
        let answer = search.find(&placed.goal, None, &Silent)?;
        tally.seconds.push(began.elapsed().as_secs_f64());
        let right = known.is_right(&placed, &answer);
        if !right {
            println!("{}, frame {frame}: {}", known.name, told(&answer));
        }
        tally.right += usize::from(right);
        tally.poses_checked += answer.effort.poses_checked;
        tally.nodes += answer.effort.nodes;
        if known.path != Known::Stays {
            let overlap = tally.overlap.unwrap_or(0.0);
            tally.overlap = Some(overlap.max(answer.deepest().1));
        }
    }
    Ok(tally)
}

/// What a wrong answer says.
fn told(answer: &PathResult) -> String {
    let motions: Vec<String> = answer.motions.iter().map(ToString::to_string).collect();
    format!("{:?}: {}", answer.outcome, motions.join("; "))
}

/// A burr in its frames, its pieces in any order.
fn of_burr(clearance: f64, wanted: &Wanted) -> Outcome<Tally> {
    const KEY: usize = 1;
    let sticks = shapes::burr(EDGE, clearance)?;
    let mut tally = Tally::default();
    for frame in wanted.frames.clone() {
        let mut random = SmallRng::seed_from_u64(frame);
        let place = random_pose(&mut random);
        let mut order = [0, 1, 2, 3, 4, 5];
        order.shuffle(&mut random);
        let part = |stick: &usize| AssemblyPart {
            name: format!("stick {stick}"),
            mesh: Arc::new(sticks[*stick].transformed(place.rotation, place.translation)),
        };
        let options = DisassemblyRequest {
            time_limit: wanted.limit,
            ..DisassemblyRequest::default()
        };
        let search = DisassemblySearch::new(order.iter().map(part).collect(), options)?;
        let found = search.run(&Silent)?;
        let key = order.iter().position(|stick| *stick == KEY);
        let right = opens(&found, key, place.rotation * DVec3::X);
        if !right {
            let step = |step: &DisassemblyStep| format!("{:?} {}", step.parts, told(&step.path));
            let steps: Vec<String> = found.steps.iter().map(step).collect();
            let (steps, stay) = (steps.join("\n    "), &found.locked);
            println!("burr, frame {frame}: key {key:?}, {stay:?} stay\n    {steps}");
        }
        tally.right += usize::from(right);
        tally.seconds.push(found.seconds);
        tally.poses_checked += found.poses_checked;
        tally.nodes += found.tries;
        let deepest = found.steps.iter().map(|step| step.path.deepest().1);
        let overlap = deepest.fold(tally.overlap.unwrap_or(0.0), f64::max);
        tally.overlap = Some(overlap);
    }
    Ok(tally)
}

/// Whether the key comes first, straight along an axis, and everything else after it.
fn opens(found: &DisassemblyResult, key: Option<usize>, axis: DVec3) -> bool {
    let Some(first) = found.steps.first() else {
        return false;
    };
    let [motion] = &first.path.motions[..] else {
        return false;
    };
    let straight = motion.turn == 0.0 && DVec3::from_array(motion.axis).dot(axis).abs() > 0.99;
    let free = found.steps.iter().all(|step| step.path.is_free());
    first.parts.len() == 1
        && key == Some(first.parts[0])
        && straight
        && free
        && found.locked.is_empty()
}

/// A scene for each frame, its first line the pair's name.
fn write_scenes(known: &KnownPair, frames: &Range<u64>, folder: &Path) -> Outcome<()> {
    let plain = |c: char| {
        if c.is_alphanumeric() || c == '.' {
            c
        } else {
            '-'
        }
    };
    for frame in frames.clone() {
        let placed = known.placed(frame);
        let goal = placed.goal;
        let name: String = known.name.chars().map(plain).collect();
        let folder = folder.join(format!("{name}-{frame:02}"));
        std::fs::create_dir_all(&folder)?;
        mesh_io::write_obj(folder.join("fixed.obj"), &placed.fixed)?;
        mesh_io::write_obj(folder.join("moving.obj"), &placed.moving)?;
        let text = format!(
            "# {}\nunit = \"m\"\nfixed = \"fixed.obj\"\nmoving = \"moving.obj\"\n[fit]\n\
             position = {:?}\nrotation = {:?}\n",
            known.name,
            goal.translation.to_array(),
            goal.rotation.to_array()
        );
        std::fs::write(folder.join("scene.toml"), text)?;
    }
    Ok(())
}
