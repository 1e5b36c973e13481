//! What is attached and what it can do.

use haptic::device::hid::{Access, DeviceInfo};

use super::choose::{enumerate, explain, kind_name, pick, unusable, which_text};
use super::probe;
use crate::args::DevicesArgs;
use crate::args::device_choice::Which;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::print_json;

pub(in crate::commands) fn run(args: &DevicesArgs, context: &Context) -> Result<(), CommandError> {
    let found = enumerate()?;
    if args.probe {
        let name = args.device.clone();
        let which = name.map_or(Which::First, Which::Named);
        let device = pick(&found, |d| which.means(d), &which_text(&which))?;
        return probe::run(device, args.seconds, context);
    }
    match context.json {
        true => print_json(&found)?,
        false => found.iter().for_each(print),
    }
    if found.iter().any(|d| d.access == Access::Ready) {
        explain(&found);
        return Ok(());
    }
    Err(unusable(&found))
}

fn print(device: &DeviceInfo) {
    let spec = &device.spec;
    let serial = match device.serial.as_str() {
        "" => String::new(),
        serial => format!(", serial {serial}"),
    };
    crate::say!(
        "{}  {} ({}, {}{serial})",
        device.path,
        device.name,
        kind_name(device.kind),
        device.ids()
    );
    let output = match (spec.rate_controlled, spec.max_force.is_finite()) {
        (true, _) => "forces shown by the cursor giving way".to_owned(),
        (false, true) => format!("{} axes out, up to {} N", spec.output_dof, spec.max_force),
        (false, false) => format!("{} axes out", spec.output_dof),
    };
    let input = if spec.rate_controlled {
        "rates"
    } else {
        "axes"
    };
    crate::say!(
        "    {} {input} in, {output}, {} Hz, {:.0} mm wide",
        spec.input_dof,
        spec.nominal_rate,
        1e3 * spec.workspace
    );
    match &device.access {
        Access::Ready => {}
        Access::Denied => crate::say!("    may not be opened by this user"),
        Access::Failed(reason) => crate::say!("    cannot be opened: {reason}"),
    }
}
