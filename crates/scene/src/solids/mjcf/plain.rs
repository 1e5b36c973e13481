//! Models read without MuJoCo: everything that could change a solid and is not known is refused.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use sdf_grid::text::quoted;
use sdf_grid::{Ledger, LedgerKind};

use crate::solids::element::Element;
use crate::solids::error::ImportError;
use crate::solids::geometry;
use crate::solids::geometry::{Geometry, Shape};
use crate::solids::mjcf::geom::{Geom, HEIGHT_FIELD, PLANE, STANDS};

/// Every geom of the model at the reference pose; `why` there is no MuJoCo stands in errors.
pub(super) fn geoms(
    path: &Path,
    model: &Element,
    why: &str,
    ledger: &mut Ledger,
) -> Result<Vec<Geom>, ImportError> {
    let subset = Subset { path, why };
    subset.model(model)?;
    let reader = ModelReader::new(subset, model)?;
    let mut found = GeomList {
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
struct GeomList<'a> {
    geoms: Vec<Geom>,
    bodies: usize,
    ledger: &'a mut Ledger,
}

struct ModelReader<'a> {
    subset: Subset<'a>,
    meshes: HashMap<String, Geometry>,
    /// Geoms that a pair names: they touch, whatever they say themselves.
    paired: HashSet<&'a str>,
    /// Radians per unit of an angle.
    angle: f64,
    sequence: &'a str,
}

impl<'a> ModelReader<'a> {
    fn new(subset: Subset<'a>, model: &'a Element) -> Result<Self, ImportError> {
        let compiler = model.child("compiler");
        let setting = |name: &str| compiler.and_then(|c| c.attribute(name));
        let folder = subset.path.parent().unwrap_or(Path::new(""));
        let folder = folder.join(setting("meshdir").or(setting("assetdir")).unwrap_or(""));
        let pairs = model.all("contact").flat_map(|c| c.all("pair"));
        let ends = pairs.flat_map(|p| [p.attribute("geom1"), p.attribute("geom2")]);
        let degrees = setting("angle") != Some("radian");
        Ok(Self {
            meshes: meshes(&subset, model, &folder)?,
            paired: ends.flatten().collect(),
            angle: if degrees { 1f64.to_radians() } else { 1.0 },
            sequence: setting("eulerseq").unwrap_or("xyz"),
            subset,
        })
    }

    /// The geoms of a body, or of a frame in it, and the bodies in it.
    fn inside(
        &self,
        holder: &Element,
        place: Pose,
        name: &str,
        group: usize,
        found: &mut GeomList<'_>,
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
            Ok(geom.numbers::<1>(self.subset.path, name)? == Some([0.0]))
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
        let path = self.subset.path;
        let kind = geom.attribute("type").unwrap_or("sphere");
        if let Some(mesh) = geom.attribute("mesh") {
            if kind != "mesh" {
                return Err(self
                    .subset
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
            other => return Err(self.subset.beyond(geom, format!("type={}", quoted(other)))),
        }))
    }

    /// Where an element is in what holds it.
    fn pose(&self, element: &Element) -> Result<Pose, ImportError> {
        let path = self.subset.path;
        let position = element.numbers::<3>(path, "pos")?.unwrap_or_default();
        let wrong = |expected: &str| element.wrong(path, expected, "another");
        let rotation = if let Some([w, x, y, z]) = element.numbers::<4>(path, "quat")? {
            DQuat::from_xyzw(x, y, z, w)
        } else if let Some([x, y, z, angle]) = element.numbers::<4>(path, "axisangle")? {
            let axis = DVec3::new(x, y, z).try_normalize();
            let axis = axis.ok_or_else(|| wrong("an axis that is not zero"))?;
            DQuat::from_axis_angle(axis, self.angle * angle)
        } else if let Some(angles) = element.numbers::<3>(path, "euler")? {
            geometry::euler(self.sequence, angles.map(|a| self.angle * a))
                .ok_or_else(|| wrong("an eulerseq of three axes"))?
        } else if let Some(axes) = element.numbers::<6>(path, "xyaxes")? {
            geometry::from_axes(axes).ok_or_else(|| wrong("two axes that are not parallel"))?
        } else if let Some(z) = element.numbers::<3>(path, "zaxis")? {
            geometry::from_z_axis(z).ok_or_else(|| wrong("an axis that is not zero"))?
        } else {
            DQuat::IDENTITY
        };
        if rotation.length() < 1e-9 {
            return Err(wrong("a quaternion that is not zero"));
        }
        Ok(geometry::pose(rotation, position))
    }
}

