//! `pegfit devices`: what is attached, what it can do, and which one `--device` means.

use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use fft_correlate::Twist;
use glam::DVec3;
use haptic::device::attached;
use haptic::device::attached::{MissingDriver, Survey};
use haptic::device::info::{Access, DeviceInfo, DeviceKind};
use haptic::log::{Recording, device_file, read_device};
use haptic::{
    Device, DeviceError, DeviceSpec, DeviceState, HapticConfig, OperatorConfig, Replay, read_log,
};
use sdf_grid::text::quoted;
use serde::Serialize;

use crate::args::DevicesArgs;
use crate::args::device_choice::{DeviceChoice, Which};
use crate::context::Context;
use crate::error::{CommandError, refuse};
use crate::report::parquet_log;
use crate::terminal::output;
use crate::terminal::progress::{Hold, interrupted};

pub(in crate::commands) fn run(args: &DevicesArgs, context: &Context) -> Result<(), CommandError> {
    let name = args.device.clone();
    let which = name.map_or(Which::First, Which::Named);
    let found = survey(&kinds(which.name()), which.name())?;
    if args.probe {
        let device = pick(&found, |d| which.means(d), &which_text(&which))?;
        return probe(device, args.seconds, context);
    }
    context.show(&found, || found.devices.iter().for_each(print))?;
    found.missing.iter().for_each(print_missing);
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

/// Says what a kind of device wants before there can be one; `-v` lists what was tried.
fn print_missing(missing: &MissingDriver) {
    let word = missing.kind.word();
    match (&missing.driver, missing.kind.driver_page()) {
        (Some(driver), Some(page)) => {
            remark!("{word}: {driver} is not installed; {page}");
            tracing::info!("{word}: {}", missing.reason);
        }
        _ => remark!("{word}: {}", missing.reason),
    }
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
    say!(
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
    say!(
        "    {} {input} in, {output}, {} Hz, {:.0} mm wide",
        spec.input_dof,
        spec.nominal_rate,
        1e3 * spec.workspace
    );
    match &device.access {
        Access::Ready => {}
        Access::Denied => say!("    may not be opened by this user"),
        Access::Failed(reason) => say!("    cannot be opened: {reason}"),
    }
}

/// What lets the user who sits at the machine open these devices.
const UDEV_RULES: &str = include_str!("../../udev/70-pegfit.rules");

/// Where the rules go.
const UDEV_PATH: &str = "/etc/udev/rules.d/70-pegfit.rules";

/// What holds the moving part.
pub(in crate::commands) enum Chosen {
    /// The simulated operator.
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
        return refuse(
            "--device",
            "replay:LOG.csv; logs in Parquet are for other programs",
            log.display(),
        );
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
fn survey(kinds: &[DeviceKind], name: Option<&str>) -> Result<Survey, CommandError> {
    attached::survey(kinds, name).map_err(|e| CommandError::failure("listing devices", e))
}

fn open(device: &DeviceInfo, config: &HapticConfig) -> Result<Box<dyn Device>, CommandError> {
    attached::open(device, config.spacemouse, config.pid)
        .map_err(|e: DeviceError| CommandError::failure(device.path.clone(), e))
}

/// The first device wanted that can be opened.
fn pick<'a>(
    found: &'a Survey,
    wanted: impl Fn(&DeviceInfo) -> bool,
    text: &str,
) -> Result<&'a DeviceInfo, CommandError> {
    let candidates: Vec<&DeviceInfo> = found.devices.iter().filter(|d| wanted(d)).collect();
    if let Some(device) = candidates.iter().find(|d| d.access == Access::Ready) {
        return Ok(device);
    }
    if let (true, [missing]) = (candidates.is_empty(), found.missing.as_slice()) {
        let reason = &missing.reason;
        return Err(failure(format!(
            "no {} device can be used: {reason}",
            missing.kind.maker()
        )));
    }
    if candidates.is_empty() && !found.devices.is_empty() {
        return Err(failure(format!(
            "no attached device is {text}; `pegfit devices` lists what there is"
        )));
    }
    Err(unusable(candidates))
}

fn failure(why: impl Into<String>) -> CommandError {
    CommandError::failure("no haptic device to use", why.into())
}

/// Why none of these can be used; prints what would help.
fn unusable<'a>(devices: impl IntoIterator<Item = &'a DeviceInfo>) -> CommandError {
    let devices: Vec<&DeviceInfo> = devices.into_iter().collect();
    explain(devices.iter().copied());
    let denied = devices.iter().filter(|d| d.access == Access::Denied);
    let denied: Vec<String> = denied.map(|d| d.path.clone()).collect();
    let failed = devices.iter().find_map(|d| match &d.access {
        Access::Failed(reason) => Some(format!("{}: {reason}", d.path)),
        _ => None,
    });
    match failed {
        _ if !denied.is_empty() => failure(format!("{} may not be opened by this user", denied.join(", "))),
        Some(reason) => failure(reason),
        None => failure("no haptic device is attached").with_next(
            "without one: `pegfit play SCENE` takes your mouse for the hand, `pegfit feel SCENE` has \
             a simulated one",
        ),
    }
}

