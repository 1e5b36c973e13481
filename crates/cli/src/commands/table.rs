//! `pegfit table`: what a table holds.

use fft_correlate::store::TableStore;
use fft_correlate::{ErrorReport, RotationDomain, TableSpec};
use serde::Serialize;

use super::{Context, bake, print_json};
use crate::args::TableArgs;
use crate::error::CommandError;
use crate::memory::display_bytes;

#[derive(Serialize)]
struct Description<'a> {
    table: String,
    program: &'a str,
    rotations: usize,
    finished: usize,
    missing: usize,
    damaged: usize,
    displacements: [usize; 3],
    bytes_dense: u64,
    bytes_on_disk: u64,
    energy_unit: f64,
    negligible: f64,
    spec: &'a TableSpec,
    error: Option<&'a ErrorReport>,
}

pub(super) fn run(args: &TableArgs, context: &Context) -> Result<(), CommandError> {
    let store = bake::open(&args.table)?;
    let progress = bake::examine(&store)?;
    let description = Description {
        table: args.table.display().to_string(),
        program: store.program(),
        rotations: progress.rotations,
        finished: progress.finished,
        missing: progress.missing,
        damaged: progress.damaged,
        displacements: store.spec().window.shape(),
        bytes_dense: u64::try_from(store.spec().bytes(progress.rotations)).unwrap_or(u64::MAX),
        bytes_on_disk: store
            .bytes_on_disk()
            .map_err(|e| CommandError::failure("table", e))?,
        energy_unit: store.unit(),
        negligible: store.negligible(),
        spec: store.spec(),
        error: store.error_report(),
    };
    match context.json {
        true => print_json(&description)?,
        false => print(&description, &store),
    }
    match progress.damaged {
        0 => Ok(()),
        count => Err(CommandError::DamagedTable {
            table: description.table,
            count,
            total: progress.rotations,
        }),
    }
}

fn print(d: &Description, store: &TableStore) {
    let spec = d.spec;
    crate::say!("{}, by {}", d.table, d.program);
    crate::say!(
        "  rotations      {} nodes, {}{}",
        d.rotations,
        domain(&spec.rotations),
        match &spec.symmetry {
            Some(s) if s.order == 0 => format!(", the {:?} part turns freely", s.part),
            Some(s) => format!(", the {:?} part has {} equal turns", s.part, s.order),
            None => String::new(),
        }
    );
    let bounds = spec.window.node_bounds();
    crate::say!(
        "  displacements  {} x {} x {}, every {:.4} mm, from {:.3} to {:.3} mm",
        d.displacements[0],
        d.displacements[1],
        d.displacements[2],
        1e3 * spec.window.spacing(),
        1e3 * bounds.min,
        1e3 * bounds.max
    );
    let m = &spec.model;
    crate::say!(
        "  model          sigma {}, lambda {} : {}, separation weight {}, gamma {:.6e} J/m^3",
        m.sigma,
        m.lambda_exterior,
        m.lambda_interior,
        m.separation_weight,
        m.gamma
    );
    crate::say!("  fixed mesh     {}", spec.fixed_mesh);
    crate::say!("  moving mesh    {}", spec.moving_mesh);
    crate::say!(
        "  storage        {:?}, unit {:e} J, energies within {:.3e} J of the far one left out",
        spec.storage.numbers,
        d.energy_unit,
        d.negligible
    );
    crate::say!(
        "  size           {} on disk, at most {} in memory",
        display_bytes(d.bytes_on_disk),
        display_bytes(d.bytes_dense)
    );
    crate::say!(
        "  finished       {} of {} rotations, {} missing, {} damaged",
        d.finished,
        d.rotations,
        d.missing,
        d.damaged
    );
    match store.error_report() {
        None => crate::say!(
            "  error          not measured (`pegfit bake` does so when a table is finished)"
        ),
        Some(report) => print_error(report),
    }
}

/// The errors that a table states, as shares of each quantity's rms.
pub(super) fn print_error(report: &ErrorReport) {
    let reference = match report.reference_spacing {
        0.0 => "on the table's own lattice".to_owned(),
        h => format!("on a lattice of {:.4} mm", 1e3 * h),
    };
    crate::say!(
        "  error          against direct evaluation {reference} at {} held-out poses (seed {}), of \
         each rms:",
        report.poses,
        report.seed
    );
    for (name, e) in report.quantities() {
        let percent = |value: f64| 100.0 * value / e.scale;
        let [x, y, z, qx, qy, qz, qw] = e.worst_pose;
        crate::say!(
            "    {name:<7} rms {:.3} %, p99 {:.3} %, worst {:.2} % at t = ({x:.6}, {y:.6}, {z:.6}) \
             m, q = ({qx:.5}, {qy:.5}, {qz:.5}, {qw:.5})",
            percent(e.rms),
            percent(e.p99),
            percent(e.worst)
        );
    }
    if let Some(condition) = report.condition {
        crate::say!("    the terms of a score are {condition:.3} times the score in all (median)");
    }
}

fn domain(domain: &RotationDomain) -> String {
    match domain {
        RotationDomain::List { rotations, .. } => format!("a list of {}", rotations.len()),
        RotationDomain::Spin { axis, step_deg, .. } => {
            format!("a spin about {axis:?} every {step_deg:.4} degrees")
        }
        RotationDomain::Ball {
            angle_deg,
            step_deg,
            ..
        } => format!("a ball of {angle_deg} degrees every {step_deg:.4}"),
        RotationDomain::Full { step_deg, .. } => format!("all, every {step_deg:.4} degrees"),
    }
}
