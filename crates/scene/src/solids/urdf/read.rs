//! Shapes of links.

use std::path::Path;

use glam::DVec3;
use sdf_grid::{Ledger, LedgerKind};

use crate::solids::element::Element;
use crate::solids::error::ImportError;
use crate::solids::geometry::{Geometry, SEGMENTS, Shape};
use crate::solids::urdf::mesh_file::resolve;
use crate::solids::urdf::{known, places};

/// Every shape of every link, in the frame of the root link; joints stand at zero.
pub(crate) fn shapes(
    path: &Path,
    robot: &Element,
    visual: bool,
    ledger: &mut Ledger,
) -> Result<Vec<Shape>, ImportError> {
    known::no_macros(path, robot)?;
    known::others(path, robot, &["link", "joint"], ledger)?;
    let places = places::places(path, robot, ledger)?;
    let mut found = Vec::new();
    for (group, link) in robot.all("link").enumerate() {
        known::others(path, link, &["visual", "collision"], ledger)?;
        let name = link.required(path, "name")?;
        let place = places.get(name).copied().unwrap_or_default();
        let kind = chosen(link, visual, ledger);
        for element in link.all(kind) {
            known::others(path, element, &["origin", "geometry"], ledger)?;
            let geometry = geometry(path, element, ledger)?;
            ledger.add(LedgerKind::Read, &format!("{kind} {}", geometry.kind()), "");
            if geometry.is_faceted() {
                let facets = format!("facets, {SEGMENTS} around a full turn");
                ledger.add(LedgerKind::Assumed, "curved shape", &facets);
            }
            found.push(Shape {
                name: name.to_owned(),
                group,
                pose: place * places::origin(path, element)?,
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
        None => Err(shape.wrong(path, format!("an attribute {name:?}"), "none")),
    };
    let read: &[&str] = match shape.name.as_str() {
        "mesh" => &["filename", "scale"],
        "box" => &["size"],
        "cylinder" => &["radius", "length"],
        "sphere" => &["radius"],
        other => return Err(element.wrong(path, "mesh, box, cylinder or sphere", other)),
    };
    known::attributes(path, shape, read)?;
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