/// The meshes among the assets, by name.
fn meshes(
    subset: &Subset<'_>,
    model: &Element,
    folder: &Path,
) -> Result<HashMap<String, Geometry>, ImportError> {
    let path = subset.path;
    let mut meshes = HashMap::new();
    for mesh in model.all("asset").flat_map(|asset| asset.all("mesh")) {
        let Some(file) = mesh.attribute("file").map(PathBuf::from) else {
            return Err(subset.beyond(mesh, "a mesh without a file"));
        };
        let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase());
        let at = folder.join(&file);
        match ending.as_deref() {
            Some("stl") => {}
            Some("obj") if !has_several(&at) => {}
            Some("obj") => {
                let found = "an OBJ file of several objects, of which MuJoCo reads the first";
                return Err(subset.beyond(mesh, found));
            }
            _ => {
                return Err(
                    subset.beyond(mesh, format!("file={}", quoted(&file.to_string_lossy())))
                );
            }
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
                format!("two of {}", quoted(&name)),
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

/// Sections and parts of bodies that never change where a solid is or what it is.
const ASIDE: [&str; 11] = [
    "option",
    "size",
    "visual",
    "statistic",
    "custom",
    "extension",
    "keyframe",
    "actuator",
    "sensor",
    "tendon",
    "equality",
];
const IN_BODY: [&str; 6] = ["joint", "freejoint", "inertial", "site", "camera", "light"];
const IN_ASSET: [&str; 5] = ["texture", "material", "hfield", "skin", "model"];
const IN_DEFAULT: [&str; 20] = [
    "texture",
    "material",
    "joint",
    "site",
    "camera",
    "light",
    "pair",
    "equality",
    "tendon",
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "orientation",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
];

/// Attributes that are read, and those that never change a solid.
const COMPILER: [&str; 21] = [
    "angle",
    "assetdir",
    "coordinate",
    "eulerseq",
    "meshdir",
    "strippath",
    "alignfree",
    "autolimits",
    "balanceinertia",
    "boundinertia",
    "boundmass",
    "convexhull",
    "discardvisual",
    "exactmeshinertia",
    "fitaabb",
    "fusestatic",
    "inertiafromgeom",
    "inertiagrouprange",
    "settotalmass",
    "texturedir",
    "usethread",
];
const PLACE: [&str; 6] = ["pos", "quat", "axisangle", "euler", "xyaxes", "zaxis"];
const BODY: [&str; 6] = ["name", "childclass", "mocap", "gravcomp", "user", "sleep"];
const FRAME: [&str; 2] = ["name", "childclass"];
const MESH: [&str; 8] = [
    "name",
    "class",
    "file",
    "scale",
    "material",
    "inertia",
    "maxhullvert",
    "smoothnormal",
];
const GEOM: [&str; 8] = [
    "name",
    "class",
    "type",
    "size",
    "mesh",
    "hfield",
    "contype",
    "conaffinity",
];
const GEOM_ASIDE: [&str; 19] = [
    "group",
    "condim",
    "priority",
    "friction",
    "mass",
    "density",
    "shellinertia",
    "solmix",
    "solref",
    "solimp",
    "margin",
    "gap",
    "material",
    "rgba",
    "user",
    "fluidshape",
    "fluidcoef",
    "castshadow",
    "adhesion",
];
const MESH_ASIDE: [&str; 3] = ["inertia", "maxhullvert", "smoothnormal"];

/// Checks that a model has nothing but what is read without MuJoCo.
pub(super) struct Subset<'a> {
    pub(super) path: &'a Path,
    /// Why there is no MuJoCo.
    pub(super) why: &'a str,
}

impl Subset<'_> {
    /// What is wrong with an element that MuJoCo could read.
    pub(super) fn beyond(&self, element: &Element, found: impl Into<String>) -> ImportError {
        let expected = format!(
            "only what pegfit reads without MuJoCo (pip install mujoco; {})",
            self.why
        );
        element.wrong(self.path, expected, found)
    }

    pub(super) fn model(&self, model: &Element) -> Result<(), ImportError> {
        self.attributes(model, &[&["model"]])?;
        let mut classes = HashSet::from(["main"]);
        let mut compilers = 0;
        self.no_include(model)?;
        for default in model.all("default") {
            self.default(default, &mut classes)?;
        }
        for child in &model.children {
            match child.name.as_str() {
                "default" | "contact" => {}
                "compiler" if compilers == 0 => {
                    compilers += 1;
                    self.compiler(child)?;
                }
                "asset" => self.asset(child, &classes)?,
                "worldbody" => {
                    self.attributes(child, &[])?;
                    self.inside(child, &classes)?;
                }
                name if ASIDE.contains(&name) => {}
                name => return Err(self.beyond(model, format!("another <{name}>"))),
            }
        }
        Ok(())
    }

    /// Another file may hold anything, wherever it is included.
    fn no_include(&self, element: &Element) -> Result<(), ImportError> {
        for child in &element.children {
            if child.name == "include" {
                return Err(self.beyond(child, "a file to include"));
            }
            self.no_include(child)?;
        }
        Ok(())
    }

    fn compiler(&self, compiler: &Element) -> Result<(), ImportError> {
        self.attributes(compiler, &[&COMPILER])?;
        for (name, accepted) in [
            ("angle", ["degree", "radian"]),
            ("coordinate", ["local", "local"]),
            ("strippath", ["false", "false"]),
        ] {
            match compiler.attribute(name) {
                Some(found) if !accepted.contains(&found) => {
                    return Err(self.beyond(compiler, format!("{name}={}", quoted(found))));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Defaults that change no solid; the names of their classes.
    fn default<'e>(
        &self,
        default: &'e Element,
        classes: &mut HashSet<&'e str>,
    ) -> Result<(), ImportError> {
        self.attributes(default, &[&["class"]])?;
        classes.extend(default.attribute("class"));
        for child in &default.children {
            match child.name.as_str() {
                "default" => self.default(child, classes)?,
                "geom" => self.attributes(child, &[&GEOM_ASIDE])?,
                "mesh" => self.attributes(child, &[&MESH_ASIDE])?,
                name if IN_DEFAULT.contains(&name) => {}
                name => return Err(self.beyond(default, format!("<{name}>"))),
            }
        }
        Ok(())
    }

    fn asset(&self, asset: &Element, classes: &HashSet<&str>) -> Result<(), ImportError> {
        self.attributes(asset, &[])?;
        for child in &asset.children {
            match child.name.as_str() {
                "mesh" => {
                    self.attributes(child, &[&MESH])?;
                    self.class(child, classes)?;
                    self.empty(child)?;
                }
                name if IN_ASSET.contains(&name) => {}
                name => return Err(self.beyond(asset, format!("<{name}>"))),
            }
        }
        Ok(())
    }

    /// What is in a body, a frame or the world.
    fn inside(&self, holder: &Element, classes: &HashSet<&str>) -> Result<(), ImportError> {
        for child in &holder.children {
            let own: &[&str] = match child.name.as_str() {
                "body" => &BODY,
                "frame" => &FRAME,
                "geom" => &GEOM,
                name if IN_BODY.contains(&name) => continue,
                name => return Err(self.beyond(holder, format!("<{name}>"))),
            };
            self.class(child, classes)?;
            if child.name == "geom" {
                self.attributes(child, &[own, &PLACE, &GEOM_ASIDE])?;
                self.empty(child)?;
            } else {
                self.attributes(child, &[own, &PLACE])?;
                self.inside(child, classes)?;
            }
            let turns = PLACE[1..]
                .iter()
                .filter(|name| child.attribute(name).is_some());
            if turns.count() > 1 {
                return Err(child.wrong(self.path, "one orientation", "several"));
            }
        }
        Ok(())
    }

    fn attributes(&self, element: &Element, known: &[&[&str]]) -> Result<(), ImportError> {
        for (name, text) in element.attributes() {
            if !known.iter().any(|names| names.contains(&name)) {
                return Err(self.beyond(element, format!("{name}={}", quoted(text))));
            }
        }
        Ok(())
    }

    fn class(&self, element: &Element, classes: &HashSet<&str>) -> Result<(), ImportError> {
        for attribute in ["class", "childclass"] {
            match element.attribute(attribute) {
                Some(class) if !classes.contains(class) => {
                    return Err(element.wrong(self.path, "a class among the defaults", class));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn empty(&self, element: &Element) -> Result<(), ImportError> {
        match element.children.first() {
            Some(child) => Err(self.beyond(element, format!("<{}>", child.name))),
            None => Ok(()),
        }
    }
}
