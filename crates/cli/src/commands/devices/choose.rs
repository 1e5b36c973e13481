//! Which device `--device` means.

use std::path::Path;

use haptic::device::attached::{self, Survey};
use haptic::device::info::{Access, DeviceInfo, DeviceKind};
use haptic::log::{Recording, device_file, read_device};
use haptic::{Device, DeviceError, DeviceSpec, HapticConfig, OperatorConfig, Replay, read_log};

use crate::args::device_choice::{DeviceChoice, Which};
use crate::context::Context;
use crate::error::CommandError;
use crate::report::parquet_log;

/// What lets the user who sits at the machine open these devices.
const UDEV_RULES: &str = include_str!("../../../udev/70-pegfit.rules");

/// Where the rules go.
const UDEV_PATH: &str = "/etc/udev/rules.d/70-pegfit.rules";

/// Why no device can be used.
#[derive(Debug, thiserror::Error)]
enum Unusable {
    #[error("no haptic device is attached")]
    None,
    #[error("no {0} device can be used: {1}")]
    Missing(&'static str, String),
    #[error("no attached device is {0}; `pegfit devices` lists what there is")]
    NoSuch(String),
    #[error("{} may not be opened by this user", .0.join(", "))]
    Denied(Vec<String>),
    #[error("{0}")]
    Failed(String),
}

/// What holds the moving part.
pub(in crate::commands) enum Chosen {
    /// The simulated hand.
    Simulated,
    /// A recording.
    Replay(Replay),
    /// A device that was opened.
    Attached(Box<dyn Device>),
}

/// The device that `choice` means, opened with the settings of its kind.
pub(in crate::commands) fn choose(
    choice: &DeviceChoice,
    config: &HapticConfig,
    context: &Context,
) -> Result<Chosen, CommandError> {
    match choice {
        DeviceChoice::Simulated => Ok(Chosen::Simulated),
        DeviceChoice::Replay(path) => replay(path, config, context).map(Chosen::Replay),
        DeviceChoice::Attached(kind, which) => {
            let found = survey(&[*kind], which.name())?;
            let text = format!("{} {}", kind.maker(), which_text(which));
            open(pick(&found, |d| which.means(d), text.trim())?, config).map(Chosen::Attached)
        }
        DeviceChoice::Auto => {
            let found = survey(&DeviceKind::ALL, None)?;
            let ready = |d: &&DeviceInfo| d.access == Access::Ready;
            match found.devices.iter().filter(ready).min_by_key(|d| d.kind) {
                Some(device) => open(device, config).map(Chosen::Attached),
                None => {
                    context
                        .progress
                        .note("note: no device can be opened; simulated hand");
                    explain(&found.devices);
                    Ok(Chosen::Simulated)
                }
            }
        }
    }
}

/// The log and the device that it was recorded with.
fn replay(log: &Path, config: &HapticConfig, context: &Context) -> Result<Replay, CommandError> {
    if parquet_log::is_parquet(log) {
        return Err(CommandError::option(
            "--device",
            "replay:LOG.csv; logs in Parquet are for other programs",
            log.display(),
        ));
    }
    let bad = |e| CommandError::bad_input("--device", e);
    let Recording { samples, torn_line } = read_log(log).map_err(bad)?;
    if let Some(line) = torn_line {
        context.progress.note(&format!(
            "note: {} line {line} ends in the middle, as where a run was killed, and is left out",
            log.display()
        ));
    }
    let recorded = read_device(log).map_err(bad)?;
    if recorded.is_none() {
        context.progress.note(&format!(
            "note: no {}, which says what the device of the log can do; taken for a simulated hand",
            device_file(log).display()
        ));
    }
    let spec = DeviceSpec {
        name: format!("replay of {}", log.display()),
        ..recorded.unwrap_or_else(|| OperatorConfig::default().spec())
    };
    Replay::new(spec, samples, config)
        .map_err(|e| CommandError::bad_input(log.display().to_string(), e))
}

/// What there is of these kinds; `name` is what was typed for the one wanted.
pub(super) fn survey(kinds: &[DeviceKind], name: Option<&str>) -> Result<Survey, CommandError> {
    attached::survey(kinds, name).map_err(|e| CommandError::failure("listing devices", e))
}

pub(super) fn open(
    device: &DeviceInfo,
    config: &HapticConfig,
) -> Result<Box<dyn Device>, CommandError> {
    attached::open(device, config.spacemouse, config.pid)
        .map_err(|e: DeviceError| CommandError::failure(device.path.clone(), e))
}

/// The first device wanted that can be opened.
pub(super) fn pick<'a>(
    found: &'a Survey,
    wanted: impl Fn(&DeviceInfo) -> bool,
    text: &str,
) -> Result<&'a DeviceInfo, CommandError> {
    let candidates: Vec<&DeviceInfo> = found.devices.iter().filter(|d| wanted(d)).collect();
    if let Some(device) = candidates.iter().find(|d| d.access == Access::Ready) {
        return Ok(device);
    }
    if let (true, [missing]) = (candidates.is_empty(), found.missing.as_slice()) {
        let reason = missing.reason.clone();
        return Err(failure(Unusable::Missing(missing.kind.maker(), reason)));
    }
    if candidates.is_empty() && !found.devices.is_empty() {
        return Err(failure(Unusable::NoSuch(text.to_owned())));
    }
    Err(unusable(candidates))
}

fn failure(why: Unusable) -> CommandError {
    CommandError::failure("devices", why)
}

/// Why none of these can be used; prints what would help.
pub(super) fn unusable<'a>(devices: impl IntoIterator<Item = &'a DeviceInfo>) -> CommandError {
    let devices: Vec<&DeviceInfo> = devices.into_iter().collect();
    explain(devices.iter().copied());
    let denied = devices.iter().filter(|d| d.access == Access::Denied);
    let denied: Vec<String> = denied.map(|d| d.path.clone()).collect();
    let failed = devices.iter().find_map(|d| match &d.access {
        Access::Failed(reason) => Some(format!("{}: {reason}", d.path)),
        _ => None,
    });
    match failed {
        _ if !denied.is_empty() => failure(Unusable::Denied(denied)),
        Some(reason) => failure(Unusable::Failed(reason)),
        None => failure(Unusable::None).with_next(
            "without one: `pegfit play SCENE` takes your mouse for the hand, `pegfit feel SCENE` has \
             a simulated one",
        ),
    }
}

/// Prints the udev rules if they would help.
pub(super) fn explain<'a>(devices: impl IntoIterator<Item = &'a DeviceInfo>) {
    let denied = |d: &DeviceInfo| d.access == Access::Denied;
    if devices.into_iter().any(denied) {
        crate::remark!(
            "To let whoever sits at this machine open them, write the following to {UDEV_PATH},\n\
             then `udevadm control --reload` and plug the device in again:\n\n{UDEV_RULES}"
        );
    }
}

pub(super) fn which_text(which: &Which) -> String {
    which
        .name()
        .map_or_else(String::new, |name| format!("{name:?}"))
}
