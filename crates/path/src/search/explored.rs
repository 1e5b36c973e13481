//! What a search has explored, for one that goes on from there.

use fft_correlate::Pose;
use serde::{Deserialize, Serialize};

use crate::contact::body::Body;
use crate::error::PathError;
use crate::search::node::{Node, seven};

/// Places that a search has reached from a goal at the tolerance: one that is given them goes on there
/// instead of at the goal. It is empty at first, belongs to one question, and can be written to a file.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Explored {
    question: Option<Question>,
    /// Passes, coarse to fine, in which everything was tried.
    pub(crate) passes: usize,
    /// Of the pass that has begun.
    pub(crate) nodes: Vec<Node>,
}

/// What was asked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    fixed: String,
    moving: String,
    goal: [f64; 7],
    level: f64,
}

impl Explored {
    /// How many places there are.
    pub fn places(&self) -> usize {
        self.nodes.len()
    }

    /// Whether nothing has been explored yet.
    pub(crate) fn is_new(&self) -> bool {
        self.passes == 0 && self.nodes.is_empty()
    }

    /// Begins a question, or goes on with it.
    ///
    /// # Errors
    /// If it belongs to another one, or its places do not lead from one to the next.
    pub(crate) fn ask(
        &mut self,
        [fixed, moving]: [&Body; 2],
        goal: &Pose,
        level: f64,
    ) -> Result<(), PathError> {
        let asked = Question {
            fixed: hashes(fixed),
            moving: hashes(moving),
            goal: seven(goal),
            level,
        };
        let refused = |item| Err(PathError::Explored { item });
        if let Some(known) = &self.question {
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * (1.0 + a.abs());
            let same_goal = known
                .goal
                .iter()
                .zip(&asked.goal)
                .all(|(a, b)| near(*a, *b));
            match () {
                () if known.fixed != asked.fixed => return refused("the fixed part"),
                () if known.moving != asked.moving => return refused("the moving part"),
                () if !same_goal => return refused("the goal"),
                () if !near(known.level, asked.level) => return refused("the tolerance"),
                () => {}
            }
        }
        let earlier = |(i, node): (usize, &Node)| match &node.from {
            None => i == 0,
            Some((from, _)) => *from < i,
        };
        if !self.nodes.iter().enumerate().all(earlier) {
            return refused("what leads where");
        }
        self.question = Some(asked);
        Ok(())
    }
}

/// What tells one body from another.
fn hashes(body: &Body) -> String {
    let bytes = body
        .meshes()
        .flat_map(|mesh| mesh.hash().into_iter().take(16));
    bytes.map(|byte| format!("{byte:02x}")).collect()
}
