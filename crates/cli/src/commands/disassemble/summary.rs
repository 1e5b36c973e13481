//! What is told of an order, to programs and to people.

use fft_correlate::Placement;
use pegfit_path::{DisassemblyResult, DisassemblyStep};
use sdf_grid::LengthUnit;
use serde::Serialize;

use crate::report::way::summary::{Summary, words};

/// An order for programs: metres, radians, in the scene.
#[derive(Serialize)]
pub(super) struct Order {
    /// Names of the parts, the base first.
    parts: Vec<String>,
    /// Whether all parts come apart.
    apart: bool,
    steps: Vec<Step>,
    locked: Vec<Locked>,
    tries: usize,
    poses_looked_at: usize,
    seconds: f64,
}

/// Parts that come off, outwards from where they are assembled.
#[derive(Serialize)]
struct Step {
    parts: Vec<String>,
    rest: Vec<String>,
    file: Option<String>,
    #[serde(flatten)]
    way: Summary,
}

/// Parts that block each other.
#[derive(Serialize)]
struct Locked {
    parts: Vec<String>,
    /// Whether everything was tried.
    exhausted: bool,
}

fn named(parts: &[usize], names: &[&str]) -> Vec<String> {
    parts.iter().map(|p| names[*p].to_owned()).collect()
}

impl Order {
    /// `files` are those of the steps, if they are written.
    pub(super) fn new(found: &DisassemblyResult, names: &[&str], files: Option<&[String]>) -> Self {
        let step = |(i, s): (usize, &DisassemblyStep)| Step {
            parts: named(&s.parts, names),
            rest: named(&s.rest, names),
            file: files.and_then(|f| f.get(i).cloned()),
            way: Summary::new(&s.path, &Placement::default(), None),
        };
        let locked = found.locked.iter().map(|l| Locked {
            parts: named(&l.parts, names),
            exhausted: l.exhausted,
        });
        Self {
            parts: names.iter().map(|n| (*n).to_owned()).collect(),
            apart: found.locked.is_empty(),
            steps: found.steps.iter().enumerate().map(step).collect(),
            locked: locked.collect(),
            tries: found.tries,
            poses_looked_at: found.poses_checked,
            seconds: found.seconds,
        }
    }
}

/// What comes off what, by which motions.
pub(super) fn told(step: &DisassemblyStep, names: &[&str]) -> String {
    format!(
        "{} off {}: {}",
        named(&step.parts, names).join(" + "),
        named(&step.rest, names).join(", "),
        words(&step.path.motions, &Placement::default()),
    )
}

/// Prints the order.
pub(super) fn say(found: &DisassemblyResult, names: &[&str], unit: LengthUnit) {
    let metre = unit.in_metres();
    let head = match (found.steps.is_empty(), found.locked.is_empty()) {
        (_, true) => "comes apart",
        (false, false) => "comes apart in part",
        (true, false) => "does not come apart",
    };
    crate::say!(
        "{head}: {} parts, {} steps, {} parts and groups tried, {} poses looked at, {:.1} s",
        names.len(),
        found.steps.len(),
        found.tries,
        found.poses_checked,
        found.seconds
    );
    for (i, step) in found.steps.iter().enumerate() {
        crate::say!(
            "  {}. {} ({:.3} {unit} long, largest overlap {:.5} {unit})",
            i + 1,
            told(step, names),
            step.path.length() / metre,
            step.path.deepest().1 / metre
        );
    }
    for locked in &found.locked {
        let how = match locked.exhausted {
            true => "everything was tried at these steps",
            false => {
                "no proof: time ran out, or larger groups were not tried; allow more \
                      --seconds or a larger --group"
            }
        };
        let parts = named(&locked.parts, names).join(", ");
        crate::say!("  {parts} block each other: {how}");
    }
}
