//! URDF: links and joints of robots (ROS, Gazebo, Drake, PyBullet).

use std::path::Path;

use fft_correlate::Pose;
use fft_correlate::mating::JointKind;
use glam::DVec3;
use sdf_grid::atomic;

use super::error::ExportError;
use super::files::write_meshes;
use super::inertia::MassProperties;
use super::motion::{Step, StepKind};
use super::pair::DockedPair;
use super::tree::{Link, Model, PartTree};
use super::xml::{Element, roll_pitch_yaw};

/// URDF asks for the greatest force and speed of every joint; contact does not tell them.
const EFFORT: f64 = 1000.0;
const VELOCITY: f64 = 10.0;

/// Writes a docked pair as URDF, and its meshes as `STEM-fixed.obj` and `STEM-moving.obj` beside it.
///
/// The links are `NAME-root`, which is the scene, `NAME-fixed` and `NAME-moving`. URDF has neither
/// cylindrical joints nor screws nor balls: these are joints in series through links of next to no
/// mass, and a screw's slide mimics its turn.
///
/// # Errors
/// If a file cannot be written, or a mesh would replace one that the pair keeps.
pub fn write_urdf(pair: &DockedPair, path: &Path) -> Result<(), ExportError> {
    write(&Model::from(pair), path)
}

/// Writes a tree of parts as URDF, and their meshes as `STEM-PART.obj` beside it.
///
/// The links are called after the parts, the first one is `NAME-root`, which is the scene. Joints are
/// written as those of a pair ([`write_urdf`]).
///
/// # Errors
/// If a file cannot be written, or a mesh would replace one that the tree keeps.
pub fn write_tree_urdf(tree: &PartTree, path: &Path) -> Result<(), ExportError> {
    write(&Model::from(tree), path)
}

fn write(model: &Model, path: &Path) -> Result<(), ExportError> {
    let meshes = write_meshes(model, path)?;
    Ok(atomic::write(path, text(model, &meshes).as_bytes())?)
}

/// The file's text.
fn text(model: &Model, meshes: &[String]) -> String {
    let flag = Element::new("flag").with("contact", "disable");
    let mujoco = Element::new("mujoco").child(Element::new("option").child(flag));
    let parts = model.links.iter().zip(meshes);
    Element::new("robot")
        .with("name", model.name.clone())
        .comment(format!("Made by pegfit. {}", model.at_zero))
        .comment("Inertia at 1000 kg/m3; efforts and velocities are mere large numbers.")
        .comment("MuJoCo would let the convex hulls of the parts collide; others ignore this.")
        .child(mujoco)
        .child(Element::new("link").with("name", model.root.clone()))
        .children(parts.flat_map(|(link, mesh)| part(model, link, mesh)))
        .document()
}

/// A part's link, and the joints that it hangs from with the links between them.
fn part(model: &Model, link: &Link, mesh: &str) -> Vec<Element> {
    let mass = MassProperties::new(link.mesh);
    let body = body(link, mesh, &mass);
    let Some(parent) = link.parent.map(|p| &model.links[p]) else {
        let placed = Element::new("joint")
            .with("name", link.labelled("place"))
            .with("type", "fixed")
            .child(Element::new("parent").with("link", model.root.clone()))
            .child(Element::new("child").with("link", link.label.clone()))
            .child(origin(&link.pose));
        return vec![body, placed];
    };
    let mut elements = between(link, &mass);
    elements.extend(joints(link, parent));
    elements.push(body);
    elements
}

/// A part as a link whose origin is the anchor of its joint.
fn body(link: &Link, mesh: &str, mass: &MassProperties) -> Element {
    let anchor = link.series.anchor;
    let shape = |name| {
        let file = Element::new("mesh").with("filename", mesh);
        Element::new(name)
            .child(origin(&Pose::from_translation(-anchor)))
            .child(Element::new("geometry").child(file))
    };
    Element::new("link")
        .with("name", link.label.clone())
        .child(inertial(&mass.moved(-anchor)))
        .child(shape("visual"))
        .child(shape("collision"))
}

