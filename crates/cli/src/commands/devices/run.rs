//! What is attached and what it can do.

use haptic::device::attached::MissingDriver;
use haptic::device::info::{Access, DeviceInfo, DeviceKind};

use super::choose::{explain, pick, survey, unusable, which_text};
use super::probe;
use crate::args::DevicesArgs;
use crate::args::device_choice::Which;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::print_json;

pub(in crate::commands) fn run(args: &DevicesArgs, context: &Context) -> Result<(), CommandError> {
    let name = args.device.clone();
    let which = name.map_or(Which::First, Which::Named);
    let found = survey(&kinds(which.name()), which.name())?;
    if args.probe {
        let device = pick(&found, |d| which.means(d), &which_text(&which))?;
        return probe::run(device, args.seconds, context);
    }
    match context.json {
        true => print_json(&found)?,
        false => found.devices.iter().for_each(print),
    }
    found.missing.iter().for_each(tell);
    if found.devices.iter().any(|d| d.access == Access::Ready) {
        explain(&found.devices);
        return Ok(());
    }
    Err(unusable(&found.devices))
}

/// The kinds that a device of this name can be: the one it begins with, as `haply:049D` does, or
/// all of them.
fn kinds(name: Option<&str>) -> Vec<DeviceKind> {
    let word = name.map(|name| name.split_once(':').map_or(name, |(word, _)| word));
    let named = DeviceKind::ALL.into_iter().find(|k| Some(k.word()) == word);
    named.map_or_else(|| DeviceKind::ALL.to_vec(), |kind| vec![kind])
}

/// Says what a kind of device wants before there can be one.
fn tell(missing: &MissingDriver) {
    crate::remark!("{}: {}", missing.kind.word(), missing.reason);
}

fn print(device: &DeviceInfo) {
    let spec = &device.spec;
    let serial = match device.serial.as_str() {
        "" => String::new(),
        serial => format!(", serial {serial}"),
    };
    let ids = device
        .usb
        .map_or_else(String::new, |ids| format!(", {ids}"));
    crate::say!(
        "{}  {} ({}{ids}{serial})",
        device.path,
        device.name,
        device.kind.maker()
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
