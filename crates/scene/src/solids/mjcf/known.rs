//! What of MJCF is read without MuJoCo: everything else that is met is refused by its name.

use std::collections::HashSet;
use std::path::Path;

use crate::solids::element::Element;
use crate::solids::error::ImportError;

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
pub(super) struct Known<'a> {
    pub(super) path: &'a Path,
    /// Why there is no MuJoCo.
    pub(super) why: &'a str,
}

impl Known<'_> {
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
                    return Err(self.beyond(compiler, format!("{name}={found:?}")));
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
                return Err(self.beyond(element, format!("{name}={text:?}")));
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
