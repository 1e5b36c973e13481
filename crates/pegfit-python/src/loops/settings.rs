//! Settings given as JSON.

use haptic::{HapticConfig, OperatorConfig};
use serde_json::{Map, Value};

use crate::failure::raised::{Failure, Kind};

/// The loop's settings, the keys given as in the `[device]` table of a scene.
pub(super) fn device(json: &str) -> Result<HapticConfig, Failure> {
    let config: HapticConfig = serde_json::from_str(json).map_err(|e| {
        let expected = "keys and numbers as in a scene's [device]";
        Failure::found(Kind::Device, "config", expected, e)
    })?;
    config.validate()?;
    Ok(config)
}

/// The simulated hand, with the numbers given by name.
pub(super) fn hand(json: &str) -> Result<OperatorConfig, Failure> {
    let refused = |item: &str, expected: &str, found: &dyn std::fmt::Display| {
        Failure::found(Kind::Device, format!("hand: {item}"), expected, found)
    };
    let given: Map<String, Value> =
        serde_json::from_str(json).map_err(|e| refused("settings", "numbers by name", &e))?;
    let mut hand = OperatorConfig::default();
    for (key, value) in &given {
        let number = value.as_f64().filter(|v| v.is_finite() && *v >= 0.0);
        let number = number.ok_or_else(|| refused(key, "a number >= 0", value))?;
        let place = match key.as_str() {
            "mass" => &mut hand.mass,
            "stiffness" => &mut hand.stiffness,
            "damping" => &mut hand.damping,
            "inertia" => &mut hand.inertia,
            "rotational_stiffness" => &mut hand.rotational_stiffness,
            "rotational_damping" => &mut hand.rotational_damping,
            "tremor" => &mut hand.tremor,
            "rotational_tremor" => &mut hand.rotational_tremor,
            "push" => &mut hand.push,
            "seed" => {
                hand.seed = number as u64;
                continue;
            }
            other => {
                return Err(refused(
                    other,
                    "a key that a hand has",
                    &"none of that name",
                ));
            }
        };
        *place = number;
    }
    for (name, value) in [("mass", hand.mass), ("inertia", hand.inertia)] {
        if value <= 0.0 {
            return Err(refused(name, "a positive number", &value));
        }
    }
    Ok(hand)
}
