//! Bodies of an MJCF file at the reference pose.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use glam::{DQuat, DVec3};

use crate::solids::element::Element;
use crate::solids::error::ImportError;
use crate::solids::frames;
use crate::solids::geometry::{Geometry, Shape};

/// Elements that make bodies of other files or of rules: a scene without them would lack parts.
const NOT_READ: [&str; 4] = ["include", "replicate", "attach", "composite"];

/// Every shape of every body, in the world; the world's own geoms are those of `world`.
pub(super) fn shapes(
    path: &Path,
    model: &Element,
    visual: bool,
) -> Result<Vec<Shape>, ImportError> {
    let reader = ModelReader::new(path, model, visual)?;
    let mut bodies = Bodies::default();
    for world in model.all("worldbody") {
        reader.body(world, Pose::IDENTITY, &mut bodies)?;
    }
    Ok(bodies.found)
}

/// The bodies met so far.
#[derive(Default)]
struct Bodies {
    found: Vec<Shape>,
    count: usize,
}

struct ModelReader<'a> {
    path: &'a Path,
    visual: bool,
    meshes: HashMap<String, Geometry>,
    /// Radians per unit of an angle.
    angle: f64,
    sequence: String,
}

impl<'a> ModelReader<'a> {
    fn new(path: &'a Path, model: &Element, visual: bool) -> Result<Self, ImportError> {
        if let Some(element) = find(model, &NOT_READ) {
            let expected = "a file without include, replicate, attach and composite (MuJoCo's \
                            mj_saveLastXML writes one)";
            return Err(element.wrong(path, expected, format!("<{}>", element.name)));
        }
        // Later settings win.
        let setting = |name: &str| {
            model
                .all("compiler")
                .filter_map(|c| c.attribute(name))
                .last()
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        let folder = folder.join(setting("meshdir").or(setting("assetdir")).unwrap_or(""));
        let degrees = setting("angle") != Some("radian");
        Ok(Self {
            path,
            visual,
            meshes: meshes(path, model, &folder)?,
            angle: if degrees { 1f64.to_radians() } else { 1.0 },
            sequence: setting("eulerseq").unwrap_or("xyz").to_owned(),
        })
    }

    /// A body's geoms and the bodies in it; frames are bodies without a name of their own.
    fn body(&self, body: &Element, place: Pose, bodies: &mut Bodies) -> Result<(), ImportError> {
        let group = bodies.count;
        bodies.count += 1;
        let name = match (body.name.as_str(), body.attribute("name")) {
            ("worldbody", _) => "world".to_owned(),
            (_, Some(name)) => name.to_owned(),
            (_, None) => format!("body {group}"),
        };
        self.inside(body, place, &name, group, bodies)
    }

    fn inside(
        &self,
        holder: &Element,
        place: Pose,
        name: &str,
        group: usize,
        bodies: &mut Bodies,
    ) -> Result<(), ImportError> {
        let both = holder.all("geom").any(is_visual) && !holder.all("geom").all(is_visual);
        for geom in holder.all("geom") {
            if both && is_visual(geom) != self.visual {
                continue;
            }
            if let Some(geometry) = self.geometry(geom)? {
                bodies.found.push(Shape {
                    name: name.to_owned(),
                    group,
                    pose: place * self.pose(geom)?,
                    geometry,
                });
            }
        }
        for child in &holder.children {
            let there = || Ok::<_, ImportError>(place * self.pose(child)?);
            match child.name.as_str() {
                "body" => self.body(child, there()?, bodies)?,
                "frame" => self.inside(child, there()?, name, group, bodies)?,
                _ => {}
            }
        }
        Ok(())
    }

    /// A geom's shape; none for planes, height fields and what only a class could tell.
    fn geometry(&self, geom: &Element) -> Result<Option<Geometry>, ImportError> {
        let size = |count: usize| {
            let text = geom.attribute("size").unwrap_or("");
            let words = text.split_whitespace().map(|word| word.parse().ok());
            let numbers: Option<Vec<f64>> = words.collect();
            let fits = |n: &Vec<f64>| n.len() >= count && n.iter().all(|n| n.is_finite());
            numbers.filter(fits).ok_or_else(|| {
                let expected = format!("{count} numbers as \"size\"");
                geom.wrong(self.path, expected, format!("{text:?}"))
            })
        };
        let kind = geom.attribute("type");
        Ok(match (kind, geom.attribute("mesh")) {
            (None | Some("mesh"), Some(mesh)) => Some(match self.meshes.get(mesh) {
                Some(geometry) => geometry.clone(),
                None => return Err(geom.wrong(self.path, "a mesh among the assets", mesh)),
            }),
            (Some("box"), None) => size(3).map(|s| Some(Geometry::Box(2.0 * triple(&s))))?,
            (Some("cylinder"), None) => size(2).map(|s| {
                let (radius, height) = (s[0], 2.0 * s[1]);
                Some(Geometry::Cylinder { radius, height })
            })?,
            (Some("sphere"), None) => size(1).map(|s| Some(Geometry::Sphere(s[0])))?,
            _ => None,
        })
    }

    /// Where an element is in what holds it.
    fn pose(&self, element: &Element) -> Result<Pose, ImportError> {
        let path = self.path;
        let position = element.numbers::<3>(path, "pos")?.unwrap_or_default();
        let wrong = |expected: &str| element.wrong(path, expected, "another");
        let rotation = if let Some([w, x, y, z]) = element.numbers::<4>(path, "quat")? {
            DQuat::from_xyzw(x, y, z, w)
        } else if let Some([x, y, z, angle]) = element.numbers::<4>(path, "axisangle")? {
            let axis = DVec3::new(x, y, z).try_normalize();
            let axis = axis.ok_or_else(|| wrong("an axis that is not zero"))?;
            DQuat::from_axis_angle(axis, self.angle * angle)
        } else if let Some(angles) = element.numbers::<3>(path, "euler")? {
            frames::euler(&self.sequence, angles.map(|a| self.angle * a))
                .ok_or_else(|| wrong("an eulerseq of three axes"))?
        } else if let Some(axes) = element.numbers::<6>(path, "xyaxes")? {
            frames::from_axes(axes).ok_or_else(|| wrong("two axes that are not parallel"))?
        } else if let Some(z) = element.numbers::<3>(path, "zaxis")? {
            let z = DVec3::from(z).try_normalize();
            DQuat::from_rotation_arc(
                DVec3::Z,
                z.ok_or_else(|| wrong("an axis that is not zero"))?,
            )
        } else {
            DQuat::IDENTITY
        };
        if rotation.length() < 1e-9 {
            return Err(wrong("a quaternion that is not zero"));
        }
        Ok(frames::pose(rotation, position))
    }
}

/// Whether a geom is only for the eye: by its class, or because it touches nothing.
fn is_visual(geom: &Element) -> bool {
    let off = |name| geom.attribute(name) == Some("0");
    let class = geom.attribute("class").unwrap_or("");
    class.contains("visual") || (off("contype") && off("conaffinity"))
}

/// The meshes among the assets, by name.
fn meshes(
    path: &Path,
    model: &Element,
    folder: &Path,
) -> Result<HashMap<String, Geometry>, ImportError> {
    let mut meshes = HashMap::new();
    for mesh in model.all("asset").flat_map(|asset| asset.all("mesh")) {
        let Some(file) = mesh.attribute("file") else {
            return Err(mesh.wrong(path, "a mesh of a file", "one without"));
        };
        if mesh
            .attribute("refpos")
            .or(mesh.attribute("refquat"))
            .is_some()
        {
            return Err(mesh.wrong(path, "a mesh without refpos and refquat", "one with"));
        }
        let file = PathBuf::from(file);
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let name = mesh
            .attribute("name")
            .map_or(stem.into_owned(), str::to_owned);
        let scale = DVec3::from(mesh.numbers::<3>(path, "scale")?.unwrap_or([1.0; 3]));
        let path = folder.join(&file);
        meshes.insert(name, Geometry::Mesh { path, scale });
    }
    Ok(meshes)
}

/// The first element anywhere in it that is called one of `names`.
fn find<'a>(element: &'a Element, names: &[&str]) -> Option<&'a Element> {
    let mut children = element.children.iter();
    children.find_map(|c| match names.contains(&c.name.as_str()) {
        true => Some(c),
        false => find(c, names),
    })
}

fn triple(numbers: &[f64]) -> DVec3 {
    DVec3::new(numbers[0], numbers[1], numbers[2])
}
