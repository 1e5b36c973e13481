//! Assemblies whose places are known, their parts scattered, and a judge of what is found.

use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use fft_correlate::mating::{MatingSearch, MatingSearchOptions};
use fft_correlate::{Pose, symmetry_group};
use glam::DVec3;
use pegfit_assemble::{Assembly, LoosePart};
use pegfit_fixtures::{Freedom, KnownAssembly, KnownPart};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{
    Bvh, InterferenceQuery, LengthUnit, RepairOptions, TriangleMesh, congruence, mesh_io, symmetry,
};
use serde_json::Value;

use crate::Outcome;
use crate::assemblies::random_rotation;

/// A part is in its place within this share of its diagonal.
const NEAR: f64 = 0.02;

/// Parts are equal up to this share of their diagonal.
const EQUAL: f64 = 1e-3;

/// Motions that are tried over a freedom.
const TRIED: u32 = 72;

/// The assembly of a folder: parts as OBJ files where they belong, and `assembly.json` with the unit
/// and the names of the parts.
///
/// # Errors
/// If a file cannot be read or says something else.
pub fn read(folder: &Path) -> Outcome<KnownAssembly> {
    let file = folder.join("assembly.json");
    let wrong = |what: &str| format!("{}: {what}", file.display());
    let found: Value = serde_json::from_slice(&std::fs::read(&file)?)
        .map_err(|error| wrong(&error.to_string()))?;
    let unit = found["unit"].as_str().ok_or_else(|| wrong("no unit"))?;
    let unit: LengthUnit = unit.parse()?;
    let names = found["parts"].as_array().ok_or_else(|| wrong("no parts"))?;
    let part = |name: &Value| -> Outcome<KnownPart> {
        let name = name
            .as_str()
            .ok_or_else(|| wrong("a part without a name"))?;
        let path = folder.join(format!("{name}.obj"));
        let (mesh, _) = mesh_io::read(path, unit, &RepairOptions::default())?;
        let name = name.to_owned();
        Ok(KnownPart { name, mesh })
    };
    let name = folder.file_name().unwrap_or(folder.as_os_str());
    Ok(KnownAssembly {
        name: name.to_string_lossy().into_owned(),
        parts: names.iter().map(part).collect::<Outcome<_>>()?,
        strangers: Vec::new(),
        groups: Vec::new(),
    })
}

/// The parts and the strangers of an assembly, each moved at random; as they lie with the seed 0.
pub fn scattered(known: &KnownAssembly, seed: u64) -> Vec<LoosePart> {
    let mut rng = SmallRng::seed_from_u64(seed);
    let mut place = |part: &KnownPart| {
        let rotation = random_rotation(&mut rng);
        let reach = part.mesh.bounds().diagonal();
        let shift = reach * DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        let mesh = match seed {
            0 => part.mesh.clone(),
            _ => part.mesh.transformed(rotation, shift),
        };
        LoosePart {
            name: part.name.clone(),
            mesh: Arc::new(mesh),
        }
    };
    let mut parts: Vec<LoosePart> = known.parts.iter().map(&mut place).collect();
    parts.extend(known.strangers.iter().map(&mut place));
    parts
}

/// How right an assembly is.
#[derive(Debug, Clone)]
pub struct Verdict {
    /// Parts in their places relative to the others, up to symmetry and to equal parts.
    pub right: usize,
    /// Names of those that are not.
    pub wrong: Vec<String>,
    /// Strangers that were placed.
    pub strangers: usize,
    /// Volume that parts share, of the smallest of them all.
    pub overlap: f64,
}

impl Verdict {
    /// Whether every part is in its place, and nothing else is there.
    pub fn is_right(&self) -> bool {
        self.wrong.is_empty() && self.strangers == 0
    }
}

/// How well contact holds the parts where they belong, as the search counts it: each in the rest,
/// halved, nats.
pub fn known_score(known: &KnownAssembly) -> f64 {
    let held = |i: usize| {
        let others = known.parts.iter().enumerate().filter(|(j, _)| *j != i);
        let rest = TriangleMesh::joined(others.map(|(_, part)| &part.mesh));
        let search = MatingSearch::new(&rest, &known.parts[i].mesh, MatingSearchOptions::default());
        search.measure(&Pose::IDENTITY).rank
    };
    0.5 * (0..known.parts.len()).map(held).sum::<f64>()
}

/// A surface where it was found.
struct Found {
    mesh: TriangleMesh,
    bvh: Bvh,
}

