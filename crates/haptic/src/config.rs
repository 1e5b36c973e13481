//! Settings of the haptic loop; the `[device]` table of a scene file.

use fft_correlate::Pose;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::device::hid::pid::PidSettings;
use crate::device::hid::spacemouse::SpaceMouseSettings;
use crate::device::remote::LoopTimes;
use crate::device::workspace::Workspace;

/// Settings of the loop, the coupling and the limits. Every key may be left out.
///
/// ```toml
/// rate_hz = 1000.0          # ticks per second
/// workspace_scale = 1.0     # scene metres per metre of device motion
/// ramp_s = 0.5              # seconds from no force to full force
/// [coupling]
/// stiffness = 1000.0        # N/m at the device
/// [limits]
/// force = 5.0               # N
/// ```
///
/// ```
/// use haptic::HapticConfig;
///
/// let mut config: HapticConfig = toml::from_str("rate_hz = 500.0\n[limits]\nforce = 2.0")?;
/// assert_eq!((config.period(), config.limits.force), (0.002, 2.0));
/// // Keys that are left out keep their defaults.
/// assert!(config.coupling.stiffness == 1000.0 && config.passivity.control);
/// config.rate_hz = 20.0;
/// assert_eq!(config.validate().unwrap_err().key, "rate_hz");
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HapticConfig {
    /// Ticks per second, 50 ..= 10000. Default 1000.
    pub rate_hz: f64,
    /// Scene metres per metre of device motion, > 0. Default 1. The device feels the scene's force
    /// times this number and the scene's torque unchanged, so that power is the same on both
    /// sides.
    pub workspace_scale: f64,
    /// Seconds in which the force rises from nothing to full strength at the start and after any
    /// fault, >= 0. Default 0.5.
    pub ramp_s: f64,
    /// Age of the newest input, seconds, from which the force is let go, > 0. Default 0.1.
    pub stale_s: f64,
    /// Time constant, seconds, with which the force is let go in a fault, > 0. Default 0.01.
    pub decay_s: f64,
    /// A gap of more than this many periods between two ticks is a fault. Default 20.
    pub missed_ticks: u32,
    /// Spin instead of sleeping for the last so many microseconds before a tick. Default 50.
    pub spin_us: u32,
    /// Ask the system for SCHED_FIFO and locked memory; without permission the loop runs on
    /// without them and says so. Default true.
    pub realtime: bool,
    /// The spring between the device and the virtual object.
    pub coupling: CouplingConfig,
    /// What the device may be asked to do, whatever the energy says.
    pub limits: LimitConfig,
    /// The energy watchdog.
    pub passivity: PassivityConfig,
    /// What the descriptor of a USB HID PID device does not state; other devices ignore it.
    pub pid: PidSettings,
    /// Speed of a 3Dconnexion device's cursor; other devices ignore it.
    pub spacemouse: SpaceMouseSettings,
}

/// The virtual coupling, in newtons and metres at the device.
///
/// See the example of [`HapticConfig`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CouplingConfig {
    /// N/m, > 0. Default 1000. Lowered to what the device is passive with at this rate.
    pub stiffness: f64,
    /// N·m/rad, > 0. Default 1. Lowered likewise.
    pub rotational_stiffness: f64,
    /// N·s/m, >= 0. Default 0.5. Lowered likewise.
    pub damping: f64,
    /// N·m·s/rad, >= 0. Default 0.0005. Lowered likewise.
    pub rotational_damping: f64,
    /// Greatest speed of the virtual object, m/s of device motion, > 0. Default 2.
    pub max_speed: f64,
    /// Greatest angular speed of the virtual object, rad/s, > 0. Default 20.
    pub max_angular_speed: f64,
    /// Most energy evaluations per tick, 1 ..= 16. Default 2. More of them follow a stiff contact
    /// more closely; a direct evaluator has time for two at 1 kHz, a table for all.
    pub evaluations: u32,
    /// Hold the rotation of the virtual object to that of the device. Default false; always so
    /// with a device that senses no rotation.
    pub lock_rotation: bool,
}