/// Prints the udev rules if they would help.
fn explain<'a>(devices: impl IntoIterator<Item = &'a DeviceInfo>) {
    let denied = |d: &DeviceInfo| d.access == Access::Denied;
    if devices.into_iter().any(denied) {
        remark!(
            "To let whoever sits at this machine open them, write the following to {UDEV_PATH},\n\
             then `udevadm control --reload` and plug the device in again:\n\n{UDEV_RULES}"
        );
    }
}

fn which_text(which: &Which) -> String {
    which.name().map_or_else(String::new, quoted)
}

/// Time between two pictures.
const FRAME: Duration = Duration::from_millis(50);

/// Time between two lines where nothing can be redrawn.
const LINE: Duration = Duration::from_millis(500);

/// Characters on each side of a bar's middle.
const HALF: usize = 20;

/// Speeds at the ends of a rate's bar, as [`haptic::device::hid::spacemouse::Feel`] has them by default.
const FULL_SPEED: f64 = 0.1;
const FULL_TURN: f64 = 1.0;

/// One frame at the device.
#[derive(Debug, Serialize)]
struct ProbeFrame {
    /// Seconds since the start.
    time: f64,
    /// False while it is unplugged.
    connected: bool,
    /// The last thing that went wrong with it, in its driver's words.
    #[serde(skip_serializing_if = "Option::is_none")]
    fault: Option<String>,
    /// x, y, z in metres, or m/s of a device steered by rates.
    linear: [f64; 3],
    /// Rotation vector in radians, or rad/s.
    angular: [f64; 3],
    /// Buttons held, counted from 1.
    buttons: Vec<u32>,
}

/// Shows the device until Ctrl-C or for `seconds`. Bars are redrawn in a terminal; elsewhere each
/// line is a frame, as JSON if asked for.
fn probe(info: &DeviceInfo, seconds: Option<f64>, context: &Context) -> Result<(), CommandError> {
    let limit = match seconds {
        Some(s) if !(s.is_finite() && s > 0.0) => {
            return refuse("--seconds", "a positive number", s);
        }
        other => other.unwrap_or(f64::INFINITY),
    };
    let _held = Hold::begin();
    let mut device = open(info, &HapticConfig::default())?;
    let spec = device.spec().clone();
    let redraw = output::is_terminal() && !context.json;
    let begin = Instant::now();
    let mut lines = 0;
    while begin.elapsed().as_secs_f64() < limit && !interrupted() {
        let frame = read_frame(device.as_mut(), &spec, begin.elapsed().as_secs_f64());
        if context.json {
            let text = serde_json::to_string(&frame);
            say!("{}", text.map_err(|e| CommandError::failure("JSON", e))?);
        } else if redraw {
            // Up over the last picture, and down again line by line.
            output::rewind(lines);
            let picture = picture(&spec, &frame);
            say!("{}", picture.trim_end());
            lines = picture.lines().count();
        } else {
            say!("{}", line(&frame));
        }
        if !output::is_wanted() {
            break;
        }
        std::thread::sleep(if redraw { FRAME } else { LINE });
    }
    Ok(())
}

fn read_frame(device: &mut dyn Device, spec: &DeviceSpec, time: f64) -> ProbeFrame {
    let state = device.poll(time);
    let connected = !matches!(state, Err(DeviceError::Disconnected));
    let state = state.unwrap_or(DeviceState::at_rest(Default::default(), time));
    let shown = match spec.rate_controlled {
        true => state.twist,
        false => Twist {
            angular: state.pose.rotation.to_scaled_axis(),
            linear: state.pose.translation,
        },
    };
    ProbeFrame {
        time,
        connected,
        fault: device.last_fault().map(|fault| fault.to_string()),
        // Adding zero makes -0 to 0.
        linear: (shown.linear + DVec3::ZERO).to_array(),
        angular: (shown.angular + DVec3::ZERO).to_array(),
        buttons: (0..32)
            .filter(|b| state.buttons >> b & 1 == 1)
            .map(|b| b + 1)
            .collect(),
    }
}

