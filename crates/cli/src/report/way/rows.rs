//! A way as comma-separated rows.

use fft_correlate::Placement;
use pegfit_path::PathResult;
use pegfit_scene::poses::{POSE_COLUMNS, pose_fields};

use super::subject::WayReport;

/// After the pose: way gone (metres), overlap of the deepest point (metres), energy (joules), torque
/// (newton metres), force (newtons); the last seven are empty where no energies were asked for.
const COLUMNS: [&str; 9] = [
    "length", "overlap", "energy", "tx", "ty", "tz", "fx", "fy", "fz",
];

impl WayReport {
    /// The poses of the way in the scene as rows of comma-separated numbers: pose, way gone, overlap,
    /// energy, torque, force.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn csv(&self, out: impl std::io::Write) -> csv::Result<()> {
        write(&self.answer, &self.placement, out)
    }
}

/// The poses of a way in the scene that places the shapes so.
pub(crate) fn write(
    answer: &PathResult,
    placement: &Placement,
    out: impl std::io::Write,
) -> csv::Result<()> {
    let mut rows = csv::Writer::from_writer(out);
    rows.write_record(POSE_COLUMNS.iter().chain(&COLUMNS))?;
    for at in &answer.poses {
        let pose = placement.to_scene(&at.pose);
        let numbers = pose_fields(&pose).into_iter().chain([at.length, at.depth]);
        for value in numbers {
            rows.write_field(value.to_string())?;
        }
        match &at.response {
            Some(response) => {
                let wrench = placement.wrench_to_scene(&pose, &response.wrench);
                let vectors = [wrench.torque, wrench.force].map(|v| v.to_array());
                rows.write_field(response.energy.to_string())?;
                for value in vectors.iter().flatten() {
                    rows.write_field(value.to_string())?;
                }
            }
            None => (0..7).try_for_each(|_| rows.write_field(""))?,
        }
        rows.write_record(None::<&[u8]>)?;
    }
    Ok(rows.flush()?)
}