/// Hard limits; a device's own limits apply as well.
///
/// See the example of [`HapticConfig`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LimitConfig {
    /// Greatest force, N, >= 0. Default 5.
    pub force: f64,
    /// Greatest torque, N·m, >= 0. Default 0.3.
    pub torque: f64,
    /// Greatest rate of change of force, N/s, > 0. Default 2000.
    pub force_rate: f64,
    /// Greatest rate of change of torque, N·m/s, > 0. Default 100.
    pub torque_rate: f64,
    /// Device speed, m/s, beyond which an input is taken for a glitch, > 0. Default 5.
    pub device_speed: f64,
    /// Angular device speed, rad/s, beyond which an input is taken for a glitch, > 0. Default 60.
    pub device_angular_speed: f64,
}

/// The passivity observer and controller.
///
/// See the example of [`HapticConfig`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PassivityConfig {
    /// Whether the controller acts; the observer always counts. Default true.
    pub control: bool,
    /// Energy, joules, the loop may return beyond what it took in before the controller acts,
    /// and the most that past dissipation is credited for, >= 0. Default 0.001.
    pub credit: f64,
    /// Greatest damping the controller adds, N·s/m, >= 0. Default 5.
    pub max_damping: f64,
}

impl Default for HapticConfig {
    fn default() -> Self {
        Self {
            rate_hz: 1000.0,
            workspace_scale: 1.0,
            ramp_s: 0.5,
            stale_s: 0.1,
            decay_s: 0.01,
            missed_ticks: 20,
            spin_us: 50,
            realtime: true,
            coupling: CouplingConfig::default(),
            limits: LimitConfig::default(),
            passivity: PassivityConfig::default(),
            pid: PidSettings::default(),
            spacemouse: SpaceMouseSettings::default(),
        }
    }
}

impl Default for CouplingConfig {
    fn default() -> Self {
        Self {
            stiffness: 1000.0,
            rotational_stiffness: 1.0,
            damping: 0.5,
            rotational_damping: 0.0005,
            max_speed: 2.0,
            max_angular_speed: 20.0,
            evaluations: 2,
            lock_rotation: false,
        }
    }
}

impl Default for LimitConfig {
    fn default() -> Self {
        Self {
            force: 5.0,
            torque: 0.3,
            force_rate: 2000.0,
            torque_rate: 100.0,
            device_speed: 5.0,
            device_angular_speed: 60.0,
        }
    }
}

impl Default for PassivityConfig {
    fn default() -> Self {
        Self {
            control: true,
            credit: 0.001,
            max_damping: 5.0,
        }
    }
}

/// A setting out of range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("device setting {key}: expected {expected}, found {found}")]
pub struct ConfigError {
    /// The key, dotted as in the scene file.
    pub key: &'static str,
    /// The range it must lie in.
    pub expected: &'static str,
    /// What was given.
    pub found: f64,
}

impl HapticConfig {
    /// Seconds between two ticks.
    pub fn period(&self) -> f64 {
        1.0 / self.rate_hz
    }

    /// The times that a remote device knows of the loop.
    pub fn times(&self) -> LoopTimes {
        LoopTimes {
            period: self.period(),
            late: f64::from(self.missed_ticks) * self.period(),
            stale: self.stale_s,
            ramp: self.ramp_s,
        }
    }

    /// The device's workspace at this scale, device and scene axes alike: `home` is the part's pose
    /// while the device is at its origin (the assembled pose, say), `grip` the point of the part
    /// (metres, its frame) that the handle holds.
    pub fn workspace(&self, home: Pose, grip: DVec3) -> Workspace {
        Workspace::new(self.workspace_scale, home, grip)
    }

