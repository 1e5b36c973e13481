//! URDF, the robots of ROS: shapes of links, places of links at zero joints, and what is refused.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use glam::DVec3;
use sdf_grid::text::quoted;
use sdf_grid::{Ledger, LedgerKind};

use crate::solids::element::Element;
use crate::solids::error::ImportError;
use crate::solids::geometry;
use crate::solids::geometry::{Geometry, SEGMENTS, Shape};

/// Every shape of every link, in the frame of the root link; joints stand at zero.
pub(crate) fn shapes(
    path: &Path,
    robot: &Element,
    visual: bool,
    ledger: &mut Ledger,
) -> Result<Vec<Shape>, ImportError> {
    no_macros(path, robot)?;
    others(path, robot, &["link", "joint"], ledger)?;
    let places = link_poses(path, robot, ledger)?;
    let mut found = Vec::new();
    for (group, link) in robot.all("link").enumerate() {
        others(path, link, &["visual", "collision"], ledger)?;
        let name = link.required(path, "name")?;
        let place = places.get(name).copied().unwrap_or_default();
        let kind = chosen(link, visual, ledger);
        for element in link.all(kind) {
            others(path, element, &["origin", "geometry"], ledger)?;
            let geometry = geometry(path, element, ledger)?;
            ledger.add(LedgerKind::Read, &format!("{kind} {}", geometry.kind()), "");
            if geometry.is_faceted() {
                let facets = format!("facets, {SEGMENTS} around a full turn");
                ledger.add(LedgerKind::Assumed, "curved shape", &facets);
            }
            found.push(Shape {
                name: name.to_owned(),
                group,
                pose: place * origin(path, element)?,
                geometry,
            });
        }
    }
    Ok(found)
}

/// The kind of a link's shapes that count: those to collide with, or those to look at (`visual`), or
/// whichever it has.
fn chosen(link: &Element, visual: bool, ledger: &mut Ledger) -> &'static str {
    let (first, second, why) = match visual {
        true => (
            "visual",
            "collision",
            "--visual, and its link has visual shapes",
        ),
        false => (
            "collision",
            "visual",
            "its link has shapes to collide with; --visual takes the visual ones instead",
        ),
    };
    let others = link.all(second).count() as u64;
    if link.child(first).is_some() {
        ledger.add_many(LedgerKind::Ignored, &format!("<{second}>"), why, others);
        return first;
    }
    let reason = format!("a solid: its link has no <{first}>");
    ledger.add_many(LedgerKind::Assumed, &format!("<{second}>"), &reason, others);
    second
}

fn geometry(path: &Path, element: &Element, ledger: &mut Ledger) -> Result<Geometry, ImportError> {
    let shapes = element.all("geometry").flat_map(|g| &g.children);
    let shapes: Vec<&Element> = shapes.collect();
    let [shape] = shapes[..] else {
        let found = format!("{} shapes", shapes.len());
        return Err(element.wrong(path, "a <geometry> of one shape", found));
    };
    let number = |name: &str| match shape.numbers::<1>(path, name)? {
        Some([number]) => Ok(number),
        None => Err(shape.wrong(path, format!("an attribute {}", quoted(name)), "none")),
    };
    let read: &[&str] = match shape.name.as_str() {
        "mesh" => &["filename", "scale"],
        "box" => &["size"],
        "cylinder" => &["radius", "length"],
        "sphere" => &["radius"],
        other => return Err(element.wrong(path, "mesh, box, cylinder or sphere", other)),
    };
    attributes(path, shape, read)?;
    Ok(match shape.name.as_str() {
        "mesh" => Geometry::Mesh {
            path: resolve(path, shape, ledger)?,
            scale: DVec3::from(shape.numbers::<3>(path, "scale")?.unwrap_or([1.0; 3])),
        },
        "box" => match shape.numbers::<3>(path, "size")? {
            Some(size) => Geometry::Box(DVec3::from(size)),
            None => return Err(shape.wrong(path, "an attribute \"size\"", "none")),
        },
        "cylinder" => Geometry::Cylinder {
            radius: number("radius")?,
            height: number("length")?,
        },
        _ => Geometry::Sphere(number("radius")?),
    })
}

/// Where each link is, in the root's frame.
pub(super) fn link_poses<'a>(
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
                false => Err(end.wrong(path, "a link of this file", quoted(link))),
            }
        };
        let (parent, child) = (end("parent")?, end("child")?);
        if joints
            .insert(child, (parent, origin(path, joint)?))
            .is_some()
        {
            let expected = format!("one joint whose child is {}", quoted(child));
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
    attributes(path, origin, &["xyz", "rpy"])?;
    let position = origin.numbers::<3>(path, "xyz")?.unwrap_or_default();
    let turn = origin.numbers::<3>(path, "rpy")?.unwrap_or_default();
    Ok(geometry::pose(geometry::roll_pitch_yaw(turn), position))
}