fn picture(spec: &DeviceSpec, frame: &ProbeFrame) -> String {
    let (reach, unit) = match spec.rate_controlled {
        true => (FULL_SPEED, "mm/s"),
        false => (spec.workspace / 2.0, "mm"),
    };
    let (turn, turn_unit) = match spec.rate_controlled {
        true => (FULL_TURN, "°/s"),
        false => (std::f64::consts::PI, "°"),
    };
    let mut text = match frame.connected {
        true => format!("{}\n", spec.name),
        false => format!("{}  ({})\n", spec.name, gone(frame)),
    };
    for (name, value) in ["x", "y", "z"].iter().zip(frame.linear) {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{name:>3} {} {:8.1} {unit}",
            bar(value / reach),
            1e3 * value
        );
    }
    if spec.input_dof == 6 {
        for (name, value) in ["rx", "ry", "rz"].iter().zip(frame.angular) {
            let degrees = value.to_degrees();
            let _ = writeln!(
                text,
                "{name:>3} {} {degrees:8.1} {turn_unit}",
                bar(value / turn)
            );
        }
    }
    let _ = writeln!(text, "buttons {}", buttons(frame));
    text
}

fn buttons(frame: &ProbeFrame) -> String {
    match frame.buttons.as_slice() {
        [] => "none".into(),
        held => held
            .iter()
            .map(u32::to_string)
            .collect::<Vec<_>>()
            .join(" "),
    }
}

/// A bar from its middle to the left or right; `share` is -1 ..= 1.
/// Not a number draws nothing.
fn bar(share: f64) -> String {
    let length = (share.abs().clamp(0.0, 1.0) * HALF as f64).round() as usize;
    let (left, right) = if share < 0.0 {
        (length, 0)
    } else {
        (0, length)
    };
    format!(
        "[{}{}|{}{}]",
        " ".repeat(HALF - left),
        "#".repeat(left),
        "#".repeat(right),
        " ".repeat(HALF - right)
    )
}

/// Text about a device that does not answer.
fn gone(frame: &ProbeFrame) -> String {
    match &frame.fault {
        None => "unplugged".to_owned(),
        Some(fault) => format!("unplugged: {fault}"),
    }
}

fn line(frame: &ProbeFrame) -> String {
    if !frame.connected {
        return format!("{:8.2} s  {}", frame.time, gone(frame));
    }
    let [x, y, z] = (DVec3::from_array(frame.linear) * 1e3).to_array();
    let [rx, ry, rz] = frame.angular.map(f64::to_degrees);
    format!(
        "{:8.2} s  x {x:.1} y {y:.1} z {z:.1}  rx {rx:.1} ry {ry:.1} rz {rz:.1}  buttons {}",
        frame.time,
        buttons(frame)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_grow_from_the_middle_and_end_at_full_deflection() {
        let width = 2 * HALF + 3;
        for (share, hashes) in [(0.0, 0), (0.5, HALF / 2), (-1.0, HALF), (7.0, HALF)] {
            let drawn = bar(share);
            assert_eq!(drawn.len(), width);
            assert_eq!(drawn.matches('#').count(), hashes, "{drawn}");
            let middle = drawn.find('|').unwrap();
            assert_eq!(drawn[..middle].contains('#'), share < 0.0);
        }
        assert_eq!(bar(f64::NAN).matches('#').count(), 0);
    }

    #[test]
    fn a_picture_has_a_line_per_axis_and_says_what_is_held() {
        let spec = haptic::device::hid::spacemouse::spec("mouse");
        let frame = ProbeFrame {
            time: 0.0,
            connected: true,
            fault: None,
            linear: [0.1, 0.0, -0.05],
            angular: [0.0; 3],
            buttons: vec![1, 3],
        };
        let text = picture(&spec, &frame);
        assert_eq!(text.lines().count(), 8);
        assert!(
            text.contains("100.0 mm/s") && text.contains("buttons 1 3"),
            "{text}"
        );
        assert!(line(&frame).contains("z -50.0"));
    }
}
