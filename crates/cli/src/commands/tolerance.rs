//! Choosing lattice, sampling and rotation step for a force error that was asked for.
//!
//! Whole tables would take too long to try. The share of the error that comes from the lattice is
//! found at a few rotations alone (nothing is interpolated between rotations); the rest from balls of
//! one rotation step around the same rotations, which hold just the nodes that a query in their
//! middle reads. Truth is direct quadrature on a lattice of half the spacing.

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergyTable, FieldSampling, RotationDomain, TableError,
    TableSpec, measure_error, random_pose,
};
use sdf_grid::Sampling;

use crate::context::Context;
use crate::scene::Assembly;
use crate::error::CommandError;
use crate::report::bytes::display_bytes;
use crate::scene::{EnergyScale, LatticeStep, Scene};

/// Rotations that are probed.
const ROTATIONS: u64 = 3;

/// Poses at each.
const POSES: usize = 300;

/// Share of the tolerance that the lattice may use up: errors of lattice and rotations add like
/// squares, and the probes are few.
const LATTICE_SHARE: f64 = 0.7;

/// The whole error of the probes must stay below this share of the tolerance.
const PROBE_SHARE: f64 = 0.9;

/// From one spacing or step to the next.
const REFINEMENT: f64 = 1.5;

/// Spacings and steps tried, at most.
const TRIALS: usize = 8;

/// What was chosen.
pub(super) struct Choice {
    pub(super) assembly: Assembly,
    /// On half the spacing.
    pub(super) truth: DirectEvaluator,
    /// Spacing of `truth`, metres.
    pub(super) reference_spacing: f64,
}

/// Chooses for `tolerance`, the rms error of the force as a share of the rms force.
pub(super) fn choose(
    scene: Scene,
    tolerance: f64,
    context: &Context,
) -> Result<Choice, CommandError> {
    let mut choice = choose_lattice(scene, tolerance, context)?;
    choose_step(&mut choice, tolerance, context)?;
    Ok(choice)
}

fn choose_lattice(
    mut scene: Scene,
    tolerance: f64,
    context: &Context,
) -> Result<Choice, CommandError> {
    let first = Assembly::load(scene.clone(), context)?;
    // The same scale for all, or forces could not be compared.
    scene.energy = EnergyScale::Gamma(first.pair.model().gamma);
    let mut spacing = first.pair.spacing();
    drop(first);
    let mut reached = (f64::INFINITY, spacing);
    for _ in 0..TRIALS {
        let found = lattice_error(&scene, spacing, context);
        let (error, choice) = match found {
            Ok(found) => found,
            Err(CommandError::Memory {
                what,
                needed,
                budget,
            }) if reached.0.is_finite() => {
                let reason = format!(
                    "of which the lattice may use 70 %, at a spacing of {:.4} mm; half of {:.4} mm, to compare with, would need {} for \
                     {what}, and {} can be used",
                    1e3 * reached.1,
                    1e3 * spacing,
                    display_bytes(needed),
                    display_bytes(budget)
                );
                return Err(missed("the lattice", tolerance, reached.0, reason));
            }
            Err(other) => return Err(other),
        };
        context.progress.note(&format!(
            "spacing {:.4} mm, {:?}{}: force error {:.3} %",
            1e3 * spacing,
            choice.assembly.scene.lattice.sampling,
            if choice.assembly.scene.lattice.deaverage {
                ", de-averaged"
            } else {
                ""
            },
            100.0 * error
        ));
        if error <= LATTICE_SHARE * tolerance {
            return Ok(choice);
        }
        if error < reached.0 {
            reached = (error, spacing);
        }
        spacing /= REFINEMENT;
    }
    let reason = format!(
        "at a spacing of {:.4} mm, of {TRIALS} tried",
        1e3 * reached.1
    );
    Err(missed("the lattice", tolerance, reached.0, reason))
}

fn missed(part: &'static str, asked: f64, reached: f64, reason: String) -> CommandError {
    CommandError::Tolerance {
        part,
        asked,
        reached,
        reason,
    }
}

/// The best sampling at a spacing, and its error.
fn lattice_error(
    scene: &Scene,
    spacing: f64,
    context: &Context,
) -> Result<(f64, Choice), CommandError> {
    let at = |spacing: f64, fields: FieldSampling| {
        let mut scene = scene.clone();
        scene.lattice.step = LatticeStep::Spacing(spacing);
        scene.lattice.sampling = fields.sampling;
        scene.lattice.deaverage = fields.deaverage;
        Assembly::load(scene, context)
    };
    let average = FieldSampling {
        sampling: Sampling::CellAverage,
        deaverage: false,
    };
    let reference_spacing = 0.5 * spacing;
    let fine = at(reference_spacing, average)?;
    let truth = fine.direct(&DirectOptions::FULL)?;
    let mut best: Option<(f64, Assembly)> = None;
    for fields in [
        average,
        FieldSampling {
            deaverage: true,
            ..average
        },
        FieldSampling {
            sampling: Sampling::Point,
            ..average
        },
    ] {
        let assembly = at(spacing, fields)?;
        let error = probe(&assembly, &truth, None, context)?;
        if best.as_ref().is_none_or(|(least, _)| error < *least) {
            best = Some((error, assembly));
        }
    }
    let (error, assembly) = best.expect("three were tried");
    Ok((
        error,
        Choice {
            assembly,
            truth,
            reference_spacing,
        },
    ))
}

