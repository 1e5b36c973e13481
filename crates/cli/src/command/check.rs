//! `pegfit check`: can these meshes be used, and what had to be repaired?

use std::path::Path;

use sdf_grid::{
    HygieneOptions, HygieneReport, LengthUnit, SymmetryAxis, SymmetryOrder, mesh_io, symmetry,
};
use serde::Serialize;

use super::{Context, print_json};
use crate::args::CheckArgs;
use crate::error::CommandError;

/// Deviation from symmetry that counts as none, as a fraction of the diagonal: above the facets of
/// a fine tessellation, below what matters for a fit.
const SYMMETRY_TOLERANCE: f64 = 5e-4;

/// What is said about one file.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Verdict {
    Usable {
        #[serde(flatten)]
        report: Box<HygieneReport>,
        symmetry: Vec<SymmetryAxis>,
        warnings: Vec<String>,
        usable: bool,
    },
    Unusable {
        name: String,
        error: String,
        usable: bool,
    },
}

pub(super) fn run(args: &CheckArgs, context: &Context) -> Result<(), CommandError> {
    let verdicts: Vec<Verdict> = args
        .meshes
        .iter()
        .map(|path| examine(path, args.unit))
        .collect();
    if context.json {
        print_json(&verdicts)?;
    } else {
        for verdict in &verdicts {
            print(verdict, args.unit);
        }
    }
    let unusable = verdicts
        .iter()
        .filter(|v| matches!(v, Verdict::Unusable { .. }))
        .count();
    match unusable {
        0 => Ok(()),
        count => Err(CommandError::UnusableMeshes {
            count,
            total: verdicts.len(),
        }),
    }
}

fn examine(path: &Path, unit: LengthUnit) -> Verdict {
    match mesh_io::read(path, unit, &HygieneOptions::default()) {
        Ok((mesh, report)) => Verdict::Usable {
            symmetry: symmetry::detect(&mesh, SYMMETRY_TOLERANCE * mesh.bounds().diagonal()),
            warnings: report.warnings(),
            report: Box::new(report),
            usable: true,
        },
        Err(error) => Verdict::Unusable {
            name: path.display().to_string(),
            error: error.to_string(),
            usable: false,
        },
    }
}

fn print(verdict: &Verdict, unit: LengthUnit) {
    let (report, axes, warnings) = match verdict {
        Verdict::Usable {
            report,
            symmetry,
            warnings,
            ..
        } => (report, symmetry, warnings),
        Verdict::Unusable { name, error, .. } => {
            crate::say!("{name}: cannot be used");
            crate::say!("  {error}");
            return;
        }
    };
    let metre = unit.in_metres();
    let size = report.bounds.size() / metre;
    let low = report.bounds.min / metre;
    crate::say!("{}: usable", report.name);
    crate::say!("  triangles    {}", report.triangles);
    crate::say!("  components   {}", report.components);
    match report.open_edges {
        0 => crate::say!(
            "  watertight   {}",
            if report.watertight { "yes" } else { "no" }
        ),
        n => crate::say!("  watertight   no, {n} open edges"),
    }
    match report.flipped_faces {
        0 => crate::say!("  orientation  outwards"),
        n => crate::say!("  orientation  outwards, after {n} faces were reversed"),
    }
    crate::say!(
        "  volume       {:.6} {unit}³",
        report.volume / metre.powi(3)
    );
    crate::say!("  area         {:.6} {unit}²", report.area / metre.powi(2));
    crate::say!(
        "  bounds       {:.6} x {:.6} x {:.6} {unit}, from ({:.6}, {:.6}, {:.6})",
        size.x,
        size.y,
        size.z,
        low.x,
        low.y,
        low.z
    );
    for axis in axes {
        let [x, y, z] = axis.direction.to_array();
        let order = match axis.order {
            SymmetryOrder::Continuous => "any turn".to_owned(),
            SymmetryOrder::Finite(n) => format!("{n}-fold"),
        };
        crate::say!("  symmetry     {order} about ({x:.4}, {y:.4}, {z:.4})");
    }
    for warning in warnings {
        crate::say!("  note         {warning}");
    }
}
