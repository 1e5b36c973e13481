//! `pegfit verify`: is a table as right as it says?

use fft_correlate::{ErrorReport, Excess};
use serde::Serialize;

use super::{scenes, stored};
use crate::args::VerifyArgs;
use crate::context::Context;
use crate::error::{CommandError, Exit};

#[derive(Serialize)]
struct Verdict {
    table: String,
    margin: f64,
    stated: ErrorReport,
    found: ErrorReport,
    beyond: Vec<Excess>,
}

pub(super) fn run(args: &VerifyArgs, context: &Context) -> Result<(), CommandError> {
    let store = stored::open(&args.table)?;
    let name = args.table.display().to_string();
    let scene = scenes::read(&args.scene, args.fixed.as_deref())?;
    let setup = scenes::setup(scene, context)?;
    setup.expect_table(&store)?;
    let Some(stated) = store.error_report().cloned() else {
        return Err(CommandError::input(
            &name,
            "attribute error",
            "the error measured when the table was finished",
            "none: `pegfit bake` with --resume and the options of its bake measures it",
        ));
    };
    let table = stored::load(&store, context)?;
    let spacing = (stated.reference_spacing > 0.0).then_some(stated.reference_spacing);
    let (reference, pair) = setup.reference(store.spec(), spacing, &context.progress)?;
    context.progress.finish();
    let seed = args.seed.unwrap_or(stated.seed.wrapping_add(1));
    let found = ErrorReport {
        reference_spacing: stated.reference_spacing,
        ..reference.measure(&table, &pair, args.poses, seed)
    };
    let beyond = stated.exceeded_by(&found, args.margin);
    let count = beyond.len();
    let verdict = Verdict {
        table: name.clone(),
        margin: args.margin,
        stated,
        found,
        beyond,
    };
    context.show(&verdict, || print(&verdict))?;
    match count {
        0 => Ok(()),
        count => Err(CommandError::Verdict(
            format!(
                "{name}: {count} of 6 errors are beyond what the table states, by more than the margin"
            ),
            Exit::Failure,
        )),
    }
}

fn print(verdict: &Verdict) {
    say!(
        "{}: {} fresh poses (seed {}), error as a share of each quantity's rms",
        verdict.table,
        verdict.found.poses,
        verdict.found.seed
    );
    say!(
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
        say!(
            "{name:<8}{:>12.3} %{:>10.3} %{:>12.3} %{:>10.3} %",
            percent(a.rms),
            percent(b.rms),
            percent(a.p99),
            percent(b.p99)
        );
    }
    let terms = |r: &ErrorReport| r.condition.map_or("-".to_owned(), |c| format!("{c:.3}"));
    say!(
        "terms of a score over the score (median): {} stated, {} found",
        terms(&verdict.stated),
        terms(&verdict.found)
    );
    for excess in &verdict.beyond {
        say!(
            "BEYOND: {} of {} is {:.4e}, {:.4e} stated, {:.0} % more than that is accepted",
            excess.statistic,
            excess.quantity,
            excess.found,
            excess.claimed,
            100.0 * verdict.margin
        );
    }
    if verdict.beyond.is_empty() {
        say!("holds within {:.0} %", 100.0 * verdict.margin);
    }
}
