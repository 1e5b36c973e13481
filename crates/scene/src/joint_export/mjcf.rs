//! MJCF: models of MuJoCo.

use std::path::Path;

use fft_correlate::Pose;
use fft_correlate::mating::JointKind;
use sdf_grid::atomic;

use super::error::ExportError;
use super::files::write_meshes;
use super::inertia::MassProperties;
use super::motion::{Step, StepKind};
use super::pair::DockedPair;
use super::tree::{Link, Model, PartTree};
use super::urdf::undetermined;
use super::xml::{Element, quaternion};

/// MuJoCo takes ranges with no width for none.
const NARROWEST: f64 = 1e-9;

/// Writes a docked pair as MJCF, and its meshes as `STEM-fixed.obj` and `STEM-moving.obj` beside it.
///
/// The bodies are `NAME-fixed` and `NAME-moving`, each with the frame of its part. Only the joint
/// guides the moving part: the two do not collide with each other. Gravity is off, since a scene does
/// not say where down is.
///
/// # Errors
/// If a file cannot be written, or a mesh would replace one that the pair keeps.
pub fn write_mjcf(pair: &DockedPair, path: &Path) -> Result<(), ExportError> {
    let model = Model::from(pair);
    let exclude = Element::new("exclude")
        .with("body1", model.links[0].label.clone())
        .with("body2", model.links[1].label.clone());
    write(&model, Some(exclude), path)
}

/// Writes a tree of parts as MJCF, and their meshes as `STEM-PART.obj` beside it.
///
/// The bodies are called after the parts, each with the frame of its part, in the bodies of the parts
/// that they hang from. The parts do not collide with each other, only with other things. Gravity is
/// off.
///
/// # Errors
/// If a file cannot be written, or a mesh would replace one that the tree keeps.
pub fn write_tree_mjcf(tree: &PartTree, path: &Path) -> Result<(), ExportError> {
    write(&Model::from(tree), None, path)
}

fn write(model: &Model, exclude: Option<Element>, path: &Path) -> Result<(), ExportError> {
    let meshes = write_meshes(model, path)?;
    Ok(atomic::write(
        path,
        text(model, exclude, &meshes).as_bytes(),
    )?)
}

/// The file's text; without an exclusion geoms collide by kind.
fn text(model: &Model, exclude: Option<Element>, meshes: &[String]) -> String {
    let mesh = |(link, file): (&Link, &String)| {
        Element::new("mesh")
            .with("name", link.label.clone())
            .with("file", file)
    };
    let assets = Element::new("asset").children(model.links.iter().zip(meshes).map(mesh));
    let compiler = Element::new("compiler")
        .with("angle", "radian")
        .with("autolimits", "true");
    let world = Element::new("worldbody").children(bodies(model, exclude.is_none()));
    let contact = exclude.map(|e| Element::new("contact").child(e));
    Element::new("mujoco")
        .with("model", model.name.clone())
        .comment(format!("Made by pegfit. {}", model.at_zero))
        .comment("Inertia at 1000 kg/m3. No gravity: the scene does not say where down is.")
        .child(compiler)
        .child(Element::new("option").numbers("gravity", &[0.0; 3]))
        .child(assets)
        .child(world)
        .children(contact)
        .children(couplings(model))
        .document()
}

/// The bodies of the world: those of parts that stay, with what hangs from them inside, and those of
/// parts that are free.
fn bodies(model: &Model, by_kind: bool) -> Vec<Element> {
    // Where each part lies in the scene.
    let mut at: Vec<Pose> = Vec::new();
    for link in &model.links {
        at.push(link.parent.map_or(link.pose, |p| at[p] * link.pose));
    }
    let free = |link: &Link| match link.joint.kind {
        JointKind::Undetermined(count) if link.parent.is_some() => Some(count),
        _ => None,
    };
    // What hangs from a part stands behind it.
    let mut inside: Vec<Vec<Element>> = model.links.iter().map(|_| Vec::new()).collect();
    let mut world = Vec::new();
    for (i, link) in model.links.iter().enumerate().rev() {
        let mut hanging = std::mem::take(&mut inside[i]);
        hanging.reverse();
        let element = match (link.parent, free(link)) {
            (Some(_), Some(count)) => {
                let joint = Element::new("freejoint").with("name", link.labelled("free"));
                body(link, &at[i], vec![joint], by_kind).comment(undetermined(count))
            }
            (Some(_), None) => body(link, &link.pose, joints(link), by_kind),
            (None, _) => body(link, &link.pose, Vec::new(), by_kind),
        }
        .children(hanging);
        match link.parent {
            Some(parent) if free(link).is_none() => inside[parent].push(element),
            _ => world.push(element),
        }
    }
    world.reverse();
    world
}

