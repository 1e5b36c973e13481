//! Where links are when all joints stand at zero.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use fft_correlate::Pose;
use sdf_grid::{Ledger, LedgerKind};

use crate::solids::element::Element;
use crate::solids::error::ImportError;
use crate::solids::frames;
use crate::solids::urdf::known;

/// Where each link is, in the root's frame.
pub(super) fn places<'a>(
    path: &Path,
    robot: &'a Element,
    ledger: &mut Ledger,
) -> Result<HashMap<&'a str, Pose>, ImportError> {
    let mut links = HashSet::new();
    for link in robot.all("link") {
        if !links.insert(link.required(path, "name")?) {
            return Err(link.wrong(path, "links of different names", "two of this one"));
        }
    }
    let joints = joints(path, robot, &links, ledger)?;
    let mut places = HashMap::new();
    let mut roots = Vec::new();
    for link in robot.all("link") {
        let name = link.required(path, "name")?;
        let (mut pose, mut at, mut steps) = (Pose::IDENTITY, name, 0);
        while let Some((parent, origin)) = joints.get(at) {
            pose = *origin * pose;
            at = parent;
            steps += 1;
            if steps > joints.len() {
                return Err(link.wrong(path, "a tree of joints", "a circle"));
            }
        }
        if steps == 0 {
            roots.push(name);
        }
        places.insert(name, pose);
    }
    match roots[..] {
        [] | [_] => Ok(places),
        _ => {
            let found = format!("{} that no joint moves: {}", roots.len(), roots.join(", "));
            Err(robot.wrong(path, "one link that is the root of all others", found))
        }
    }
}

/// Child to parent and where the child is in it.
fn joints<'a>(
    path: &Path,
    robot: &'a Element,
    links: &HashSet<&str>,
    ledger: &mut Ledger,
) -> Result<HashMap<&'a str, (&'a str, Pose)>, ImportError> {
    let mut joints: HashMap<&str, (&str, Pose)> = HashMap::new();
    for joint in robot.all("joint") {
        let end = |name: &str| {
            let end = joint.children.iter().find(|c| c.name == name);
            let end = end.ok_or_else(|| joint.wrong(path, format!("a <{name}>"), "none"))?;
            let link = end.required(path, "link")?;
            match links.contains(link) {
                true => Ok(link),
                false => Err(end.wrong(path, "a link of this file", format!("{link:?}"))),
            }
        };
        let (parent, child) = (end("parent")?, end("child")?);
        if joints
            .insert(child, (parent, origin(path, joint)?))
            .is_some()
        {
            let expected = format!("one joint whose child is {child:?}");
            return Err(joint.wrong(path, expected, "a second one"));
        }
        if joint.attribute("type") != Some("fixed") {
            ledger.add(LedgerKind::Assumed, "joint", standing(path, joint)?);
        }
    }
    Ok(joints)
}

/// What is assumed of where a joint stands.
fn standing(path: &Path, joint: &Element) -> Result<&'static str, ImportError> {
    let number = |holder: &str, name: &str| -> Result<f64, ImportError> {
        let found = joint.child(holder).map(|h| h.numbers::<1>(path, name));
        Ok(found.transpose()?.flatten().map_or(0.0, |[x]| x))
    };
    if number("mimic", "offset")? != 0.0 {
        return Ok("stands at zero, although it is to mimic another with an offset");
    }
    if number("limit", "lower")? > 0.0 || number("limit", "upper")? < 0.0 {
        return Ok("stands at zero, which is beyond its limits");
    }
    Ok("stands at zero")
}

/// Where an element is in what holds it.
pub(super) fn origin(path: &Path, element: &Element) -> Result<Pose, ImportError> {
    let Some(origin) = element.child("origin") else {
        return Ok(Pose::IDENTITY);
    };
    known::attributes(path, origin, &["xyz", "rpy"])?;
    let position = origin.numbers::<3>(path, "xyz")?.unwrap_or_default();
    let turn = origin.numbers::<3>(path, "rpy")?.unwrap_or_default();
    Ok(frames::pose(frames::roll_pitch_yaw(turn), position))
}
