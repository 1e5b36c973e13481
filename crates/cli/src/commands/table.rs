//! `pegfit table`: what a table holds.

use fft_correlate::{ErrorReport, Placement, Pose, RotationDomain, TableSpec, TableStore};
use sdf_grid::Sampling;
use sdf_grid::text::significant;
use serde::Serialize;

use super::stored;
use crate::args::TableArgs;
use crate::bytes::display_bytes;
use crate::context::Context;
use crate::error::CommandError;

#[derive(Serialize)]
struct Description<'a> {
    table: String,
    program: &'a str,
    #[serde(flatten)]
    progress: stored::Progress,
    displacements: [usize; 3],
    bytes_dense: u64,
    bytes_on_disk: u64,
    energy_unit: f64,
    negligible: f64,
    spec: &'a TableSpec,
    error: Option<&'a ErrorReport>,
}

pub(super) fn run(args: &TableArgs, context: &Context) -> Result<(), CommandError> {
    let store = stored::open(&args.table)?;
    let progress = stored::examine(&store, context)?;
    let description = Description {
        table: args.table.display().to_string(),
        program: store.program(),
        progress,
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
    context.show(&description, || print(&description, &store))?;
    stored::expect_whole(&store, &progress)
}

fn print(d: &Description, store: &TableStore) {
    let spec = d.spec;
    say!("{}, by {}", d.table, d.program);
    say!(
        "  rotations      {} nodes, {}{}",
        d.progress.rotations,
        domain(&spec.rotations),
        match &spec.symmetry {
            Some(s) if s.order == 0 => format!(", the {} part turns freely", s.part),
            Some(s) => format!(", the {} part has {} equal turns", s.part, s.order),
            None => String::new(),
        }
    );
    let bounds = spec.window.node_bounds();
    say!(
        "  displacements  {} x {} x {}, every {:.4} mm, from {:.3} to {:.3} mm",
        d.displacements[0],
        d.displacements[1],
        d.displacements[2],
        1e3 * spec.window.spacing(),
        1e3 * bounds.min,
        1e3 * bounds.max
    );
    say!(
        "  outside        energies fade over {:.1} mm, and over the rest of the half turn",
        1e3 * spec.fade_length()
    );
    if spec.placement != Placement::IDENTITY {
        place("fixed", &spec.placement.fixed);
        place("moving", &spec.placement.moving);
    }
    print_provenance(spec);
    print_contents(d);
    match store.error_report() {
        None => {
            say!("  error          not measured (`pegfit bake` does so when a table is finished)")
        }
        Some(report) => stored::print_error(report),
    }
}

/// What its numbers depend on.
fn print_provenance(spec: &TableSpec) {
    let m = spec.model();
    say!(
        "  model          sigma {}, lambda {} : {}, separation weight {}, gamma {:.6e} J/m^3",
        m.sigma,
        m.lambda_exterior,
        m.lambda_interior,
        m.separation_weight,
        m.gamma
    );
    for (name, field) in [
        ("fixed", &spec.provenance.fixed),
        ("moving", &spec.provenance.moving),
    ] {
        if let Some(field) = field {
            say!("  {:<15}{}", format!("{name} mesh"), field.mesh);
        }
    }
    if let Some(field) = &spec.provenance.fixed {
        say!(
            "  fields         {}, halo {:.4} mm, tolerance {}, version {}",
            sampling(field.sampling),
            1e3 * field.halo,
            field.tolerance,
            field.version
        );
    }
}

/// What is there.
fn print_contents(d: &Description) {
    say!(
        "  storage        float16, unit {:e} J, energies within {:.3e} J of the far one left out",
        d.energy_unit,
        d.negligible
    );
    say!(
        "  size           {} on disk, at most {} in memory",
        display_bytes(d.bytes_on_disk),
        display_bytes(d.bytes_dense)
    );
    say!(
        "  finished       {} of {} rotations, {} missing, {} damaged",
        d.progress.finished,
        d.progress.rotations,
        d.progress.missing,
        d.progress.damaged
    );
}

/// Where the scene that it was baked for puts a part.
fn place(part: &str, pose: &Pose) {
    say!(
        "  {:<15}{:.3} mm, turned by {:.5}",
        format!("{part} part at"),
        1e3 * pose.translation,
        pose.rotation
    );
}

fn sampling(sampling: Sampling) -> String {
    match sampling {
        Sampling::Point => "values at the nodes".to_owned(),
        Sampling::CellAverage => "means over the nodes' cells".to_owned(),
        Sampling::Smoothed { deviation, .. } => format!("smoothed over {:.4} mm", 1e3 * deviation),
    }
}

fn domain(domain: &RotationDomain) -> String {
    match domain {
        RotationDomain::List { rotations, .. } => format!("a list of {}", rotations.len()),
        RotationDomain::Spin { axis, step_deg, .. } => {
            let [x, y, z] = axis.map(|c| significant(c, 4));
            format!("a spin about ({x}, {y}, {z}) every {step_deg:.4} degrees")
        }
        RotationDomain::Ball {
            angle_deg,
            step_deg,
            ..
        } => format!("a ball of {angle_deg} degrees every {step_deg:.4}"),
        RotationDomain::Full { step_deg, .. } => format!("all, every {step_deg:.4} degrees"),
    }
}