/// Judges an assembly of scattered parts.
pub fn judge(known: &KnownAssembly, parts: &[LoosePart], assembly: &Assembly) -> Verdict {
    let found: Vec<Found> = (assembly.placed.iter())
        .map(|p| {
            let mesh = parts[p.part]
                .mesh
                .transformed(p.pose.rotation, p.pose.translation);
            let bvh = Bvh::build(&mesh);
            Found { mesh, bvh }
        })
        .collect();
    let free = |i: usize| known.groups.iter().any(|(group, _)| group.contains(&i));
    let fixed: Vec<usize> = (0..known.parts.len()).filter(|i| !free(*i)).collect();
    let mut best: Option<Vec<usize>> = None;
    // Each part that does not move, over each equal part that was placed, tells a motion of the whole.
    for motion in fixed
        .iter()
        .flat_map(|i| motions(&known.parts[*i].mesh, &found))
    {
        let right = right_parts(known, &fixed, &found, &motion);
        if best.as_ref().is_none_or(|b| b.len() < right.len()) {
            best = Some(right);
        }
    }
    let right = best.unwrap_or_default();
    let wrong = known
        .parts
        .iter()
        .enumerate()
        .filter(|(i, _)| !right.contains(i));
    let strangers = assembly
        .placed
        .iter()
        .filter(|p| p.part >= known.parts.len());
    Verdict {
        right: right.len(),
        wrong: wrong.map(|(_, part)| part.name.clone()).collect(),
        strangers: strangers.count(),
        overlap: overlap(&found),
    }
}

/// Motions of a part where it belongs to equal parts where they were found.
fn motions(part: &TriangleMesh, found: &[Found]) -> Vec<Pose> {
    let tolerance = EQUAL * part.bounds().diagonal();
    let group = symmetry_group(&symmetry::detect(part, tolerance));
    let to = |f: &Found| congruence(part, &f.mesh, tolerance);
    let poses = found.iter().filter_map(to).map(|(q, t)| Pose::new(q, t));
    poses
        .flat_map(|pose| group.iter().map(move |s| pose * *s))
        .collect()
}

/// Parts that lie right when a motion takes the whole to where it was found.
fn right_parts(
    known: &KnownAssembly,
    fixed: &[usize],
    found: &[Found],
    motion: &Pose,
) -> Vec<usize> {
    let mut left: Vec<&Found> = found.iter().collect();
    let mut right = Vec::new();
    let stay = (fixed.to_vec(), Freedom::Fixed);
    for (group, freedom) in std::iter::once(&stay).chain(&known.groups) {
        // The motion of the group by which most of its parts lie right.
        let mut best: Vec<(usize, usize)> = Vec::new();
        for step in steps(*freedom) {
            let mut there: Vec<(usize, usize)> = Vec::new();
            for i in group {
                let lies = |(at, f): &(usize, &&Found)| {
                    there.iter().all(|(_, used)| used != at)
                        && coincides(&known.parts[*i].mesh, &(*motion * step), f)
                };
                let at = left.iter().enumerate().find(lies).map(|(at, _)| at);
                there.extend(at.map(|at| (*i, at)));
            }
            if best.len() < there.len() {
                best = there;
            }
            if best.len() == group.len() {
                break;
            }
        }
        right.extend(best.iter().map(|(i, _)| *i));
        let mut used: Vec<usize> = best.iter().map(|(_, at)| *at).collect();
        used.sort_unstable();
        for at in used.iter().rev() {
            left.swap_remove(*at);
        }
    }
    right
}

/// Motions over a freedom, none first.
fn steps(freedom: Freedom) -> Vec<Pose> {
    let about = |axis: DVec3, point: DVec3, angle: f64| {
        let rotation = glam::DQuat::from_axis_angle(axis, angle);
        Pose::new(rotation, point - rotation * point)
    };
    let share = |i: u32| f64::from(i) / f64::from(TRIED);
    let over = |[low, high]: [f64; 2], i: u32| low + (high - low) * share(i);
    let step = |i: u32| match freedom {
        Freedom::Revolute { axis, point } => about(axis, point, TAU * share(i)),
        Freedom::Prismatic { axis, range } => Pose::from_translation(over(range, i) * axis),
        Freedom::Screw {
            axis,
            point,
            pitch,
            range,
        } => {
            let turns = over(range, i);
            Pose::from_translation(pitch * turns * axis) * about(axis, point, TAU * turns)
        }
        _ => Pose::IDENTITY,
    };
    let all = (0..=TRIED).map(step);
    std::iter::once(Pose::IDENTITY).chain(all).collect()
}

/// Whether a part moved by a motion lies where an equal one was found: no vertex of either is farther
/// from the other's surface.
fn coincides(part: &TriangleMesh, motion: &Pose, found: &Found) -> bool {
    let near = NEAR * part.bounds().diagonal();
    let (a, b) = (part.volume(), found.mesh.volume());
    let middle = motion.apply(part.centroid());
    if (a - b).abs() > 0.01 * a || middle.distance(found.mesh.centroid()) > near {
        return false;
    }
    (part.vertices().iter()).all(|v| found.bvh.nearest(motion.apply(*v)).distance <= near) && {
        let back = motion.inverse();
        let bvh = Bvh::build(part);
        (found.mesh.vertices().iter()).all(|v| bvh.nearest(back.apply(*v)).distance <= near)
    }
}

/// The largest volume that two parts share, of the smallest part.
fn overlap(found: &[Found]) -> f64 {
    let smallest = found
        .iter()
        .map(|f| f.mesh.volume())
        .fold(f64::INFINITY, f64::min);
    let mut most: f64 = 0.0;
    for (i, a) in found.iter().enumerate() {
        for b in &found[..i] {
            let query = InterferenceQuery::new(&a.mesh, &b.mesh);
            let still = Pose::IDENTITY;
            most = most.max(query.at(still.rotation, still.translation).volume);
        }
    }
    most / smallest
}
