//! What the demo did.

use std::path::PathBuf;

use fft_correlate::Well;
use haptic::LoopReport;
use serde::Serialize;

/// What the demo did, for `--json` and the closing table.
#[derive(Serialize)]
pub(super) struct Summary {
    pub(super) examples: Vec<Example>,
    pub(super) seconds: f64,
}

/// What one example gave.
#[derive(Serialize)]
pub(super) struct Example {
    pub(super) name: &'static str,
    pub(super) triangles: [usize; 2],
    pub(super) spacing_m: f64,
    pub(super) field_nodes: usize,
    pub(super) field_seconds: f64,
    /// Relative root mean square difference of correlation and quadrature.
    pub(super) quadrature_error: f64,
    pub(super) table: Table,
    pub(super) dock: Dock,
    pub(super) well: Well,
    pub(super) test_seconds: f64,
    pub(super) collision: LoopReport,
    pub(super) snap: LoopReport,
    /// Distance from the fit at the end of the snap test, metres.
    pub(super) snap_ends_m: f64,
    pub(super) real_time: Option<LoopReport>,
    /// Pictures by what they show.
    pub(super) pictures: Vec<Picture>,
}

/// The table of an example.
#[derive(Serialize)]
pub(super) struct Table {
    pub(super) rotations: usize,
    pub(super) displacements: usize,
    pub(super) bytes: u64,
    pub(super) seconds: f64,
    pub(super) energy_error: f64,
    pub(super) force_error: f64,
    pub(super) torque_error: f64,
}

/// Docking of an example.
#[derive(Serialize)]
pub(super) struct Dock {
    /// The joint that contact leaves.
    pub(super) joint: &'static str,
    /// Of contact, nats.
    pub(super) information: f64,
    pub(super) seconds: f64,
    pub(super) best_energy: f64,
    pub(super) from_fit_m: f64,
    pub(super) from_fit_degrees: f64,
}

/// A picture of the demo.
#[derive(Serialize)]
pub(super) struct Picture {
    pub(super) kind: &'static str,
    pub(super) path: PathBuf,
}
