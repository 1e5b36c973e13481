//! The well about the fit in numbers: depth, stiffness, diameter, barriers.

use fft_correlate::{DirectOptions, Well};
use glam::DVec3;
use pegfit_pictures::AXES;
use pegfit_scene::Assembly;

use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::print_json;

pub(in crate::commands) fn analyse(assembly: &Assembly) -> Result<Well, CommandError> {
    let source = assembly.direct(&DirectOptions::REAL_TIME)?;
    Ok(assembly.well(&source)?)
}

pub(in crate::commands) fn print_well(
    assembly: &Assembly,
    well: &Well,
    context: &Context,
) -> Result<(), CommandError> {
    if context.json {
        return print_json(well);
    }
    let unit = assembly.setup.display_unit();
    let metre = unit.in_metres();
    crate::say!("depth       {:.4} mJ", 1e3 * well.depth);
    let offset = DVec3::from_array(well.offset) / metre;
    let turn = DVec3::from_array(well.turn).length().to_degrees();
    crate::say!(
        "minimum     ({:.4}, {:.4}, {:.4}) {unit} and {turn:.3} degrees from the fit",
        offset.x,
        offset.y,
        offset.z
    );
    crate::say!(
        "stiffness is the second difference of the energy over {:.4} {unit} (and the angle that \
         moves the rim by it)",
        well.length / metre
    );
    crate::say!("  axis     stiffness          diameter           peak");
    for (name, axis) in AXES.iter().zip(&well.translations) {
        crate::say!(
            "  {name:<4} {:>13.4} N/m  {:>10.4} {unit}  {:>10.4} N",
            axis.stiffness,
            (axis.sides[0].convex + axis.sides[1].convex) / metre,
            axis.sides[0].peak.max(axis.sides[1].peak)
        );
    }
    for (name, axis) in AXES.iter().zip(&well.rotations) {
        crate::say!(
            "  r{name:<3} {:>13.6} N·m/rad {:>7.3} degrees {:>7.5} N·m",
            axis.stiffness,
            (axis.sides[0].convex + axis.sides[1].convex).to_degrees(),
            axis.sides[0].peak.max(axis.sides[1].peak)
        );
    }
    crate::say!("barriers, as fractions of the depth: the climb on the way out and on the way in");
    for barrier in &well.barriers {
        // Adding zero turns -0 into 0.
        let [x, y, z] = barrier.direction.map(|c| c + 0.0);
        crate::say!(
            "  ({x:>2.0}, {y:>2.0}, {z:>2.0})  out {:>7.3}  in {:>7.3}  beyond {:>7.3}",
            barrier.escape,
            barrier.entry,
            barrier.beyond
        );
    }
    Ok(())
}