fn inertial(mass: &MassProperties) -> Element {
    let keys = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"];
    let inertia = (keys.iter().zip(mass.components()))
        .fold(Element::new("inertia"), |e, (key, value)| {
            e.numbers(key, &[value])
        });
    Element::new("inertial")
        .child(origin(&Pose::from_translation(mass.centre)))
        .child(Element::new("mass").numbers("value", &[mass.mass]))
        .child(inertia)
}

fn origin(pose: &Pose) -> Element {
    Element::new("origin")
        .vector("xyz", pose.translation)
        .numbers("rpy", &roll_pitch_yaw(pose))
}

/// The joints in series of a kind that URDF lacks, or one.
fn steps<'a>(link: &'a Link) -> &'a [Step] {
    match link.joint.kind {
        // URDF has it.
        JointKind::Planar => &[],
        _ => &link.series.steps,
    }
}

/// Links between joints in series.
fn between(link: &Link, mass: &MassProperties) -> Vec<Element> {
    let count = steps(link).len();
    let between = |i| {
        Element::new("link")
            .with("name", link.labelled(&between_name(i)))
            .child(inertial(&mass.negligible()))
    };
    (1..count).map(between).collect()
}

fn between_name(i: usize) -> String {
    format!("between-{i}")
}

/// The joints between a part and its parent; the first one stands where the part docked.
fn joints(link: &Link, parent: &Link) -> Vec<Element> {
    let (steps, series) = (steps(link), &link.series);
    let start = Pose::from_translation(-parent.series.anchor)
        * link.pose
        * Pose::from_translation(series.anchor);
    let joint = |name: &str, kind: &str, from: String, to: String, at: &Pose| {
        Element::new("joint")
            .with("name", link.labelled(name))
            .with("type", kind)
            .child(Element::new("parent").with("link", from))
            .child(Element::new("child").with("link", to))
            .child(origin(at))
    };
    let (above, below) = (parent.label.clone(), link.label.clone());
    if steps.is_empty() {
        let (name, kind) = match link.joint.kind {
            JointKind::Planar => ("plane", "planar"),
            JointKind::Undetermined(_) => ("free", "floating"),
            _ => ("joint", "fixed"),
        };
        let only = joint(name, kind, above, below, &start);
        let only = match link.joint.kind {
            JointKind::Planar => only.child(axis(link.joint.in_moving_frame(&link.pose).0)),
            JointKind::Undetermined(count) => only.comment(undetermined(count)),
            _ => only,
        };
        return vec![only];
    }
    let last = steps.len() - 1;
    let one = |(i, step): (usize, &Step)| {
        let from = match i {
            0 => above.clone(),
            _ => link.labelled(&between_name(i)),
        };
        let to = match i == last {
            true => below.clone(),
            false => link.labelled(&between_name(i + 1)),
        };
        let kind = match (step.kind, step.range) {
            (StepKind::Slide, _) => "prismatic",
            (StepKind::Turn, Some(_)) => "revolute",
            (StepKind::Turn, None) => "continuous",
        };
        let at = if i == 0 { start } else { Pose::IDENTITY };
        let element = joint(step.name, kind, from, to, &at)
            .child(axis(step.axis))
            .child(limit(series.reach, step));
        match step.follows {
            Some(factor) => element.child(
                Element::new("mimic")
                    .with("joint", link.labelled(steps[0].name))
                    .numbers("multiplier", &[factor])
                    .numbers("offset", &[0.0]),
            ),
            None => element,
        }
    };
    steps.iter().enumerate().map(one).collect()
}

fn axis(axis: DVec3) -> Element {
    Element::new("axis").vector("xyz", axis)
}

fn limit(reach: f64, step: &Step) -> Element {
    let limit = Element::new("limit");
    let range = match (step.kind, step.range) {
        // A slide must have limits.
        (StepKind::Slide, None) => Some([-reach, reach]),
        (_, range) => range,
    };
    let limit = match range {
        Some([lower, upper]) => limit.numbers("lower", &[lower]).numbers("upper", &[upper]),
        None => limit,
    };
    limit
        .numbers("effort", &[EFFORT])
        .numbers("velocity", &[VELOCITY])
}

/// What a reader should know of a pose that contact does not determine.
pub(super) fn undetermined(count: usize) -> String {
    format!(
        "Contact does not determine the pose: {count} motions are free, of no joint known here."
    )
}
