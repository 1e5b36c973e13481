//! MJCF: models of MuJoCo.

use std::path::Path;

use fft_correlate::Pose;
use fft_correlate::mating::JointKind;
use sdf_grid::atomic;

use super::error::ExportError;
use super::files::{MeshNames, write_meshes};
use super::inertia::MassProperties;
use super::motion::{Series, Step, StepKind};
use super::pair::DockedPair;
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
    let names = write_meshes(pair, path)?;
    Ok(atomic::write(path, text(pair, &names).as_bytes())?)
}

/// The file's text.
fn text(pair: &DockedPair, names: &MeshNames) -> String {
    let series = Series::new(pair);
    let mesh = |what: &str, file: &str| {
        Element::new("mesh")
            .with("name", pair.labelled(what))
            .with("file", file)
    };
    let assets = Element::new("asset")
        .child(mesh("fixed", &names.fixed))
        .child(mesh("moving", &names.moving));
    let exclude = Element::new("exclude")
        .with("body1", pair.labelled("fixed"))
        .with("body2", pair.labelled("moving"));
    let compiler = Element::new("compiler")
        .with("angle", "radian")
        .with("autolimits", "true");
    Element::new("mujoco")
        .with("model", pair.label())
        .comment("Made by pegfit. At joint positions of zero the moving part lies where it docked.")
        .comment("Inertia at 1000 kg/m3. No gravity: the scene does not say where down is.")
        .child(compiler)
        .child(Element::new("option").numbers("gravity", &[0.0; 3]))
        .child(assets)
        .child(Element::new("worldbody").children(bodies(pair, &series)))
        .child(Element::new("contact").child(exclude))
        .children(coupling(pair, &series))
        .document()
}

/// The fixed part's body with the moving one in it; beside it if that is free.
fn bodies(pair: &DockedPair, series: &Series) -> Vec<Element> {
    let fixed = body(pair, "fixed", &pair.placed, Vec::new());
    match pair.joint.kind {
        JointKind::Undetermined(count) => {
            let free = Element::new("freejoint").with("name", pair.labelled("free"));
            let at = pair.placed * pair.pose;
            let moving = body(pair, "moving", &at, vec![free]).comment(undetermined(count));
            vec![fixed, moving]
        }
        _ => vec![fixed.child(body(pair, "moving", &pair.pose, joints(pair, series)))],
    }
}

fn body(pair: &DockedPair, what: &str, at: &Pose, joints: Vec<Element>) -> Element {
    let mesh = if what == "fixed" {
        pair.fixed
    } else {
        pair.moving
    };
    let mass = MassProperties::new(mesh);
    let inertial = Element::new("inertial")
        .vector("pos", mass.centre)
        .numbers("mass", &[mass.mass])
        .numbers("fullinertia", &mass.components());
    let geom = Element::new("geom")
        .with("name", pair.labelled(what))
        .with("type", "mesh")
        .with("mesh", pair.labelled(what));
    Element::new("body")
        .with("name", pair.labelled(what))
        .vector("pos", at.translation)
        .numbers("quat", &quaternion(at))
        .children(joints)
        .child(inertial)
        .child(geom)
}

/// The joints of the moving part's body, which MuJoCo takes in series.
fn joints(pair: &DockedPair, series: &Series) -> Vec<Element> {
    if pair.joint.kind == JointKind::Ball {
        let ball = Element::new("joint")
            .with("name", pair.labelled("ball"))
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
            .with("name", pair.labelled(step.name))
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

/// What makes a slide follow a turn: a tendon of both that keeps its length. (An equality of two joints
/// would be soft: MuJoCo weighs it by the inverses of a mass and of a moment of inertia alike.)
fn coupling(pair: &DockedPair, series: &Series) -> Vec<Element> {
    let follower = series.steps.iter().find_map(|s| Some((s, s.follows?)));
    let Some((step, factor)) = follower else {
        return Vec::new();
    };
    let part = |step: &Step, coefficient| {
        Element::new("joint")
            .with("joint", pair.labelled(step.name))
            .numbers("coef", &[coefficient])
    };
    let thread = Element::new("fixed")
        .with("name", pair.labelled("thread"))
        .child(part(step, 1.0))
        .child(part(&series.steps[0], -factor));
    let kept = Element::new("tendon")
        .with("tendon1", pair.labelled("thread"))
        .numbers("solref", &[0.004, 1.0])
        .numbers("solimp", &[0.99, 0.9999, 1e-5]);
    vec![
        Element::new("tendon").child(thread),
        Element::new("equality").child(kept),
    ]
}
