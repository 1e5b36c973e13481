//! Links of a URDF file at zero joint positions.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use glam::DVec3;

use crate::solids::element::Element;
use crate::solids::error::ImportError;
use crate::solids::frames;
use crate::solids::geometry::{Geometry, Shape};

/// Every shape of every link, in the frame of the root link; joints stand at zero.
pub(super) fn shapes(
    path: &Path,
    robot: &Element,
    visual: bool,
) -> Result<Vec<Shape>, ImportError> {
    let places = places(path, robot)?;
    let mut found = Vec::new();
    for (group, link) in robot.all("link").enumerate() {
        let name = link.required(path, "name")?;
        let place = places.get(name).copied().unwrap_or_default();
        let (first, second) = match visual {
            true => ("visual", "collision"),
            false => ("collision", "visual"),
        };
        let kind = if link.child(first).is_some() {
            first
        } else {
            second
        };
        for element in link.all(kind) {
            let Some(geometry) = geometry(path, element)? else {
                continue;
            };
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

/// Where each link is, in the root's frame.
fn places(path: &Path, robot: &Element) -> Result<HashMap<String, Pose>, ImportError> {
    // Child to parent and where the child is in it.
    let mut joints: HashMap<&str, (&str, Pose)> = HashMap::new();
    for joint in robot.all("joint") {
        let end = |name| {
            let end = joint.child(name);
            let end = end.ok_or_else(|| joint.wrong(path, format!("a <{name}>"), "none"))?;
            end.required(path, "link")
        };
        joints.insert(end("child")?, (end("parent")?, origin(path, joint)?));
    }
    let mut places = HashMap::new();
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
        places.insert(name.to_owned(), pose);
    }
    Ok(places)
}

fn origin(path: &Path, element: &Element) -> Result<Pose, ImportError> {
    let Some(origin) = element.child("origin") else {
        return Ok(Pose::IDENTITY);
    };
    let position = origin.numbers::<3>(path, "xyz")?.unwrap_or_default();
    let turn = origin.numbers::<3>(path, "rpy")?.unwrap_or_default();
    Ok(frames::pose(frames::roll_pitch_yaw(turn), position))
}

fn geometry(path: &Path, element: &Element) -> Result<Option<Geometry>, ImportError> {
    let Some(geometry) = element.child("geometry") else {
        return Ok(None);
    };
    let Some(shape) = geometry.children.first() else {
        return Ok(None);
    };
    let number = |name: &str| match shape.numbers::<1>(path, name)? {
        Some([number]) => Ok(number),
        None => Err(shape.wrong(path, format!("an attribute {name:?}"), "none")),
    };
    Ok(Some(match shape.name.as_str() {
        "mesh" => Geometry::Mesh {
            path: resolve(path, shape)?,
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
        "sphere" => Geometry::Sphere(number("radius")?),
        other => return Err(shape.wrong(path, "mesh, box, cylinder or sphere", other)),
    }))
}

/// The file of a mesh: relative to the description, or, of `package://name/rest`, `name/rest` or
/// `rest` in a folder above it.
fn resolve(path: &Path, mesh: &Element) -> Result<PathBuf, ImportError> {
    let name = mesh.required(path, "filename")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let name = name.strip_prefix("file://").unwrap_or(name);
    let Some(package) = name.strip_prefix("package://") else {
        return Ok(folder.join(name));
    };
    let rest = package.split_once('/').map_or(package, |(_, rest)| rest);
    let absolute = folder.canonicalize().unwrap_or(folder.to_owned());
    let candidates = absolute
        .ancestors()
        .flat_map(|above| [above.join(package), above.join(rest)]);
    for candidate in candidates {
        if candidate.is_file() {
            return Ok(candidate);
        }
    }
    let expected = format!("{package} or {rest} in a folder above the file");
    Err(mesh.wrong(path, expected, "none"))
}