/// Elements that say nothing of shapes and places, whatever is in them, and what they are for.
const ASIDE: [(&str, &str); 7] = [
    ("material", "colours are not used"),
    ("inertial", "masses are not used"),
    ("transmission", "actuators are not used"),
    ("gazebo", "a simulator's settings"),
    ("ros2_control", "actuators are not used"),
    ("mujoco", "a simulator's settings"),
    ("sensor", "sensors are not used"),
];

/// Elements that make or change a shape, in whatever they stand.
const SHAPES: [&str; 6] = [
    "link",
    "joint",
    "visual",
    "collision",
    "geometry",
    "include",
];

/// Refuses a file that is written for xacro.
pub(super) fn no_macros(path: &Path, element: &Element) -> Result<(), ImportError> {
    let expected = "URDF: expand it with xacro first (xacro robot.xacro > robot.urdf)";
    if element.name.starts_with("xacro:") {
        return Err(element.wrong(path, expected, "a macro"));
    }
    for (name, text) in element.attributes() {
        let unexpanded = text.contains("${") || text.contains("$(");
        if unexpanded || name.starts_with("xacro:") {
            return Err(element.wrong(path, expected, format!("{name}={}", quoted(text))));
        }
    }
    element.children.iter().try_for_each(|c| no_macros(path, c))
}

/// Lists the elements in `holder` that are not `read`; refuses those that could change a shape.
pub(super) fn others(
    path: &Path,
    holder: &Element,
    read: &[&str],
    ledger: &mut Ledger,
) -> Result<(), ImportError> {
    for child in &holder.children {
        if read.contains(&child.name.as_str()) {
            continue;
        }
        let aside = ASIDE.iter().find(|(name, _)| *name == child.name);
        if aside.is_none() && has_shape(child) {
            let expected = format!("{} in it", list(read));
            return Err(holder.wrong(path, expected, format!("<{}>", child.name)));
        }
        let reason = aside.map_or(
            "URDF gives it no meaning for shapes and places",
            |(_, why)| *why,
        );
        ledger.add(LedgerKind::Ignored, &format!("<{}>", child.name), reason);
    }
    Ok(())
}

/// Refuses attributes that are not read.
pub(super) fn attributes(path: &Path, element: &Element, read: &[&str]) -> Result<(), ImportError> {
    match element.attributes().find(|(name, _)| !read.contains(name)) {
        Some((name, text)) => {
            let expected = format!("the attributes {}", read.join(", "));
            Err(element.wrong(path, expected, format!("{name}={}", quoted(text))))
        }
        None => Ok(()),
    }
}

fn has_shape(element: &Element) -> bool {
    let name = element.name.rsplit(':').next().unwrap_or_default();
    SHAPES.contains(&name) || element.children.iter().any(has_shape)
}

fn list(names: &[&str]) -> String {
    let names: Vec<String> = names.iter().map(|n| format!("<{n}>")).collect();
    names.join(", ")
}

/// Relative to the description, or, of `package://name/rest`, `name/rest` in a folder above it, or
/// else `rest` in one.
pub(super) fn resolve(
    path: &Path,
    mesh: &Element,
    ledger: &mut Ledger,
) -> Result<PathBuf, ImportError> {
    let name = mesh.required(path, "filename")?;
    let file = located(path, mesh, name, ledger)?;
    let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("dae") => {
            let expected = "an .obj, .stl, .ply, .glb or .3mf file (Blender, assimp and trimesh \
                            convert Collada)";
            return Err(mesh.wrong(path, expected, quoted(name)));
        }
        Some("glb" | "gltf") => {
            ledger.add(
                LedgerKind::Assumed,
                "axes of a mesh",
                "as its glTF file has them",
            );
        }
        _ => {}
    }
    Ok(file)
}

fn located(
    path: &Path,
    mesh: &Element,
    name: &str,
    ledger: &mut Ledger,
) -> Result<PathBuf, ImportError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let name = name.strip_prefix("file://").unwrap_or(name);
    let package = name
        .strip_prefix("package://")
        .or(name.strip_prefix("model://"));
    let Some(package) = package else {
        return Ok(folder.join(name));
    };
    let rest = package.split_once('/').map_or(package, |(_, rest)| rest);
    let here = match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    };
    let absolute = here.canonicalize().unwrap_or(folder.to_owned());
    let above = |wanted: &str| {
        let mut candidates = absolute.ancestors().map(|folder| folder.join(wanted));
        candidates.find(|candidate| candidate.is_file())
    };
    if let Some(found) = above(package) {
        return Ok(found);
    }
    let Some(found) = above(rest) else {
        let expected = format!("{package} or {rest} in a folder above the file");
        return Err(mesh.wrong(path, expected, "none"));
    };
    let package = package.split('/').next().unwrap_or_default();
    let item = format!("folder of package {}", quoted(package));
    let folder = found.to_string_lossy();
    let folder = folder.strip_suffix(rest).unwrap_or(&folder);
    ledger.add(LedgerKind::Assumed, &item, folder);
    Ok(found)
}
