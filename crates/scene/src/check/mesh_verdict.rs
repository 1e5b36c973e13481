//! The verdict on a mesh, in the words of `pegfit check`.

use std::path::Path;

use sdf_grid::mesh_io::{Examination, MeshFile, ReadOptions, Solid, examine};
use sdf_grid::text::{quoted, shown};
use sdf_grid::{
    Ledger, LengthUnit, MeshError, RepairReport, SymmetryAxis, SymmetryOrder, TriangleMesh,
};
use serde::Serialize;

use crate::check::ledger::ledger_lines;

/// Components and solids listed one by one.
const MOST_LISTED: usize = 12;

/// Metres across: parts outside are rare, and files in another unit are not.
const LEAST: f64 = 5e-4;
const MOST: f64 = 20.0;

/// What to do about open edges that are tolerated.
const OPEN: &str = "it can be used as it is; export a closed solid for exact signs, and for shorter \
                    computations";

/// Whether a mesh can be used, and what had to be repaired.
///
/// ```
/// use pegfit_scene::MeshVerdict;
/// use sdf_grid::mesh_io::{self, ReadOptions};
/// use sdf_grid::{LengthUnit, shapes};
///
/// # let folder = tempfile::tempdir()?;
/// let file = folder.path().join("plate.obj");
/// mesh_io::write_obj_in(&file, &shapes::plate(0.02, 0.005)?, LengthUnit::Mm)?;
/// let MeshVerdict::Usable { report, .. } = MeshVerdict::of_file(&file, &ReadOptions::default())
/// else {
///     panic!("it is a closed plate");
/// };
/// // Cubic metres, though the file is in millimetres.
/// assert!(report.watertight && (report.volume - 2e-6).abs() < 1e-12);
/// let none = folder.path().join("none.obj");
/// assert!(!MeshVerdict::of_file(&none, &ReadOptions::default()).is_usable());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum MeshVerdict {
    /// It can.
    Usable {
        /// What was repaired, and what came of it.
        #[serde(flatten)]
        report: Box<RepairReport>,
        /// Number, name and size of each solid.
        solids: Vec<String>,
        /// The unit that the file itself states.
        stated_unit: Option<LengthUnit>,
        /// Axes about which it may be turned onto itself.
        symmetry: Vec<SymmetryAxis>,
        /// What was read of the file, ignored and assumed.
        ledger: Ledger,
        /// What its user should know.
        warnings: Vec<String>,
        /// True.
        usable: bool,
    },
    /// It cannot.
    Unusable {
        /// The file.
        name: String,
        /// Why not.
        error: String,
        /// What to do about it.
        next: Option<&'static str>,
        /// False.
        usable: bool,
    },
}

impl MeshVerdict {
    /// The verdict on a file.
    pub fn of_file(path: &Path, options: &ReadOptions) -> Self {
        Self::of(&path.display().to_string(), examine(path, options))
    }

    /// The verdict on what was read of a file called `name`, and the mesh if it can be used.
    pub fn of_content(
        name: &str,
        file: Result<MeshFile, MeshError>,
        options: &ReadOptions,
    ) -> (Self, Option<TriangleMesh>) {
        match file.and_then(|file| file.examine(options)) {
            Ok((found, mesh)) => (Self::of(name, Ok(found)), Some(mesh)),
            Err(error) => (Self::of(name, Err(error)), None),
        }
    }

    fn of(name: &str, found: Result<Examination, MeshError>) -> Self {
        match found {
            Ok(found) => Self::Usable {
                symmetry: found.symmetry,
                ledger: found.ledger,
                warnings: found.report.warnings(),
                report: Box::new(found.report),
                solids: listed(&found.solids),
                stated_unit: found.stated_unit,
                usable: true,
            },
            Err(error) => Self::Unusable {
                name: name.to_owned(),
                next: next_for(&error),
                error: with_causes(&error),
                usable: false,
            },
        }
    }

    /// Whether it can be used.
    pub fn is_usable(&self) -> bool {
        matches!(self, Self::Usable { .. })
    }

    /// For people; lengths of a usable mesh in `unit`.
    pub fn lines(&self, unit: LengthUnit) -> Vec<String> {
        let mut lines = Vec::new();
        match self {
            Self::Unusable {
                name, error, next, ..
            } => {
                lines.push(format!("{}: cannot be used", shown(name)));
                lines.push(format!("  {error}"));
                if let Some(next) = next {
                    lines.push(format!("  next         {next}"));
                }
            }
            Self::Usable {
                report,
                solids,
                stated_unit,
                symmetry,
                ledger,
                warnings,
                ..
            } => {
                lines.push(format!("{}: usable", shown(&report.name)));
                if let Some(stated) = stated_unit {
                    lines.push(format!("  unit         {stated}, as the file says"));
                }
                lines.extend(ledger_lines(ledger));
                if solids.len() > 1 {
                    push_list(&mut lines, "solid", solids);
                }
                push_changes(&mut lines, report, unit);
                push_surface(&mut lines, report, unit);
                push_size(&mut lines, report, unit);
                for axis in symmetry {
                    let [x, y, z] = axis.direction.to_array();
                    let order = match axis.order {
                        SymmetryOrder::Continuous => "any turn".to_owned(),
                        SymmetryOrder::Finite(n) => format!("{n}-fold"),
                    };
                    lines.push(format!(
                        "  symmetry     {order} about ({x:.4}, {y:.4}, {z:.4})"
                    ));
                }
                for warning in warnings {
                    lines.push(format!("  note         {warning}"));
                }
                if let Some(next) = odd_size(report, stated_unit.is_some()) {
                    lines.push(format!("  next         {next}"));
                }
                if report.open_edges > 0 {
                    lines.push(format!("  next         {OPEN}"));
                }
            }
        }
        lines
    }
}

