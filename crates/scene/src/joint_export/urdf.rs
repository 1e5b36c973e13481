//! URDF: links and joints of robots (ROS, Gazebo, Drake, PyBullet).

use std::path::Path;

use fft_correlate::Pose;
use fft_correlate::mating::JointKind;
use glam::DVec3;
use sdf_grid::atomic;

use super::error::ExportError;
use super::files::{MeshNames, write_meshes};
use super::inertia::MassProperties;
use super::motion::{Series, Step, StepKind, reach};
use super::pair::DockedPair;
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
    let names = write_meshes(pair, path)?;
    Ok(atomic::write(path, text(pair, &names).as_bytes())?)
}

/// The file's text.
fn text(pair: &DockedPair, names: &MeshNames) -> String {
    let series = Series::new(pair);
    let flag = Element::new("flag").with("contact", "disable");
    let mujoco = Element::new("mujoco").child(Element::new("option").child(flag));
    let [fixed, moving] = [pair.fixed, pair.moving].map(MassProperties::new);
    let placed = Element::new("joint")
        .with("name", pair.labelled("place"))
        .with("type", "fixed")
        .child(Element::new("parent").with("link", pair.labelled("root")))
        .child(Element::new("child").with("link", pair.labelled("fixed")))
        .child(origin(&pair.placed));
    Element::new("robot")
        .with("name", pair.label())
        .comment("Made by pegfit. At joint positions of zero the moving part lies where it docked.")
        .comment("Inertia at 1000 kg/m3; efforts and velocities are mere large numbers.")
        .comment("MuJoCo would let the convex hulls of both parts collide; others ignore this.")
        .child(mujoco)
        .child(Element::new("link").with("name", pair.labelled("root")))
        .child(link(pair, "fixed", &names.fixed, &fixed, DVec3::ZERO))
        .child(placed)
        .children(between(pair, &series, &moving))
        .children(joints(pair, &series))
        .child(link(pair, "moving", &names.moving, &moving, series.anchor))
        .document()
}

/// A part as a link whose origin is `anchor` of the part's own frame.
fn link(
    pair: &DockedPair,
    what: &str,
    mesh: &str,
    mass: &MassProperties,
    anchor: DVec3,
) -> Element {
    let shape = |name| {
        let file = Element::new("mesh").with("filename", mesh);
        Element::new(name)
            .child(origin(&Pose::from_translation(-anchor)))
            .child(Element::new("geometry").child(file))
    };
    Element::new("link")
        .with("name", pair.labelled(what))
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
fn steps(pair: &DockedPair, series: &Series) -> Vec<Step> {
    match pair.joint.kind {
        // URDF has it.
        JointKind::Planar => Vec::new(),
        _ => series.steps.clone(),
    }
}

/// Links between joints in series.
fn between(pair: &DockedPair, series: &Series, moving: &MassProperties) -> Vec<Element> {
    let count = steps(pair, series).len();
    let link = |i| {
        Element::new("link")
            .with("name", pair.labelled(&between_name(i)))
            .child(inertial(&moving.negligible()))
    };
    (1..count).map(link).collect()
}

fn between_name(i: usize) -> String {
    format!("between-{i}")
}

/// The joints between the parts; the first one stands where the moving part docked.
fn joints(pair: &DockedPair, series: &Series) -> Vec<Element> {
    let steps = steps(pair, series);
    let start = pair.pose * Pose::from_translation(series.anchor);
    let joint = |name: &str, kind: &str, from: String, to: String, at: &Pose| {
        Element::new("joint")
            .with("name", pair.labelled(name))
            .with("type", kind)
            .child(Element::new("parent").with("link", from))
            .child(Element::new("child").with("link", to))
            .child(origin(at))
    };
    if steps.is_empty() {
        let (name, kind) = match pair.joint.kind {
            JointKind::Planar => ("plane", "planar"),
            JointKind::Undetermined(_) => ("free", "floating"),
            _ => ("joint", "fixed"),
        };
        let ends = ["fixed", "moving"].map(|what| pair.labelled(what));
        let [from, to] = ends;
        let only = joint(name, kind, from, to, &start);
        let only = match pair.joint.kind {
            JointKind::Planar => only.child(axis(pair.joint.in_moving_frame(&pair.pose).0)),
            JointKind::Undetermined(count) => only.comment(undetermined(count)),
            _ => only,
        };
        return vec![only];
    }
    let last = steps.len() - 1;
    let one = |(i, step): (usize, &Step)| {
        let from = match i {
            0 => pair.labelled("fixed"),
            _ => pair.labelled(&between_name(i)),
        };
        let to = match i == last {
            true => pair.labelled("moving"),
            false => pair.labelled(&between_name(i + 1)),
        };
        let kind = match (step.kind, step.range) {
            (StepKind::Slide, _) => "prismatic",
            (StepKind::Turn, Some(_)) => "revolute",
            (StepKind::Turn, None) => "continuous",
        };
        let at = if i == 0 { start } else { Pose::IDENTITY };
        let element = joint(step.name, kind, from, to, &at)
            .child(axis(step.axis))
            .child(limit(pair, step));
        match step.follows {
            Some(factor) => element.child(
                Element::new("mimic")
                    .with("joint", pair.labelled(steps[0].name))
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

fn limit(pair: &DockedPair, step: &Step) -> Element {
    let limit = Element::new("limit");
    let range = match (step.kind, step.range) {
        // A slide must have limits.
        (StepKind::Slide, None) => Some([-reach(pair), reach(pair)]),
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
