//! The examples one after the other, and what they gave.

use std::path::Path;
use std::time::Instant;

use sdf_grid::shapes::PegInHole;

use super::example::{self, Summary};
use super::page;
use crate::args::DemoArgs;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::print_json;
use crate::terminal::progress::check_interrupt;

/// What to do after the demo.
const NEXT: &str = "
With parts of your own, two closed meshes from one assembly, each in its place (scene.toml):
    unit = \"mm\"
    fixed = \"hole.stl\"
    moving = \"peg.stl\"
then
    pegfit check scene.toml                 can the meshes be used, in this unit, in this place?
    pegfit plot well scene.toml             is the fit a fit?
    pegfit play scene.toml                  hold the part with your mouse
From an assembly in one file: pegfit scene assembly.step";

pub(in crate::commands) fn run(args: &DemoArgs, context: &Context) -> Result<(), CommandError> {
    let began = Instant::now();
    std::fs::create_dir_all(&args.out).map_err(|e| CommandError::write(&args.out, e))?;
    let mut examples = Vec::new();
    for shape in PegInHole::ALL {
        check_interrupt()?;
        examples.push(example::run(shape, &args.out, context)?);
    }
    let summary = Summary {
        examples,
        seconds: began.elapsed().as_secs_f64(),
    };
    let page = page::write(&args.out, &summary)?;
    if context.json {
        return print_json(&summary);
    }
    print(&summary, &page);
    Ok(())
}

fn print(summary: &Summary, page: &Path) {
    crate::say!(
        "example       fields    table     dock    tests   table error  transforms  fit found"
    );
    crate::say!(
        "                 (s)      (s)      (s)      (s)     force (%)  score (%)   to (mm, °)"
    );
    for e in &summary.examples {
        crate::say!(
            "{:<12} {:>7.1} {:>8.1} {:>8.1} {:>8.1} {:>12.2} {:>11.1e}  {:.3}, {:.2}",
            e.name,
            e.field_seconds,
            e.table.seconds,
            e.dock.seconds,
            e.test_seconds,
            100.0 * e.table.force_error,
            100.0 * e.quadrature_error,
            1e3 * e.dock.from_fit_m,
            e.dock.from_fit_degrees,
        );
    }
    for e in &summary.examples {
        if let Some(r) = &e.real_time {
            crate::say!(
                "real-time loop ({}, from its table): {:.0} Hz, latency p50 {:.0} µs, p99 {:.0} µs, {} overruns in \
                 {} ticks",
                e.name,
                r.rate_hz,
                r.latency_us.p50,
                r.latency_us.p99,
                r.overruns,
                r.ticks
            );
        }
    }
    crate::say!("{:.0} s in all; open {}", summary.seconds, page.display());
    crate::say!("{NEXT}");
}
