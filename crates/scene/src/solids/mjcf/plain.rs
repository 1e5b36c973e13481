//! Models that need nothing of MuJoCo.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use sdf_grid::{Ledger, LedgerKind};

use crate::solids::element::Element;
use crate::solids::error::ImportError;
use crate::solids::frames;
use crate::solids::geometry::{Geometry, Shape};
use crate::solids::mjcf::chosen::{Geom, HEIGHT_FIELD, PLANE, STANDS};
use crate::solids::mjcf::known::Known;

/// Every geom of the model at the reference pose; `why` there is no MuJoCo stands in errors.
pub(super) fn geoms(
    path: &Path,
    model: &Element,
    why: &str,
    ledger: &mut Ledger,
) -> Result<Vec<Geom>, ImportError> {
    let known = Known { path, why };
    known.model(model)?;
    let reader = ModelReader::new(known, model)?;
    let mut found = Found {
        geoms: Vec::new(),
        bodies: 1,
        ledger,
    };
    for world in model.all("worldbody") {
        reader.inside(world, Pose::IDENTITY, "world", 0, &mut found)?;
    }
    Ok(found.geoms)
}

/// What was met so far.
struct Found<'a> {
    geoms: Vec<Geom>,
    bodies: usize,
    ledger: &'a mut Ledger,
}

struct ModelReader<'a> {
    known: Known<'a>,
    meshes: HashMap<String, Geometry>,
    /// Geoms that a pair names: they touch, whatever they say themselves.
    paired: HashSet<&'a str>,
    /// Radians per unit of an angle.
    angle: f64,
    sequence: &'a str,
}

impl<'a> ModelReader<'a> {
    fn new(known: Known<'a>, model: &'a Element) -> Result<Self, ImportError> {
        let compiler = model.child("compiler");
        let setting = |name: &str| compiler.and_then(|c| c.attribute(name));
        let folder = known.path.parent().unwrap_or(Path::new(""));
        let folder = folder.join(setting("meshdir").or(setting("assetdir")).unwrap_or(""));
        let pairs = model.all("contact").flat_map(|c| c.all("pair"));
        let ends = pairs.flat_map(|p| [p.attribute("geom1"), p.attribute("geom2")]);
        let degrees = setting("angle") != Some("radian");
        Ok(Self {
            meshes: meshes(&known, model, &folder)?,
            paired: ends.flatten().collect(),
            angle: if degrees { 1f64.to_radians() } else { 1.0 },
            sequence: setting("eulerseq").unwrap_or("xyz"),
            known,
        })
    }