/// Refines the scene's rotation step until the probes meet the tolerance, or coarsens it while they
/// do with ease.
fn choose_step(choice: &mut Choice, tolerance: f64, context: &Context) -> Result<(), CommandError> {
    let Some(mut step) = step_of(&choice.assembly.scene.rotations) else {
        return Ok(());
    };
    let mut least = (f64::INFINITY, step);
    let mut met: Option<f64> = None;
    for _ in 0..TRIALS {
        if let Err((what, limit)) = fits(&choice.assembly, step, context) {
            if met.is_some() {
                break;
            }
            let reason = format!(
                "at {:.3} degrees; {step:.3} would need {what}, and {limit} can be used",
                least.1
            );
            return Err(missed("the rotation step", tolerance, least.0, reason));
        }
        let error = probe(&choice.assembly, &choice.truth, Some(step), context)?;
        context.progress.note(&format!(
            "rotation step {step:.3} degrees: force error {:.3} %",
            100.0 * error
        ));
        if error < least.0 {
            least = (error, step);
        }
        let coarser = (REFINEMENT * step).min(MAX_STEP);
        if error <= PROBE_SHARE * tolerance {
            // The coarsest so far that is good enough.
            let went_down =
                met.is_none() && step < step_of(&choice.assembly.scene.rotations).unwrap_or(step);
            met = Some(met.map_or(step, |m| m.max(step)));
            if went_down || coarser == step {
                break;
            }
            step = coarser;
        } else if met.is_some() {
            break;
        } else {
            step /= REFINEMENT;
        }
    }
    let Some(step) = met else {
        let reason = format!("at {:.3} degrees, of {TRIALS} tried", least.1);
        return Err(missed("the rotation step", tolerance, least.0, reason));
    };
    set_step(&mut choice.assembly.scene.rotations, step);
    Ok(())
}

/// The coarsest rotation step that is tried, degrees.
const MAX_STEP: f64 = 15.0;

/// Whether the whole table would fit in memory at a step; else its need and the limit.
fn fits(assembly: &Assembly, step: f64, context: &Context) -> Result<(), (String, String)> {
    let needed = || -> Option<u128> {
        let mut spec = assembly.table_spec().ok()?;
        set_step(&mut spec.rotations, step);
        let rotations = spec.grid().ok()?.nodes().len();
        Some(spec.bytes(rotations))
    };
    let limit = display_bytes(context.memory);
    match needed() {
        Some(bytes) if bytes <= u128::from(context.memory) => Ok(()),
        Some(bytes) => {
            let bytes = u64::try_from(bytes).unwrap_or(u64::MAX);
            Err((display_bytes(bytes), limit))
        }
        None => Err(("more nodes than any table may have".into(), limit)),
    }
}

/// The rms force error of small tables around random rotations of the scene, as a share of the rms
/// force; at the rotations alone, or with rotation nodes `step` degrees apart.
fn probe(
    assembly: &Assembly,
    truth: &DirectEvaluator,
    step: Option<f64>,
    context: &Context,
) -> Result<f64, CommandError> {
    let energies = assembly.energies(context)?;
    let whole = assembly.table_spec()?;
    let (mut error, mut scale) = (0.0, 0.0);
    for index in 0..ROTATIONS {
        let rotation = random_pose(&whole, 17, index).rotation.to_array();
        let spec = TableSpec {
            rotations: around(&whole.rotations, rotation, step),
            symmetry: None,
            ..whole.clone()
        };
        let table = EnergyTable::compute(spec, &energies, context.memory, &context.progress)
            .map_err(|e| match e {
                TableError::Cancelled => CommandError::Interrupted,
                e => CommandError::bad_input(assembly.context("probing"), e),
            })?;
        let force = measure_error(&table, truth, POSES, 18 + index).force;
        error += force.rms * force.rms;
        scale += force.scale * force.scale;
    }
    context.progress.finish();
    Ok((error / scale).sqrt())
}

/// The rotations of a probe.
fn around(whole: &RotationDomain, center: [f64; 4], step: Option<f64>) -> RotationDomain {
    match (whole, step) {
        (RotationDomain::List { .. }, _) | (_, None) => RotationDomain::List {
            rotations: vec![center],
            margin_deg: 5.0,
        },
        (RotationDomain::Spin { axis, .. }, Some(step_deg)) => RotationDomain::Spin {
            center,
            axis: *axis,
            range_deg: Some([-2.0 * step_deg, 2.0 * step_deg]),
            step_deg,
        },
        (_, Some(step_deg)) => RotationDomain::Ball {
            center,
            angle_deg: 0.5 * step_deg,
            step_deg,
        },
    }
}

fn step_of(domain: &RotationDomain) -> Option<f64> {
    match domain {
        RotationDomain::List { .. } => None,
        RotationDomain::Spin { step_deg, .. }
        | RotationDomain::Ball { step_deg, .. }
        | RotationDomain::Full { step_deg, .. } => Some(*step_deg),
    }
}

fn set_step(domain: &mut RotationDomain, step: f64) {
    match domain {
        RotationDomain::List { .. } => {}
        RotationDomain::Spin { step_deg, .. }
        | RotationDomain::Ball { step_deg, .. }
        | RotationDomain::Full { step_deg, .. } => *step_deg = step,
    }
}
