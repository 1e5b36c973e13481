//! Everything that a density field's values depend on.

use serde::{Deserialize, Serialize};

use super::kernel::DensityKernel;
use super::lattice::Lattice;
use super::options::{DensityOptions, Sampling};
use crate::mesh::triangle_mesh::TriangleMesh;

/// Version of the computed values: raised whenever the same inputs give other densities, or other
/// sums over surfaces.
pub const FIELD_VERSION: u32 = 18;

/// Everything that the values of a field depend on: fields of equal provenance have equal bits.
///
/// It is kept with the field and with everything made from it (caches, tables, docking's state);
/// [`crate::provenance::difference`] says in what two provenances differ.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{DensityKernel, DensityOptions, FieldProvenance, Lattice, provenance, shapes};
///
/// let cube = shapes::cuboid(DVec3::splat(0.01))?;
/// let lattice = Lattice::covering(&cube.bounds(), 0.002, 0.002)?;
/// let of = |sigma| -> Result<FieldProvenance, sdf_grid::KernelError> {
///     let kernel = DensityKernel::new(sigma)?;
///     Ok(FieldProvenance::new(&cube, &kernel, &lattice, &DensityOptions::default()))
/// };
/// assert_eq!(of(0.2)?.hash(), of(0.2)?.hash());
/// assert_ne!(of(0.2)?.hash(), of(0.1)?.hash());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldProvenance {
    /// [`FIELD_VERSION`] of the program that computed the values.
    pub version: u32,
    /// [`TriangleMesh::hash`] of the part, 64 hexadecimal digits.
    pub mesh: String,
    /// Kernel thickness, dimensionless.
    pub sigma: f64,
    /// Distance outside the part, metres, at which the exterior has faded to zero; infinite for
    /// none, which JSON holds as null.
    #[serde(with = "unlimited")]
    pub halo: f64,
    /// Relative L2 error that the values meet.
    pub tolerance: f64,
    /// How values represent cells.
    pub sampling: Sampling,
    /// Where the values sit, in the part's own frame.
    pub lattice: Lattice,
}

impl FieldProvenance {
    /// The provenance of the field that this version computes from these inputs.
    pub fn new(
        mesh: &TriangleMesh,
        kernel: &DensityKernel,
        lattice: &Lattice,
        options: &DensityOptions,
    ) -> Self {
        let mesh = blake3::Hash::from_bytes(mesh.hash());
        Self {
            version: FIELD_VERSION,
            mesh: mesh.to_hex().to_string(),
            sigma: kernel.sigma(),
            halo: options.halo,
            tolerance: options.tolerance,
            sampling: options.sampling,
            lattice: *lattice,
        }
    }

    /// BLAKE3 hash of the whole provenance: the key of caches.
    pub fn hash(&self) -> blake3::Hash {
        blake3::hash(self.to_json().as_bytes())
    }

    /// The provenance as one line of JSON, the same for equal provenances.
    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string(self).expect("numbers, text and lists all have a form in JSON")
    }
}

/// Lengths that may be infinite, for formats that know no infinity.
mod unlimited {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(length: &f64, to: S) -> Result<S::Ok, S::Error> {
        length.is_finite().then_some(length).serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(from)?.unwrap_or(f64::INFINITY))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn provenance(halo: f64) -> FieldProvenance {
        FieldProvenance {
            version: FIELD_VERSION,
            mesh: "00".repeat(32),
            sigma: 0.1,
            halo,
            tolerance: 1e-3,
            sampling: Sampling::CellAverage,
            lattice: Lattice::new(DVec3::splat(-0.1), 1.0 / 3.0, [3, 4, 5]).unwrap(),
        }
    }

    #[test]
    fn provenance_survives_json_to_the_bit() {
        for halo in [f64::INFINITY, 0.1 + 0.2, f64::MIN_POSITIVE] {
            let provenance = provenance(halo);
            let read: FieldProvenance = serde_json::from_str(&provenance.to_json()).unwrap();
            assert_eq!(read, provenance);
            assert_eq!(read.hash(), provenance.hash());
        }
        assert_ne!(provenance(1.0).hash(), provenance(2.0).hash());
    }

    #[test]
    fn other_keys_and_missing_ones_are_refused() {
        let text = provenance(1.0).to_json();
        for (from, to) in [("\"sigma\"", "\"sigmas\""), ("\"halo\":1.0,", "")] {
            let changed = text.replace(from, to);
            assert_ne!(changed, text);
            assert!(
                serde_json::from_str::<FieldProvenance>(&changed).is_err(),
                "{to}"
            );
        }
    }
}
