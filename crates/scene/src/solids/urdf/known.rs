//! What of URDF is read, what is left out, and what is refused.

use std::path::Path;

use sdf_grid::{Ledger, LedgerKind};

use crate::solids::element::Element;
use crate::solids::error::ImportError;

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
            return Err(element.wrong(path, expected, format!("{name}={text:?}")));
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
            Err(element.wrong(path, expected, format!("{name}={text:?}")))
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
