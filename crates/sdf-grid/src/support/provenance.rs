//! Comparison of the provenance of two results.
//!
//! Everything that a stored result depends on is kept beside it as one value, its provenance (a field's is
//! [`crate::FieldProvenance`]). Before the result is used or continued, [`difference`] names the first
//! number in which the stored provenance differs from the requested one.

use std::fmt::Display;

use serde::Serialize;
use serde_json::{Map, Value};

/// The first place in which two provenances differ.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key} is {stored} there, {given} here")]
pub struct Difference {
    /// Names from the outside in, with dots between them: `fixed.lattice.spacing`.
    pub key: String,
    /// The stored value as text; `none` if absent.
    pub stored: String,
    /// The given value as text; `none` if absent.
    pub given: String,
}

/// The first difference between a stored and a given provenance, in the order in which their keys are
/// declared; none if they are equal.
///
/// Values are compared as JSON holds them: numbers as numbers (1 is 1.0), and what is absent, an
/// empty option, and a number that is not finite are all `none`.
pub fn difference(stored: &impl Serialize, given: &impl Serialize) -> Option<Difference> {
    match (serde_json::to_value(stored), serde_json::to_value(given)) {
        (Ok(stored), Ok(given)) => first("", &stored, &given),
        // Nothing can be said of a value without a form in JSON: it differs from all others.
        (stored, given) => Some(Difference {
            key: String::new(),
            stored: stored.map_or_else(|e| e.to_string(), |v| text(&v)),
            given: given.map_or_else(|e| e.to_string(), |v| text(&v)),
        }),
    }
}

fn first(key: &str, stored: &Value, given: &Value) -> Option<Difference> {
    let inner = |name: &dyn Display, stored: &Value, given: &Value| match key {
        "" => first(&name.to_string(), stored, given),
        _ => first(&format!("{key}.{name}"), stored, given),
    };
    match (stored, given) {
        (Value::Object(a), Value::Object(b)) => {
            let only_given = b.keys().filter(|name| !a.contains_key(*name));
            let mut names = a.keys().chain(only_given);
            names.find_map(|name| inner(name, get(a, name), get(b, name)))
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() && nested(a) && nested(b) => {
            let mut pairs = a.iter().zip(b).enumerate();
            pairs.find_map(|(i, (a, b))| inner(&i, a, b))
        }
        _ => (!equal(stored, given)).then(|| Difference {
            key: key.to_owned(),
            stored: text(stored),
            given: text(given),
        }),
    }
}

fn get<'a>(object: &'a Map<String, Value>, name: &str) -> &'a Value {
    object.get(name).unwrap_or(&Value::Null)
}

/// Lists of plain values are shown whole.
fn nested(list: &[Value]) -> bool {
    let is_nested = |v: &Value| v.is_object() || v.is_array();
    !list.is_empty() && list.iter().all(is_nested)
}

fn equal(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(x), Value::Number(y)) if x.is_f64() != y.is_f64() => {
            x.as_f64() == y.as_f64()
        }
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| equal(a, b))
        }
        _ => a == b,
    }
}

fn text(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[derive(Serialize, Clone)]
    struct Part {
        sigma: f64,
        halo: Option<f64>,
        shape: [usize; 3],
    }

    #[derive(Serialize, Clone)]
    struct Whole {
        // Declared against the alphabet.
        moving: Part,
        fixed: Part,
        name: &'static str,
    }

    fn whole() -> Whole {
        let part = Part {
            sigma: 0.1,
            halo: Some(6e-3),
            shape: [9, 8, 7],
        };
        Whole {
            moving: part.clone(),
            fixed: part,
            name: "peg",
        }
    }

    fn found(change: impl Fn(&mut Whole)) -> Option<[String; 3]> {
        let mut given = whole();
        change(&mut given);
        difference(&whole(), &given).map(|d| [d.key, d.stored, d.given])
    }

    fn triple(key: &str, stored: &str, given: &str) -> Option<[String; 3]> {
        Some([key, stored, given].map(str::to_owned))
    }

    #[test]
    fn equal_provenances_have_no_difference() {
        assert_eq!(found(|_| ()), None);
    }

    #[test]
    fn the_first_declared_difference_is_named() {
        let both = |w: &mut Whole| {
            w.name = "hole";
            w.fixed.halo = Some(5e-3);
            w.moving.sigma = 0.2;
        };
        assert_eq!(found(both), triple("moving.sigma", "0.1", "0.2"));
        let later = |w: &mut Whole| w.name = "hole";
        assert_eq!(found(later), triple("name", "peg", "hole"));
    }

    #[test]
    fn the_least_change_of_a_number_counts() {
        let up = |w: &mut Whole| w.fixed.sigma = 0.1f64.next_up();
        let expected = triple("fixed.sigma", "0.1", "0.10000000000000002");
        assert_eq!(found(up), expected);
    }

    #[test]
    fn lists_are_shown_whole() {
        let shape = |w: &mut Whole| w.fixed.shape[1] = 6;
        assert_eq!(found(shape), triple("fixed.shape", "[9,8,7]", "[9,6,7]"));
        let [a, b] = [1, 2].map(|x| json!({ "parts": [{ "x": 0 }, { "x": x }] }));
        let difference = difference(&a, &b).unwrap();
        assert_eq!(difference.to_string(), "parts.1.x is 1 there, 2 here");
    }

    #[test]
    fn none_is_a_value() {
        let none = |w: &mut Whole| w.fixed.halo = None;
        assert_eq!(found(none), triple("fixed.halo", "0.006", "none"));
        let nan = |w: &mut Whole| w.fixed.sigma = f64::NAN;
        assert_eq!(found(nan), triple("fixed.sigma", "0.1", "none"));
        let both = |halo| json!({ "sigma": f64::NAN, "halo": halo });
        assert_eq!(difference(&both(None::<f64>), &json!({})), None);
    }

    #[test]
    fn missing_keys_differ_on_either_side() {
        let (less, more) = (json!({ "a": 1 }), json!({ "a": 1.0, "b": { "c": "x" } }));
        let forth = difference(&less, &more).unwrap();
        assert_eq!(forth.to_string(), "b is none there, {\"c\":\"x\"} here");
        let back = difference(&more, &less).unwrap();
        assert_eq!((back.key.as_str(), back.given.as_str()), ("b", "none"));
    }

    #[test]
    fn what_has_no_form_in_json_differs_from_itself() {
        let odd = std::collections::BTreeMap::from([([1, 2], 3)]);
        assert!(difference(&odd, &odd).is_some());
    }
}
