//! Live axes and buttons of a device in the terminal.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use fft_correlate::Twist;
use glam::DVec3;
use haptic::device::info::DeviceInfo;
use haptic::{Device, DeviceError, DeviceSpec, DeviceState, HapticConfig};
use serde::Serialize;

use super::choose::open;
use crate::context::Context;
use crate::error::CommandError;
use crate::terminal::hold::Hold;
use crate::terminal::output;
use crate::terminal::progress::interrupted;

/// Time between two pictures.
const FRAME: Duration = Duration::from_millis(50);

/// Time between two lines where nothing can be redrawn.
const LINE: Duration = Duration::from_millis(500);

/// Characters on each side of a bar's middle.
const HALF: usize = 20;

/// Speeds at the ends of a rate's bar, as [`haptic::device::hid::spacemouse::SpaceMouseSettings`] has them by default.
const FULL_SPEED: f64 = 0.1;
const FULL_TURN: f64 = 1.0;

/// One look at the device.
#[derive(Debug, Serialize)]
struct Look {
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
/// line is a look, as JSON if asked for.
pub(super) fn run(
    info: &DeviceInfo,
    seconds: Option<f64>,
    context: &Context,
) -> Result<(), CommandError> {
    let limit = match seconds {
        Some(s) if !(s.is_finite() && s > 0.0) => {
            return Err(CommandError::option("--seconds", "a positive number", s));
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
        let look = look(device.as_mut(), &spec, begin.elapsed().as_secs_f64());
        if context.json {
            let text = serde_json::to_string(&look);
            crate::say!("{}", text.map_err(|e| CommandError::failure("JSON", e))?);
        } else if redraw {
            // Up over the last picture, and down again line by line.
            output::rewind(lines);
            let picture = picture(&spec, &look);
            crate::say!("{}", picture.trim_end());
            lines = picture.lines().count();
        } else {
            crate::say!("{}", line(&look));
        }
        if !output::is_wanted() {
            break;
        }
        std::thread::sleep(if redraw { FRAME } else { LINE });
    }
    Ok(())
}

fn look(device: &mut dyn Device, spec: &DeviceSpec, time: f64) -> Look {
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
    Look {
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

fn picture(spec: &DeviceSpec, look: &Look) -> String {
    let (reach, unit) = match spec.rate_controlled {
        true => (FULL_SPEED, "mm/s"),
        false => (spec.workspace / 2.0, "mm"),
    };
    let (turn, turn_unit) = match spec.rate_controlled {
        true => (FULL_TURN, "°/s"),
        false => (std::f64::consts::PI, "°"),
    };
    let mut text = match look.connected {
        true => format!("{}\n", spec.name),
        false => format!("{}  ({})\n", spec.name, gone(look)),
    };
    for (name, value) in ["x", "y", "z"].iter().zip(look.linear) {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{name:>3} {} {:8.1} {unit}",
            bar(value / reach),
            1e3 * value
        );
    }
    if spec.input_dof == 6 {
        for (name, value) in ["rx", "ry", "rz"].iter().zip(look.angular) {
            let degrees = value.to_degrees();
            let _ = writeln!(
                text,
                "{name:>3} {} {degrees:8.1} {turn_unit}",
                bar(value / turn)
            );
        }
    }
    let _ = writeln!(text, "buttons {}", buttons(look));
    text
}

fn buttons(look: &Look) -> String {
    match look.buttons.as_slice() {
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

/// What is said of a device that does not answer.
fn gone(look: &Look) -> String {
    match &look.fault {
        None => "unplugged".to_owned(),
        Some(fault) => format!("unplugged: {fault}"),
    }
}

fn line(look: &Look) -> String {
    if !look.connected {
        return format!("{:8.2} s  {}", look.time, gone(look));
    }
    let [x, y, z] = (DVec3::from_array(look.linear) * 1e3).to_array();
    let [rx, ry, rz] = look.angular.map(f64::to_degrees);
    format!(
        "{:8.2} s  x {x:.1} y {y:.1} z {z:.1}  rx {rx:.1} ry {ry:.1} rz {rz:.1}  buttons {}",
        look.time,
        buttons(look)
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
        let look = Look {
            time: 0.0,
            connected: true,
            fault: None,
            linear: [0.1, 0.0, -0.05],
            angular: [0.0; 3],
            buttons: vec![1, 3],
        };
        let text = picture(&spec, &look);
        assert_eq!(text.lines().count(), 8);
        assert!(
            text.contains("100.0 mm/s") && text.contains("buttons 1 3"),
            "{text}"
        );
        assert!(line(&look).contains("z -50.0"));
    }
}