/// An error and what caused it, in one line.
fn with_causes(error: &MeshError) -> String {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}

/// What to do about a mesh that cannot be used.
fn next_for(error: &MeshError) -> Option<&'static str> {
    Some(match error {
        MeshError::Open { .. } => {
            "close the surface in the program that made it (\"make solid\", \"fill holes\"), or \
             export the solid anew as STL, 3MF or STEP; a surface without thickness is no part"
        }
        MeshError::Empty { .. } => "export the part as triangles: curves and points are not read",
        MeshError::Format { .. } => "export it in one of these formats",
        MeshError::Converter { .. } => "pip install gmsh, or export STL or 3MF instead",
        MeshError::NoSolid { .. } => "pegfit reads solids: sew the faces together and export again",
        MeshError::Unread { .. } => {
            "export the part as one solid without it, or ask for the rest with --lossy"
        }
        MeshError::Solid { .. } => "pegfit check FILE lists its solids",
        MeshError::NonFiniteVertex { .. } => "export the part near the origin, or give its unit",
        _ => return None,
    })
}

/// A remark on a size that few parts have.
fn odd_size(report: &RepairReport, stated: bool) -> Option<String> {
    let longest = report.bounds.size().max_element();
    if stated || (LEAST..MOST).contains(&longest) {
        return None;
    }
    let (m, inch) = (LengthUnit::M, LengthUnit::Inch);
    Some(format!(
        "{longest:.3e} m across: if that is not its size, say its unit, as in --unit {m} or --unit \
         {inch} (unit = \"{m}\" in a scene)"
    ))
}

/// Number, name and size of each solid.
fn listed(solids: &[Solid]) -> Vec<String> {
    solids
        .iter()
        .enumerate()
        .map(|(i, s)| match s.name.as_str() {
            "" => format!("{}, no name, {} triangles", i + 1, s.triangles),
            name => format!("{}, {}, {} triangles", i + 1, quoted(name), s.triangles),
        })
        .collect()
}

fn push_list(lines: &mut Vec<String>, title: &str, items: &[String]) {
    for line in items.iter().take(MOST_LISTED) {
        lines.push(format!("  {title:<12} {line}"));
    }
    if let Some(more) = items.len().checked_sub(MOST_LISTED + 1) {
        lines.push(format!("  {title:<12} and {} more", more + 1));
    }
}

/// What the repair changed of the triangles.
fn push_changes(lines: &mut Vec<String>, report: &RepairReport, unit: LengthUnit) {
    let metre = unit.in_metres();
    lines.push(format!(
        "  triangles    {} of {} kept: {} without area, {} duplicate, {} edges cut at T-junctions",
        report.triangles,
        report.input_triangles,
        report.zero_area_faces,
        report.duplicate_faces,
        report.stitched_edges
    ));
    lines.push(format!(
        "  vertices     {} of {} kept: {} welded within {:.3e} {unit}, {} unused",
        report.vertices,
        report.input_vertices,
        report.welded_vertices,
        report.weld_distance / metre,
        report.unused_vertices
    ));
}

/// How the surface hangs together.
fn push_surface(lines: &mut Vec<String>, report: &RepairReport, unit: LengthUnit) {
    let metre = unit.in_metres();
    lines.push(format!("  components   {}", report.components));
    if report.components > 1 {
        let items: Vec<String> = report
            .per_component
            .iter()
            .map(|c| {
                let mut text = format!(
                    "{} triangles, {} reversed, volume {:.6} {unit}³",
                    c.triangles,
                    c.flipped_faces,
                    c.volume / metre.powi(3)
                );
                if c.cavity {
                    text += ", a cavity";
                }
                text
            })
            .collect();
        push_list(lines, "component", &items);
    }
    match (report.watertight, report.open_edges) {
        (true, _) => lines.push("  watertight   yes".to_owned()),
        (false, 0) => lines.push("  watertight   no".to_owned()),
        (false, n) => lines.push(format!(
            "  watertight   no, {n} open edges, {:.3} % of the area missing",
            100.0 * report.open_area_fraction
        )),
    }
    match report.flipped_faces {
        0 => lines.push("  orientation  outwards".to_owned()),
        n => lines.push(format!(
            "  orientation  outwards, after {n} faces were reversed"
        )),
    }
}

fn push_size(lines: &mut Vec<String>, report: &RepairReport, unit: LengthUnit) {
    let metre = unit.in_metres();
    let size = report.bounds.size() / metre;
    let low = report.bounds.min / metre;
    lines.push(format!(
        "  volume       {:.6} {unit}³",
        report.volume / metre.powi(3)
    ));
    lines.push(format!(
        "  area         {:.6} {unit}²",
        report.area / metre.powi(2)
    ));
    lines.push(format!(
        "  bounds       {:.6} x {:.6} x {:.6} {unit}, from ({:.6}, {:.6}, {:.6})",
        size.x, size.y, size.z, low.x, low.y, low.z
    ));
}
