//! All that can be said of a mesh file.

use std::path::Path;

use super::file::{MeshFile, ReadOptions};
use super::ledger::Ledger;
use super::soup::Solid;
use super::unit::LengthUnit;
use crate::frame::symmetry;
use crate::frame::symmetry::axis::SymmetryAxis;
use crate::mesh::error::MeshError;
use crate::mesh::repair::report::RepairReport;

/// Deviation from symmetry that counts as none, as a fraction of the diagonal: above the facets of
/// a fine tessellation, below what matters for a fit.
const SYMMETRY_TOLERANCE: f64 = 5e-4;

/// All that can be said of a mesh file.
#[derive(Debug, Clone, PartialEq)]
pub struct Examination {
    /// What repair found and repaired.
    pub report: RepairReport,
    /// The solids in the file, in its order.
    pub solids: Vec<Solid>,
    /// The unit that the file itself states.
    pub stated_unit: Option<LengthUnit>,
    /// What was read of the file, what was ignored and what was assumed.
    pub ledger: Ledger,
    /// Axes about which the cleaned mesh may be turned onto itself, to within 5e-4 of its diagonal.
    pub symmetry: Vec<SymmetryAxis>,
}

/// Reads a mesh file, cleans it, and says all that can be said of it.
///
/// # Errors
/// As [`MeshFile::open`] and [`MeshFile::clean`].
pub fn examine(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Examination, MeshError> {
    let file = MeshFile::open(path, &options.step)?;
    let (mesh, report) = file.clean(options)?;
    let tolerance = SYMMETRY_TOLERANCE * mesh.bounds().diagonal();
    Ok(Examination {
        report,
        solids: file.solids(),
        stated_unit: file.stated_unit(),
        ledger: file.ledger(options),
        symmetry: symmetry::detect(&mesh, tolerance),
    })
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::frame::symmetry::axis::SymmetryOrder;
    use crate::mesh::shapes::PegInHole;
    use crate::mesh_io::write_obj;

    /// A peg that lies anywhere, in inches: its fourfold axis, and nothing of where it lies.
    #[test]
    fn a_turned_peg_is_told_by_its_axis_its_size_and_its_solids() {
        let (_, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.7, 1.1);
        let placed = peg.transformed(turn, DVec3::new(0.2, -0.1, 0.05));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("peg.obj");
        write_obj(&path, &placed).unwrap();
        let options = ReadOptions {
            unit: LengthUnit::Inch,
            ..ReadOptions::default()
        };
        let found = examine(&path, &options).unwrap();
        assert_eq!(found.stated_unit, None);
        assert_eq!(found.report.triangles, peg.triangles().len());
        // Written in metres, read as inches; the text holds all digits.
        let volume = found.report.volume / 0.0254f64.powi(3) / peg.volume();
        assert!((volume - 1.0).abs() < 1e-9, "{volume}");
        let along = turn * DVec3::Z;
        let axis = found.symmetry.iter().find(|axis| {
            axis.order == SymmetryOrder::Finite(4) && axis.direction.dot(along).abs() > 1.0 - 1e-6
        });
        assert!(axis.is_some(), "{:?}", found.symmetry);
        let missing = examine(folder.path().join("none.obj"), &options);
        assert!(matches!(missing, Err(MeshError::Read { .. })));
    }
}
