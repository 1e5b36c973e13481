//! `pegfit verify`: is a table as right as it says?

use fft_correlate::store::TableStore;
use fft_correlate::{
    DirectEvaluator, DirectOptions, ErrorReport, Excess, Pair, measure_error, typical_condition,
};
use serde::Serialize;

use super::{Context, bake, print_json};
use crate::args::VerifyArgs;
use crate::assembly::Assembly;
use crate::error::CommandError;
use crate::scene::{EnergyScale, LatticeStep, Scene};

#[derive(Serialize)]
struct Verdict {
    table: String,
    margin: f64,
    stated: ErrorReport,
    found: ErrorReport,
    beyond: Vec<Excess>,
}

pub(super) fn run(args: &VerifyArgs, context: &Context) -> Result<(), CommandError> {
    let store = bake::open(&args.table)?;
    let name = args.table.display().to_string();
    let Some(stated) = store.error_report().cloned() else {
        return Err(CommandError::input(
            &name,
            "attribute error",
            "the error measured when the table was finished",
            "none: bake with --resume",
        ));
    };
    let table = bake::load(&store, context)?;
    let (truth, pair) = reference(
        &store,
        Scene::read(&args.scene)?.only(args.fixed.as_deref())?,
        stated.reference_spacing,
        context,
    )?;
    let seed = args.seed.unwrap_or(stated.seed.wrapping_add(1));
    let mut found = measure_error(&table, &truth, args.poses, seed);
    found.reference_spacing = stated.reference_spacing;
    let looks = args.poses.min(bake::CONDITION_POSES);
    found.condition = Some(typical_condition(&pair, table.spec(), looks, seed));
    let beyond = stated.exceeded_by(&found, args.margin);
    let count = beyond.len();
    let verdict = Verdict {
        table: name.clone(),
        margin: args.margin,
        stated,
        found,
        beyond,
    };
    match context.json {
        true => print_json(&verdict)?,
        false => print(&verdict),
    }
    match count {
        0 => Ok(()),
        count => Err(CommandError::Claim { table: name, count }),
    }
}

/// The evaluator that a table's error is measured against, direct quadrature on densities of
/// `spacing` (0: the table's own), with the table's sampling and energy scale; and the pair that it
/// evaluates.
pub(super) fn reference(
    store: &TableStore,
    mut scene: Scene,
    spacing: f64,
    context: &Context,
) -> Result<(DirectEvaluator, Pair), CommandError> {
    let spec = store.spec();
    let model = &spec.model;
    let numbers = |m: &fft_correlate::ScoreModel| {
        [
            m.sigma,
            m.lambda_exterior,
            m.lambda_interior,
            m.separation_weight,
        ]
    };
    if numbers(&scene.model) != numbers(model) {
        return Err(CommandError::input(
            scene.path.display().to_string(),
            "model",
            format!("that of the table, {:?}", numbers(model)),
            format!("{:?}", numbers(&scene.model)),
        ));
    }
    scene.energy = EnergyScale::Gamma(model.gamma);
    let spacing = if spacing > 0.0 {
        spacing
    } else {
        spec.window.spacing()
    };
    scene.lattice.step = LatticeStep::Spacing(spacing);
    if let Some(fields) = spec.fields {
        scene.lattice.sampling = fields.sampling;
        scene.lattice.deaverage = fields.deaverage;
    }
    let assembly = Assembly::load(scene, context)?;
    let [fixed, moving] = assembly.mesh_hashes();
    store
        .expect_meshes(&fixed, &moving)
        .map_err(|e| CommandError::bad_input("table", e))?;
    Ok((assembly.direct(&DirectOptions::FULL)?, assembly.pair))
}

fn print(verdict: &Verdict) {
    crate::say!(
        "{}: {} fresh poses (seed {}), error as a share of each quantity's rms",
        verdict.table,
        verdict.found.poses,
        verdict.found.seed
    );
    crate::say!(
        "{:<8}{:>14}{:>12}{:>14}{:>12}",
        "",
        "rms stated",
        "found",
        "p99 stated",
        "found"
    );
    for ((name, a), (_, b)) in verdict
        .stated
        .quantities()
        .into_iter()
        .zip(verdict.found.quantities())
    {
        let percent = |value: f64| 100.0 * value / a.scale;
        crate::say!(
            "{name:<8}{:>12.3} %{:>10.3} %{:>12.3} %{:>10.3} %",
            percent(a.rms),
            percent(b.rms),
            percent(a.p99),
            percent(b.p99)
        );
    }
    let terms = |r: &ErrorReport| r.condition.map_or("-".to_owned(), |c| format!("{c:.3}"));
    crate::say!(
        "terms of a score over the score (median): {} stated, {} found",
        terms(&verdict.stated),
        terms(&verdict.found)
    );
    for excess in &verdict.beyond {
        crate::say!(
            "BEYOND: {} of {} is {:.4e}, {:.4e} stated, {:.0} % more than that is accepted",
            excess.statistic,
            excess.quantity,
            excess.found,
            excess.claimed,
            100.0 * verdict.margin
        );
    }
    if verdict.beyond.is_empty() {
        crate::say!("holds within {:.0} %", 100.0 * verdict.margin);
    }
}
