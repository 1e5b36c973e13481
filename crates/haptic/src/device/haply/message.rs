//! Messages from and to the service. Keys that are not used here are skipped.

use glam::{DQuat, DVec3};
use sdf_grid::text::quoted;
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::json;

/// Most devices of one kind in a message.
const MOST_DEVICES: usize = 64;

/// Most characters of a device's id.
const LONGEST_ID: usize = 64;

/// State of all devices.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub(super) struct Message {
    /// Since version 3.5.
    pub(super) session_id: Option<IgnoredAny>,
    pub(super) inverse3: Vec<Arm>,
    pub(super) wireless_verse_grip: Vec<Grip>,
    pub(super) verse_grip: Vec<Grip>,
}

/// An Inverse3.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Arm {
    pub(super) device_id: String,
    #[serde(default)]
    pub(super) config: ArmConfig,
    #[serde(default)]
    pub(super) state: ArmState,
    #[serde(default)]
    pub(super) status: ArmStatus,
}

/// In the first message only.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub(super) struct ArmConfig {
    #[serde(rename = "type")]
    pub(super) model: Option<String>,
    pub(super) basis: Option<Basis>,
}

/// Which of the device's axes the session calls x, y and z.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Basis {
    pub(super) permutation: String,
}

#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub(super) struct ArmState {
    /// Metres.
    pub(super) cursor_position: Option<Vector>,
    /// m/s.
    pub(super) cursor_velocity: Option<Vector>,
}

/// A missing key counts as a good state.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default)]
pub(super) struct ArmStatus {
    pub(super) calibrated: bool,
    pub(super) in_use: bool,
    pub(super) power_supply: bool,
}

impl Default for ArmStatus {
    fn default() -> Self {
        Self {
            calibrated: true,
            in_use: false,
            power_supply: true,
        }
    }
}

/// A VerseGrip, wireless or wired.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Grip {
    pub(super) device_id: String,
    #[serde(default)]
    pub(super) state: GripState,
}

#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub(super) struct GripState {
    pub(super) orientation: Option<Quaternion>,
    /// Of the wireless one.
    pub(super) buttons: Buttons,
    /// Of the wired one.
    pub(super) button: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(default)]
pub(super) struct Buttons {
    a: bool,
    b: bool,
    c: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub(super) struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

impl From<Vector> for DVec3 {
    fn from(v: Vector) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub(super) struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

impl From<Quaternion> for DQuat {
    fn from(q: Quaternion) -> Self {
        Self::from_xyzw(q.x, q.y, q.z, q.w)
    }
}

impl GripState {
    /// Bit 0 is button a or the only one, bit 1 button b, bit 2 button c.
    pub(super) fn mask(&self) -> u32 {
        let Buttons { a, b, c } = self.buttons;
        u32::from(a || self.button) | u32::from(b) << 1 | u32::from(c) << 2
    }
}

impl Message {
    /// Reads a message; in words why it is none. Ids go onto command lines and screens: those that
    /// nobody could type are none.
    pub(super) fn read(text: &str) -> Result<Self, String> {
        let message: Self = serde_json::from_str(text).map_err(|e| e.to_string())?;
        message.check()?;
        Ok(message)
    }

    fn check(&self) -> Result<(), String> {
        let grips = [&self.wireless_verse_grip, &self.verse_grip].map(Vec::len);
        let most = grips.into_iter().fold(self.inverse3.len(), usize::max);
        if most > MOST_DEVICES {
            return Err(format!(
                "{most} devices of a kind, of {MOST_DEVICES} at most"
            ));
        }
        let arms = self.inverse3.iter().map(|arm| &arm.device_id);
        let mut ids = arms.chain(self.grips().map(|grip| &grip.device_id));
        let typed = |id: &str| id.len() <= LONGEST_ID && id.bytes().all(|b| b.is_ascii_graphic());
        match ids.find(|id| !typed(id)) {
            Some(id) => Err(format!("a device called {}", quoted(id))),
            None => Ok(()),
        }
    }