    /// The geoms of a body, or of a frame in it, and the bodies in it.
    fn inside(
        &self,
        holder: &Element,
        place: Pose,
        name: &str,
        group: usize,
        found: &mut Found<'_>,
    ) -> Result<(), ImportError> {
        for child in &holder.children {
            match child.name.as_str() {
                "geom" => {
                    let pose = place * self.pose(child)?;
                    let Some(geometry) = self.geometry(child, found.ledger)? else {
                        continue;
                    };
                    found.geoms.push(Geom {
                        visual: self.is_visual(child)?,
                        shape: Shape {
                            name: name.to_owned(),
                            group,
                            pose,
                            geometry,
                        },
                    });
                }
                "body" => {
                    let group = found.bodies;
                    found.bodies += 1;
                    let name = match child.attribute("name") {
                        Some(name) if !name.is_empty() => name.to_owned(),
                        _ => format!("body {group}"),
                    };
                    self.inside(child, place * self.pose(child)?, &name, group, found)?;
                }
                "frame" => self.inside(child, place * self.pose(child)?, name, group, found)?,
                "joint" | "freejoint" => found.ledger.add(LedgerKind::Assumed, "joint", STANDS),
                "site" => {
                    let reason = "it is a mark without substance";
                    found.ledger.add(LedgerKind::Ignored, "site", reason);
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Whether a geom is only for the eye: it touches nothing.
    fn is_visual(&self, geom: &Element) -> Result<bool, ImportError> {
        let off = |name: &str| -> Result<bool, ImportError> {
            Ok(geom.numbers::<1>(self.known.path, name)? == Some([0.0]))
        };
        let named = geom
            .attribute("name")
            .is_some_and(|n| self.paired.contains(n));
        Ok(off("contype")? && off("conaffinity")? && !named)
    }

    /// A geom's shape; none for planes and height fields.
    fn geometry(
        &self,
        geom: &Element,
        ledger: &mut Ledger,
    ) -> Result<Option<Geometry>, ImportError> {
        let path = self.known.path;
        let kind = geom.attribute("type").unwrap_or("sphere");
        if let Some(mesh) = geom.attribute("mesh") {
            if kind != "mesh" {
                return Err(self
                    .known
                    .beyond(geom, format!("a {kind} fitted to a mesh")));
            }
            let found = self.meshes.get(mesh);
            let found = found.ok_or_else(|| geom.wrong(path, "a mesh among the assets", mesh))?;
            return Ok(Some(found.clone()));
        }
        let size = |count: usize| -> Result<[f64; 3], ImportError> {
            let words = geom
                .attribute("size")
                .unwrap_or("")
                .split_whitespace()
                .count();
            // Numbers beyond those that a shape needs are allowed and mean nothing.
            let numbers = match words.max(count) {
                1 => geom.numbers::<1>(path, "size")?.map(|[a]| [a, 0.0, 0.0]),
                2 => geom.numbers::<2>(path, "size")?.map(|[a, b]| [a, b, 0.0]),
                _ => geom.numbers::<3>(path, "size")?,
            };
            numbers.ok_or_else(|| geom.wrong(path, format!("{count} numbers as \"size\""), "none"))
        };
        Ok(Some(match kind {
            "box" => Geometry::Box(2.0 * DVec3::from(size(3)?)),
            "cylinder" => size(2).map(|[radius, half, _]| Geometry::Cylinder {
                radius,
                height: 2.0 * half,
            })?,
            "capsule" => size(2).map(|[radius, half, _]| Geometry::Capsule {
                radius,
                height: 2.0 * half,
            })?,
            "sphere" => Geometry::Sphere(size(1)?[0]),
            "ellipsoid" => Geometry::Ellipsoid(DVec3::from(size(3)?)),
            "plane" => {
                ledger.add(LedgerKind::Ignored, "plane geom", PLANE);
                return Ok(None);
            }
            "hfield" => {
                ledger.add(LedgerKind::Ignored, "hfield geom", HEIGHT_FIELD);
                return Ok(None);
            }
            other => return Err(self.known.beyond(geom, format!("type={other:?}"))),
        }))
    }

    /// Where an element is in what holds it.
    fn pose(&self, element: &Element) -> Result<Pose, ImportError> {
        let path = self.known.path;
        let position = element.numbers::<3>(path, "pos")?.unwrap_or_default();
        let wrong = |expected: &str| element.wrong(path, expected, "another");
        let rotation = if let Some([w, x, y, z]) = element.numbers::<4>(path, "quat")? {
            DQuat::from_xyzw(x, y, z, w)
        } else if let Some([x, y, z, angle]) = element.numbers::<4>(path, "axisangle")? {
            let axis = DVec3::new(x, y, z).try_normalize();
            let axis = axis.ok_or_else(|| wrong("an axis that is not zero"))?;
            DQuat::from_axis_angle(axis, self.angle * angle)
        } else if let Some(angles) = element.numbers::<3>(path, "euler")? {
            frames::euler(self.sequence, angles.map(|a| self.angle * a))
                .ok_or_else(|| wrong("an eulerseq of three axes"))?
        } else if let Some(axes) = element.numbers::<6>(path, "xyaxes")? {
            frames::from_axes(axes).ok_or_else(|| wrong("two axes that are not parallel"))?
        } else if let Some(z) = element.numbers::<3>(path, "zaxis")? {
            frames::from_z_axis(z).ok_or_else(|| wrong("an axis that is not zero"))?
        } else {
            DQuat::IDENTITY
        };
        if rotation.length() < 1e-9 {
            return Err(wrong("a quaternion that is not zero"));
        }
        Ok(frames::pose(rotation, position))
    }
}

/// The meshes among the assets, by name.
fn meshes(
    known: &Known<'_>,
    model: &Element,
    folder: &Path,
) -> Result<HashMap<String, Geometry>, ImportError> {
    let path = known.path;
    let mut meshes = HashMap::new();
    for mesh in model.all("asset").flat_map(|asset| asset.all("mesh")) {
        let Some(file) = mesh.attribute("file").map(PathBuf::from) else {
            return Err(known.beyond(mesh, "a mesh without a file"));
        };
        let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase());
        let at = folder.join(&file);
        match ending.as_deref() {
            Some("stl") => {}
            Some("obj") if !has_several(&at) => {}
            Some("obj") => {
                let found = "an OBJ file of several objects, of which MuJoCo reads the first";
                return Err(known.beyond(mesh, found));
            }
            _ => return Err(known.beyond(mesh, format!("file={:?}", file.display()))),
        }
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let name = mesh
            .attribute("name")
            .map_or(stem.into_owned(), str::to_owned);
        let scale = DVec3::from(mesh.numbers::<3>(path, "scale")?.unwrap_or([1.0; 3]));
        let geometry = Geometry::Mesh { path: at, scale };
        if meshes.insert(name.clone(), geometry).is_some() {
            return Err(mesh.wrong(
                path,
                "meshes of different names",
                format!("two of {name:?}"),
            ));
        }
    }
    Ok(meshes)
}

/// Whether an OBJ file has an object or a group between faces. What cannot be read is found out when
/// the mesh is.
fn has_several(path: &Path) -> bool {
    let bytes = std::fs::read(path).unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes);
    let first_words = text
        .lines()
        .filter_map(|line| line.split_whitespace().next());
    let parts = first_words.filter(|word| matches!(*word, "o" | "g" | "f"));
    let after_face = parts.skip_while(|word| *word != "f");
    after_face
        .skip_while(|word| *word == "f")
        .any(|word| word == "f")
}
