//! A device of the Inverse Service: options, description, exchange.

use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

use fft_correlate::Wrench;
use glam::{DQuat, DVec3};

use crate::device::contract::{Device, DeviceError, DeviceSpec};
use crate::device::driver::Axes;
use crate::device::haply::message::{Arm, Message, push};
use crate::device::haply::socket::{NAME, Socket, VARIABLE};
use crate::device::info::{DeviceInfo, DeviceKind};
use crate::device::text::printable;
use crate::device::threaded::{Exchange, Motion, OpenDevice, Reading, ThreadedDevice};

/// Where the service listens by default.
const PORT: u16 = 10001;

/// Which device, and where its service listens.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InverseOptions {
    /// Address of the service's WebSocket.
    pub address: SocketAddr,
    /// The service's id of the device, such as `049D`; `None` for the first.
    pub id: Option<String>,
}

impl Default for InverseOptions {
    fn default() -> Self {
        Self {
            address: (Ipv4Addr::LOCALHOST, PORT).into(),
            id: None,
        }
    }
}

impl InverseOptions {
    /// The device of this id, at the address that `PEGFIT_HAPLY` names, else the service's own.
    ///
    /// # Errors
    /// If `PEGFIT_HAPLY` is set to something that is no address.
    pub fn from_env(id: Option<&str>) -> Result<Self, DeviceError> {
        let default = Self {
            id: id.map(str::to_owned),
            ..Self::default()
        };
        let named = std::env::var_os(VARIABLE).filter(|text| !text.is_empty());
        let Some(named) = named else {
            return Ok(default);
        };
        let text = named.to_string_lossy();
        match text.parse() {
            Ok(address) => Ok(Self { address, ..default }),
            Err(_) => Err(DeviceError::Unsuitable {
                name: VARIABLE.into(),
                expected: "an address and port, such as 127.0.0.1:10001".into(),
                found: text.into_owned(),
            }),
        }
    }
}

/// Middle of an Inverse3's workspace in its own frame, metres: the origin of poses here.
pub const CENTRE: DVec3 = DVec3::new(0.0, -0.15, 0.15);

/// Silence after which the service counts as gone.
const PATIENCE: Duration = Duration::from_millis(100);

/// Greatest force, N; the service does not state it.
const FORCE: f64 = 10.0;

/// Stiffest wall, N/m, likewise: a cautious number.
const STIFFNESS: f64 = 2000.0;

/// Widest side of the workspace, m.
const WORKSPACE: f64 = 0.4;

/// The same of a Minverse.
const SMALL_WORKSPACE: f64 = 0.2;

/// An open device. Dropping it takes its force away and closes the connection.
struct InverseDevice {
    socket: Socket,
    id: String,
    grip: Option<String>,
    since_3_5: bool,
    /// Messages that have not been answered yet.
    unanswered: u32,
    /// When the service last answered all.
    heard: Instant,
    last: Option<Reading>,
}

/// What the service says of a device.
#[derive(Debug, Clone, PartialEq)]
struct ServiceDevice {
    id: String,
    spec: DeviceSpec,
    /// Why it cannot be held, if so.
    ready: Result<(), DeviceError>,
}

/// Every device of the first message.
fn list_devices(first: &Message) -> Vec<ServiceDevice> {
    let grip = first.grips().next().is_some();
    let arms = first.inverse3.iter();
    let listed = arms.map(|arm| ServiceDevice {
        id: arm.device_id.clone(),
        spec: spec(arm, grip),
        ready: check_ready(arm),
    });
    listed.collect()
}

fn spec(arm: &Arm, grip: bool) -> DeviceSpec {
    let minverse = arm.config.model.as_deref() == Some("minverse");
    let model = if minverse { "Minverse" } else { "Inverse3" };
    DeviceSpec {
        name: match grip {
            true => format!("Haply {model} with VerseGrip"),
            false => format!("Haply {model}"),
        },
        input_dof: if grip { 6 } else { 3 },
        output_dof: 3,
        rate_controlled: false,
        max_force: FORCE,
        max_torque: 0.0,
        max_stiffness: STIFFNESS,
        max_rotational_stiffness: f64::INFINITY,
        workspace: if minverse { SMALL_WORKSPACE } else { WORKSPACE },
        nominal_rate: 1000.0,
    }
}

fn check_ready(arm: &Arm) -> Result<(), DeviceError> {
    let name = || format!("Haply device {}", arm.device_id);
    let missing = |reason: &str| {
        Err(DeviceError::NotReady {
            name: name(),
            reason: reason.into(),
        })
    };
    if !arm.status.power_supply {
        return missing("it has no power: plug its power supply in beside the USB cable");
    }
    if !arm.status.calibrated {
        return missing(
            "it is not calibrated: hold the grip's magnet to the calibration point until the \
             light is white",
        );
    }
    if arm.status.in_use {
        return missing("another program holds it: end that one, Haply Hub's demos for example");
    }
    match &arm.config.basis {
        Some(basis) if basis.permutation != "XYZ" => Err(DeviceError::Unsuitable {
            name: name(),
            expected: "the basis XYZ in the service's settings".into(),
            found: printable(&basis.permutation),
        }),
        _ => Ok(()),
    }
}