    /// The grip of this id, `None` if it is not listed.
    pub(super) fn grip(&self, id: &str) -> Option<&Grip> {
        self.grips().find(|grip| grip.device_id == id)
    }

    /// All grips, wireless ones first.
    pub(super) fn grips(&self) -> impl Iterator<Item = &Grip> {
        self.wireless_verse_grip.iter().chain(&self.verse_grip)
    }

    /// The arm of this id, `None` if it is not listed.
    pub(super) fn arm(&self, id: &str) -> Option<&Arm> {
        self.inverse3.iter().find(|arm| arm.device_id == id)
    }
}

/// The order to push with `force`, N. The vector is called `vector` since version 3.5, `values`
/// before.
pub(super) fn push(id: &str, force: DVec3, since_3_5: bool) -> String {
    let key = if since_3_5 { "vector" } else { "values" };
    let vector = json!({ "x": force.x, "y": force.y, "z": force.z });
    let commands = json!({ "set_cursor_force": { key: vector } });
    json!({ "inverse3": [{ "device_id": id, "commands": commands }] }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_read_whatever_else_it_says() {
        let text = r#"{"session_id": 7, "later": [1], "inverse3": [{"device_id": "049D",
            "config": {"type": "minverse", "basis": {"permutation": "XZY"}, "filters": {}},
            "state": {"cursor_position": {"x": 0.1, "y": -0.2, "z": 0.3}, "mode": "idle"},
            "status": {"calibrated": false, "ready": true}}],
            "verse_grip": [{"device_id": "6", "state": {"button": true, "hall": 3}}],
            "wireless_verse_grip": [{"device_id": "7", "state": {"buttons": {"b": true},
            "orientation": {"x": 0, "y": 0, "z": 1, "w": 0}}}]}"#;
        let message = Message::read(text).unwrap();
        let arm = message.arm("049D").unwrap();
        assert!(!arm.status.calibrated && arm.status.power_supply && !arm.status.in_use);
        assert_eq!(arm.config.model.as_deref(), Some("minverse"));
        let at = arm.state.cursor_position.map(DVec3::from);
        assert_eq!(at, Some(DVec3::new(0.1, -0.2, 0.3)));
        let ids: Vec<_> = message.grips().map(|g| g.device_id.as_str()).collect();
        assert_eq!(ids, ["7", "6"]);
        assert_eq!(message.grip("7").unwrap().state.mask(), 0b10);
        assert_eq!(message.grip("6").unwrap().state.mask(), 0b1);
        for garbage in [
            "",
            "[]x",
            r#"{"inverse3": {"049D": {}}}"#,
            r#"{"inverse3": [{}]}"#,
        ] {
            assert!(Message::read(garbage).is_err(), "{garbage}");
        }
    }

    #[test]
    fn devices_are_few_and_their_ids_can_be_typed() {
        let listed = |id: &str, count: usize| {
            let arms = vec![json!({ "device_id": id }); count];
            Message::read(&json!({ "inverse3": arms }).to_string())
        };
        assert!(listed("049D", MOST_DEVICES).is_ok());
        let told = listed("049D", MOST_DEVICES + 1).unwrap_err();
        assert!(told.starts_with("65 devices"), "{told}");
        for id in ["\u{1b}[2J", "a b", "a\n", &"9".repeat(65), "\u{202e}"] {
            let told = listed(id, 1).unwrap_err();
            assert!(told.starts_with("a device called"), "{told}");
        }
    }

    #[test]
    fn a_push_names_the_device_and_its_force() {
        let force = DVec3::new(1.5, 0.0, -2.0);
        let text = push("049D", force, true);
        let expected = concat!(
            r#"{"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":"#,
            r#"{"vector":{"x":1.5,"y":0.0,"z":-2.0}}}}]}"#
        );
        assert_eq!(text, expected);
        assert_eq!(
            push("049D", force, false),
            expected.replace("vector", "values")
        );
    }
}
