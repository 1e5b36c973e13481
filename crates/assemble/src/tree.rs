//! An assembly as a tree: each part hangs from one that was placed before it.

use fft_correlate::Pose;
use fft_correlate::mating::{Joint, Travel};

use crate::result::{Assembly, Mate};

/// A placed part, and the part that it hangs from.
///
/// ```
/// use fft_correlate::{Pose, mating::{Joint, JointKind}};
/// use glam::DVec3;
/// use pegfit_assemble::{Assembly, Mate, PlacedPart};
///
/// // Part 1 in a hole of part 0, which stands at x = 1 m.
/// let place = |part, x| PlacedPart { part, pose: Pose::from_translation(DVec3::X * x) };
/// let joint = Joint { kind: JointKind::Prismatic, axis: DVec3::Z, ..Joint::default() };
/// let assembly = Assembly {
///     placed: vec![place(0, 1.0), place(1, 1.5)],
///     left_over: vec![],
///     mates: vec![Mate { parts: [0, 1], information: 20.0, area: 1e-4, overlap: 0.0, joint }],
///     score: 20.0,
///     shortfall: 0.0,
///     disassembly: None,
/// };
/// let links = assembly.links();
/// assert_eq!((links[0].parent, links[1].parent), (None, Some(0)));
/// // In the frame of the part that it hangs from, metres.
/// assert_eq!(links[1].pose.translation, DVec3::X * 0.5);
/// assert_eq!(links[1].joint.kind, JointKind::Prismatic);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct AssemblyLink {
    /// Which part.
    pub part: usize,
    /// The link that it hangs from, which stands before it; none of the first part, and of parts that
    /// touch none placed before them.
    pub parent: Option<usize>,
    /// From its own frame to the parent's own frame; without a parent to the assembly.
    pub pose: Pose,
    /// The joint that their contact alone leaves, in the parent's own frame: motions of the part.
    pub joint: Joint,
}

impl Assembly {
    /// The placed parts, in their order, each with the part of its best mate among those placed before
    /// it: the one whose contact says most about its pose. A part that several others hold together
    /// has more freedom in the joint to one of them than it has.
    pub fn links(&self) -> Vec<AssemblyLink> {
        let number = |part: usize| self.placed.iter().position(|p| p.part == part);
        let mut links = Vec::new();
        for (i, placed) in self.placed.iter().enumerate() {
            let before = |mate: &Mate| {
                let other = other_of(mate, placed.part)?;
                number(other).filter(|n| *n < i)
            };
            let mates = self.mates.iter().filter_map(|m| Some((before(m)?, m)));
            let best = mates.max_by(|a, b| a.1.information.total_cmp(&b.1.information));
            links.push(match best {
                Some((parent, mate)) => {
                    let to_parent = self.placed[parent].pose.inverse();
                    // Mates tell how the second of their parts moves.
                    let joint = match mate.parts[1] == placed.part {
                        true => mate.joint.clone(),
                        false => reversed(&mate.joint),
                    };
                    AssemblyLink {
                        part: placed.part,
                        parent: Some(parent),
                        pose: to_parent * placed.pose,
                        joint: carried(&joint, &to_parent),
                    }
                }
                None => AssemblyLink {
                    part: placed.part,
                    parent: None,
                    pose: placed.pose,
                    joint: Joint::default(),
                },
            });
        }
        links
    }
}

/// The other part of a mate, if `part` is one of them.
fn other_of(mate: &Mate, part: usize) -> Option<usize> {
    match mate.parts {
        [a, b] if a == part => Some(b),
        [a, b] if b == part => Some(a),
        _ => None,
    }
}

/// A joint in a frame that a motion carries it to.
fn carried(joint: &Joint, motion: &Pose) -> Joint {
    Joint {
        axis: motion.rotation * joint.axis,
        point: motion.apply(joint.point),
        ..joint.clone()
    }
}

/// The same joint seen from the other part: it moves the other way. A screw keeps its pitch.
fn reversed(joint: &Joint) -> Joint {
    let travel = |t: &Travel| Travel {
        range: [-t.range[1], -t.range[0]],
        blocked: [t.blocked[1], t.blocked[0]],
    };
    Joint {
        slide: joint.slide.as_ref().map(travel),
        turn: joint.turn.as_ref().map(travel),
        ..joint.clone()
    }
}
