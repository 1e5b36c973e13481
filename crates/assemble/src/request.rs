//! The request of an assembly search.

use std::sync::Arc;
use std::time::Duration;

use fft_correlate::Pose;
use sdf_grid::TriangleMesh;

use crate::error::AssemblyError;

/// Most parts of a search.
const MOST_PARTS: usize = 200;

/// A part to be put together with others, wherever it was modelled.
///
/// See the example of [`AssemblyRequest`].
#[derive(Debug, Clone)]
pub struct LoosePart {
    /// What it is called.
    pub name: String,
    /// Its surface in its own frame, metres.
    pub mesh: Arc<TriangleMesh>,
}

/// Options of an assembly search.
///
/// ```
/// use std::{sync::Arc, time::Duration};
///
/// use glam::{DQuat, DVec3};
/// use pegfit_assemble::{AssemblyRequest, AssemblySearch, LoosePart};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (plate, peg) = PegInHole::Rectangular.pair(1e-4)?;
/// let peg = peg.transformed(DQuat::from_rotation_y(0.4), DVec3::X * 0.2);
/// let part = |name: &str, mesh| LoosePart { name: name.into(), mesh: Arc::new(mesh) };
/// // The plate's frame is the assembly's; nothing is taken apart.
/// let request = AssemblyRequest {
///     fixed: Some(0),
///     beam: 1,
///     path_time: Duration::ZERO,
///     ..AssemblyRequest::default()
/// };
/// let parts = vec![part("plate", plate), part("peg", peg)];
/// let found = AssemblySearch::new(parts, request)?.run(&Silent)?;
/// let best = &found.assemblies[0];
/// assert_eq!((found.pairs.len(), found.pairs[0].parts), (1, [0, 1]));
/// assert_eq!((best.placed.len(), best.mates.len()), (2, 1));
/// assert!(best.disassembly.is_none() && best.mates[0].overlap < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct AssemblyRequest {
    /// The part whose own frame is that of the assembly; by default the largest of each assembly.
    pub fixed: Option<usize>,
    /// Parts whose places are known, in the frame of the assembly. They are there from the start.
    pub placed: Vec<(usize, Pose)>,
    /// Faces at most this far apart count as mating, metres; by default from each part's size.
    pub mating_clearance: Option<f64>,
    /// Subassemblies of the same parts that are kept at a time, 1 or more.
    pub beam: usize,
    /// Assemblies that are returned, at most; 1 or more.
    pub top: usize,
    /// Time for one try to take a part or group off, when assemblies are taken apart; none are if zero.
    pub path_time: Duration,
}

impl Default for AssemblyRequest {
    /// Nothing known; four subassemblies at a time, three assemblies, ten seconds a try.
    fn default() -> Self {
        Self {
            fixed: None,
            placed: Vec::new(),
            mating_clearance: None,
            beam: 4,
            top: 3,
            path_time: Duration::from_secs(10),
        }
    }
}

impl AssemblyRequest {
    /// Refuses what makes no sense for these parts.
    pub(crate) fn validate(&self, parts: &[LoosePart]) -> Result<(), AssemblyError> {
        let count = parts.len();
        if !(2..=MOST_PARTS).contains(&count) {
            return Err(AssemblyError::PartCount {
                found: count,
                most: MOST_PARTS,
            });
        }
        let fixed = self.fixed.map(|part| ("fixed", part));
        let placed = self.placed.iter().map(|(part, _)| ("placed", *part));
        for (item, found) in fixed.into_iter().chain(placed) {
            if found >= count {
                let parts = count;
                return Err(AssemblyError::NoSuchPart { item, found, parts });
            }
        }
        for (i, (part, pose)) in self.placed.iter().enumerate() {
            let name = || parts[*part].name.clone();
            if self.placed[..i].iter().any(|(other, _)| other == part) {
                return Err(AssemblyError::PlacedTwice { part: name() });
            }
            if !pose.is_valid() {
                return Err(AssemblyError::Pose { part: name() });
            }
        }
        for (name, found) in [("beam", self.beam), ("top", self.top)] {
            if found == 0 {
                return Err(AssemblyError::Option {
                    name,
                    expected: "1 or more",
                    found: 0.0,
                });
            }
        }
        match self.mating_clearance {
            Some(found) if !(found.is_finite() && found > 0.0) => Err(AssemblyError::Option {
                name: "mating_clearance",
                expected: "a positive number of metres",
                found,
            }),
            _ => Ok(()),
        }
    }
}