fn body(link: &Link, at: &Pose, joints: Vec<Element>, by_kind: bool) -> Element {
    let mass = MassProperties::new(link.mesh);
    let inertial = Element::new("inertial")
        .vector("pos", mass.centre)
        .numbers("mass", &[mass.mass])
        .numbers("fullinertia", &mass.components());
    let geom = Element::new("geom")
        .with("name", link.label.clone())
        .with("type", "mesh")
        .with("mesh", link.label.clone());
    let geom = match by_kind {
        // Of a kind that collides with the ordinary one only.
        true => geom.with("contype", "2").with("conaffinity", "1"),
        false => geom,
    };
    Element::new("body")
        .with("name", link.label.clone())
        .vector("pos", at.translation)
        .numbers("quat", &quaternion(at))
        .children(joints)
        .child(inertial)
        .child(geom)
}

/// The joints of a part's body, which MuJoCo takes in series.
fn joints(link: &Link) -> Vec<Element> {
    let series = &link.series;
    if link.joint.kind == JointKind::Ball {
        let ball = Element::new("joint")
            .with("name", link.labelled("ball"))
            .with("type", "ball")
            .vector("pos", series.anchor);
        return vec![ball];
    }
    let one = |step: &Step| {
        let kind = match step.kind {
            StepKind::Slide => "slide",
            StepKind::Turn => "hinge",
        };
        let joint = Element::new("joint")
            .with("name", link.labelled(step.name))
            .with("type", kind)
            .vector("pos", series.anchor)
            .vector("axis", step.axis);
        // What follows another joint ends where that does.
        match step.range.filter(|_| step.follows.is_none()) {
            Some([lower, upper]) => {
                let upper = upper.max(lower + NARROWEST);
                joint.numbers("range", &[lower, upper])
            }
            None => joint,
        }
    };
    series.steps.iter().map(one).collect()
}

/// What makes slides follow turns: tendons of both that keep their length. (An equality of two joints
/// would be soft: MuJoCo weighs it by the inverses of a mass and of a moment of inertia alike.)
fn couplings(model: &Model) -> Vec<Element> {
    let threads: Vec<(Element, Element)> = model.links.iter().filter_map(coupling).collect();
    if threads.is_empty() {
        return Vec::new();
    }
    let (tendons, kept): (Vec<_>, Vec<_>) = threads.into_iter().unzip();
    vec![
        Element::new("tendon").children(tendons),
        Element::new("equality").children(kept),
    ]
}

/// The tendon of a part on a thread, and what keeps its length.
fn coupling(link: &Link) -> Option<(Element, Element)> {
    let steps = &link.series.steps;
    let (step, factor) = steps.iter().find_map(|s| Some((s, s.follows?)))?;
    let part = |step: &Step, coefficient| {
        Element::new("joint")
            .with("joint", link.labelled(step.name))
            .numbers("coef", &[coefficient])
    };
    let thread = Element::new("fixed")
        .with("name", link.labelled("thread"))
        .child(part(step, 1.0))
        .child(part(&steps[0], -factor));
    let kept = Element::new("tendon")
        .with("tendon1", link.labelled("thread"))
        .numbers("solref", &[0.004, 1.0])
        .numbers("solimp", &[0.99, 0.9999, 1e-5]);
    Some((thread, kept))
}