    /// Checks every range stated above.
    ///
    /// # Errors
    /// The first key out of range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let (coupling, limits) = (&self.coupling, &self.limits);
        let (pid, mouse) = (&self.pid, &self.spacemouse);
        let rate = self.rate_hz;
        check(
            "rate_hz",
            rate,
            "50 ..= 10000",
            (50.0..=1e4).contains(&rate),
        )?;
        let most = coupling.evaluations;
        let key = "coupling.evaluations";
        check(key, most.into(), "1 to 16", (1..=16).contains(&most))?;
        for (key, found) in [
            ("workspace_scale", self.workspace_scale),
            ("stale_s", self.stale_s),
            ("decay_s", self.decay_s),
            ("coupling.stiffness", coupling.stiffness),
            (
                "coupling.rotational_stiffness",
                coupling.rotational_stiffness,
            ),
            ("coupling.max_speed", coupling.max_speed),
            ("coupling.max_angular_speed", coupling.max_angular_speed),
            ("limits.force_rate", limits.force_rate),
            ("limits.torque_rate", limits.torque_rate),
            ("limits.device_speed", limits.device_speed),
            ("limits.device_angular_speed", limits.device_angular_speed),
            ("pid.max_force", pid.max_force),
            ("pid.workspace", pid.workspace),
            ("pid.max_stiffness", pid.max_stiffness),
            ("pid.rate", pid.rate),
            ("spacemouse.speed", mouse.speed),
            ("spacemouse.angular_speed", mouse.angular_speed),
        ] {
            check(key, found, "a number > 0", found > 0.0)?;
        }
        for (key, found) in [
            ("ramp_s", self.ramp_s),
            ("coupling.damping", coupling.damping),
            ("coupling.rotational_damping", coupling.rotational_damping),
            ("limits.force", limits.force),
            ("limits.torque", limits.torque),
            ("passivity.credit", self.passivity.credit),
            ("passivity.max_damping", self.passivity.max_damping),
        ] {
            check(key, found, "a number >= 0", found >= 0.0)?;
        }
        let gain = pid.gain;
        check("pid.gain", gain, "0 to 1", (0.0..=1.0).contains(&gain))?;
        for found in pid.signs {
            check("pid.signs", found, "1 or -1", found.abs() == 1.0)?;
        }
        let zone = mouse.dead_zone;
        let key = "spacemouse.dead_zone";
        check(key, zone, "0 to 0.9", (0.0..=0.9).contains(&zone))
    }
}

fn check(
    key: &'static str,
    found: f64,
    expected: &'static str,
    holds: bool,
) -> Result<(), ConfigError> {
    if holds && found.is_finite() {
        Ok(())
    } else {
        Err(ConfigError {
            key,
            expected,
            found,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_partial_tables_keep_them() {
        HapticConfig::default().validate().unwrap();
        let read: HapticConfig = toml::from_str("[coupling]\nstiffness = 700.0").unwrap();
        assert_eq!(read.coupling.stiffness, 700.0);
        assert_eq!(read.limits, LimitConfig::default());
        let read: HapticConfig = toml::from_str("spacemouse.speed = 0.02").unwrap();
        assert_eq!(read.spacemouse.speed, 0.02);
        assert_eq!(
            read.spacemouse.angular_speed,
            SpaceMouseSettings::default().angular_speed
        );
    }

    #[test]
    fn an_unknown_key_is_refused_by_name() {
        let error = toml::from_str::<HapticConfig>("[limits]\nforse = 1.0").unwrap_err();
        assert!(error.to_string().contains("forse"), "{error}");
    }

    #[test]
    fn every_range_is_checked() {
        type Change = fn(&mut HapticConfig);
        let broken: [(&str, Change); 12] = [
            ("rate_hz", |c| c.rate_hz = 0.0),
            ("workspace_scale", |c| c.workspace_scale = -1.0),
            ("coupling.evaluations", |c| c.coupling.evaluations = 0),
            ("coupling.stiffness", |c| c.coupling.stiffness = f64::NAN),
            ("limits.force", |c| c.limits.force = f64::INFINITY),
            ("passivity.credit", |c| c.passivity.credit = -1.0),
            ("pid.max_force", |c| c.pid.max_force = 0.0),
            ("pid.gain", |c| c.pid.gain = 1.1),
            ("pid.signs", |c| c.pid.signs[1] = 0.5),
            ("spacemouse.speed", |c| c.spacemouse.speed = 0.0),
            ("spacemouse.angular_speed", |c| {
                c.spacemouse.angular_speed = f64::NAN;
            }),
            ("spacemouse.dead_zone", |c| c.spacemouse.dead_zone = 1.0),
        ];
        for (key, change) in broken {
            let mut config = HapticConfig::default();
            change(&mut config);
            assert_eq!(config.validate().unwrap_err().key, key);
        }
    }
}