impl InverseDevice {
    /// Connects to the service and takes the device wanted, without force.
    fn new(options: &InverseOptions) -> Result<(Self, DeviceSpec), DeviceError> {
        let (socket, first) = Socket::connect(options.address)?;
        let wanted = |l: &ServiceDevice| options.id.as_ref().is_none_or(|id| *id == l.id);
        let Some(found) = list_devices(&first).into_iter().find(wanted) else {
            return Err(DeviceError::NotReady {
                name: NAME.into(),
                reason: match &options.id {
                    Some(id) => format!("it sees no device {id}; is it plugged in?"),
                    None => "it runs, but sees no device; is one plugged in?".into(),
                },
            });
        };
        found.ready?;
        let opened = Self {
            socket,
            id: found.id,
            grip: first.grips().next().map(|grip| grip.device_id.clone()),
            since_3_5: first.session_id.is_some(),
            unanswered: 0,
            heard: Instant::now(),
            last: None,
        };
        Ok((opened, found.spec))
    }

    fn push(&mut self, force: DVec3) -> Result<(), DeviceError> {
        self.unanswered += 1;
        self.socket.send(push(&self.id, force, self.since_3_5))
    }

    /// Where the handle is; `None` while arm or grip do not say.
    fn reading(&self, message: &Message) -> Result<Option<Reading>, DeviceError> {
        let Some(arm) = message.arm(&self.id) else {
            return Err(DeviceError::NotReady {
                name: NAME.into(),
                reason: format!("device {} is not there any more", self.id),
            });
        };
        let Some(at) = arm.state.cursor_position.filter(|_| arm.status.calibrated) else {
            return Ok(None);
        };
        let (rotation, buttons) = match &self.grip {
            None => (DQuat::IDENTITY, 0),
            Some(id) => {
                let state = message.grip(id).map(|grip| &grip.state);
                let Some((state, q)) = state.and_then(|s| Some((s, s.orientation?))) else {
                    return Ok(None);
                };
                (DQuat::from(q), state.mask())
            }
        };
        let velocity = arm.state.cursor_velocity.map_or(DVec3::ZERO, DVec3::from);
        let motion = Motion::Position {
            pose: Axes::OURS.pose(rotation, DVec3::from(at) - CENTRE),
            // The service does not measure the grip's own rate.
            twist: Axes::OURS.twist(DVec3::ZERO, velocity),
        };
        Ok(Some(Reading { motion, buttons }))
    }
}

impl OpenDevice for InverseDevice {
    /// Pushes with the force of `wrench`, reads arm and grip. A service that is slow to answer is
    /// asked to let go, and counts as gone when it does not answer for [`PATIENCE`].
    fn exchange(&mut self, wrench: &Wrench) -> Result<Exchange, DeviceError> {
        // Nothing more is asked of a service that has not answered yet.
        if self.unanswered == 0 {
            self.push(Axes::OURS.to_maker(wrench.force))?;
        }
        let mut refused = None;
        while self.unanswered > 0 {
            match self.socket.read()? {
                Some(message) => {
                    self.unanswered -= 1;
                    self.heard = Instant::now();
                    self.last = self.reading(&message)?;
                }
                None if self.heard.elapsed() > PATIENCE => {
                    return Err(DeviceError::System {
                        name: NAME.into(),
                        reason: format!("it has not answered for {PATIENCE:?}"),
                    });
                }
                None => {
                    if self.unanswered == 1 {
                        self.push(DVec3::ZERO)?;
                    }
                    refused = Some(DeviceError::System {
                        name: NAME.into(),
                        reason: "it was slow to answer".into(),
                    });
                    break;
                }
            }
        }
        Ok(Exchange {
            reading: self.last,
            refused,
        })
    }
}

impl Drop for InverseDevice {
    fn drop(&mut self) {
        // A service that is gone takes nothing any more, and lets its devices go by itself.
        let _ = self.push(DVec3::ZERO);
        self.socket.close();
    }
}

/// Every device of the service; none is taken, so one that somebody holds is not disturbed.
///
/// # Errors
/// If the service does not answer, speaks another language, or sees no device.
pub fn find(options: &InverseOptions) -> Result<Vec<DeviceInfo>, DeviceError> {
    let (mut socket, first) = Socket::connect(options.address)?;
    socket.close();
    let listed = list_devices(&first);
    if listed.is_empty() {
        return Err(DeviceError::NotReady {
            name: NAME.into(),
            reason: "it runs, but sees no device; is one plugged in?".into(),
        });
    }
    let infos = listed.into_iter().map(|ServiceDevice { id, spec, ready }| {
        DeviceInfo::of_driver(DeviceKind::Haply, &id.clone(), id, spec, ready)
    });
    Ok(infos.collect())
}

/// Opens the device as the loop wants it.
///
/// # Errors
/// As [`find`], and if it is not calibrated or somebody else holds it.
pub fn open(options: InverseOptions) -> Result<Box<dyn Device>, DeviceError> {
    let device = ThreadedDevice::exchanging(move || InverseDevice::new(&options))?;
    Ok(Box::new(device))
}
