//! What parsers hand on: vertices and triangles as the file gives them, the solids they form, and
//! what was made of the rest of the file.

use std::ops::Range;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::ledger::{Ledger, LedgerKind};
use super::unit::LengthUnit;
use crate::mesh::error::MeshError;
use crate::mesh::polygon;
use crate::text::quoted;

/// Most vertices that a file which places parts several times may unfold to: such a file may be
/// far smaller than its mesh.
const MOST_UNFOLDED: u64 = 1 << 26;

/// One of the solids in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Solid {
    /// Its name in the file; empty if it has none.
    pub name: String,
    /// Number of its triangles, before repair.
    pub triangles: usize,
}

/// Something of a file that changes a solid and is not read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Loss {
    /// The solids that it changes, by their indices in [`Soup::names`]; all of them if `None`.
    solids: Option<Range<usize>>,
    /// Where in the file it stands.
    place: String,
    /// A description of it.
    found: String,
}

/// Vertices in the file's unit and triangles, as a file gives them.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Soup {
    /// Positions, in `unit`.
    pub(super) vertices: Vec<DVec3>,
    /// Vertex indices, not checked.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Unit that the file states.
    pub(super) unit: Option<LengthUnit>,
    /// Items read, ignored and assumed.
    pub(super) ledger: Ledger,
    /// Name of each solid. One without triangles is not listed.
    pub(super) names: Vec<String>,
    /// Solid and first triangle of each run of triangles; it goes on to the first of the next.
    pub(super) runs: Vec<(usize, usize)>,
    pub(super) losses: Vec<Loss>,
}

impl Soup {
    /// Starts a solid and returns its index.
    pub(super) fn begin_solid(&mut self, name: &str) -> usize {
        self.names.push(name.to_owned());
        self.resume_solid(self.names.len() - 1);
        self.names.len() - 1
    }

    /// Goes on with a solid that was begun before.
    pub(super) fn resume_solid(&mut self, solid: usize) {
        let start = self.triangles.len();
        if self.runs.last().is_some_and(|run| run.1 == start) {
            self.runs.pop();
        }
        self.runs.push((solid, start));
    }

    /// Divides the triangles anew: `of[t]` is the solid of triangle `t`, an index of `names`.
    pub(super) fn divide(&mut self, names: Vec<String>, of: &[usize]) {
        self.names = names;
        self.runs.clear();
        for (triangle, &solid) in of.iter().enumerate() {
            if self.runs.last().is_none_or(|run| run.0 != solid) {
                self.runs.push((solid, triangle));
            }
        }
    }

    /// Forgets the solids: the file is one.
    pub(super) fn unite(&mut self) {
        self.divide(Vec::new(), &[]);
    }

    /// Index of the solid of each triangle; that of the first for those before any.
    pub(super) fn solid_of_each(&self) -> Vec<usize> {
        let mut of = vec![0; self.triangles.len()];
        for (solid, range) in self.spans() {
            of[range].fill(solid);
        }
        of
    }

    /// Counts what is part of the result.
    pub(super) fn read(&mut self, item: &str, count: usize) {
        self.ledger
            .add_many(LedgerKind::Read, item, "", count as u64);
    }

    /// Counts items that change no solid.
    pub(super) fn ignore(&mut self, item: &str, reason: &str, count: usize) {
        self.ledger
            .add_many(LedgerKind::Ignored, item, reason, count as u64);
    }

    /// Records an item that changes some solids, or all of them, and cannot be read: such solids can
    /// only be used if the options of reading allow it.
    pub(super) fn record_loss(
        &mut self,
        solids: Option<Range<usize>>,
        place: impl Into<String>,
        item: &str,
        reason: &str,
    ) {
        self.ignore(item, reason, 1);
        let loss = Loss {
            solids,
            place: place.into(),
            found: format!("{item}: {reason}"),
        };
        // Of many equal losses in a row the first one is enough.
        let known = |last: &Loss| (&last.solids, &last.found) == (&loss.solids, &loss.found);
        if !self.losses.last().is_some_and(known) {
            self.losses.push(loss);
        }
    }

    /// The solids that have triangles.
    pub(super) fn solids(&self) -> Vec<Solid> {
        self.filled()
            .into_iter()
            .map(|(solid, triangles)| Solid {
                name: self.names[solid].clone(),
                triangles,
            })
            .collect()
    }

    /// Solid and triangles of each run.
    fn spans(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        let ends = self.runs.iter().skip(1).map(|run| run.1);
        let ends = ends.chain([self.triangles.len()]);
        self.runs
            .iter()
            .zip(ends)
            .map(|(&(solid, start), end)| (solid, start..end))
    }

    /// Index and number of triangles of each solid that has some.
    fn filled(&self) -> Vec<(usize, usize)> {
        let mut counts = vec![0; self.names.len()];
        for (solid, range) in self.spans() {
            counts[solid] += range.len();
        }
        let counts = counts.into_iter().enumerate();
        counts.filter(|(_, count)| *count > 0).collect()
    }

    /// The indices of the solids that are meant: the only one of that name, else all of the
    /// assembly of that name, else the one of that number from 1.
    fn find(&self, file: &str, wanted: &str) -> Result<Vec<usize>, MeshError> {
        let filled: Vec<usize> = self.filled().into_iter().map(|f| f.0).collect();
        let chosen = |meant: &dyn Fn(&str) -> bool| -> Vec<usize> {
            let meant = |&&solid: &&usize| meant(&self.names[solid]);
            filled.iter().filter(meant).copied().collect()
        };
        let named = chosen(&|name| name == wanted);
        if named.len() == 1 {
            return Ok(named);
        }
        let below = chosen(&|name| {
            let rest = name.strip_prefix(wanted);
            rest.is_some_and(|rest| rest.starts_with('/')) && !wanted.is_empty()
        });
        let number = || wanted.parse::<usize>().ok()?.checked_sub(1);
        let numbered = || number().and_then(|n| filled.get(n));
        match (named.is_empty(), below.is_empty(), numbered()) {
            (true, false, _) => Ok(below),
            (true, true, Some(&solid)) => Ok(vec![solid]),
            _ => Err(MeshError::Solid {
                file: file.to_owned(),
                wanted: wanted.to_owned(),
                matches: named.len(),
                found: listed(filled.iter().map(|&solid| self.names[solid].as_str())),
            }),
        }
    }

    /// Vertices and triangles of the wanted solid, or of all, unless something of them was lost
    /// and `lossy` does not allow it.
    pub(super) fn select(
        &self,
        file: &str,
        wanted: Option<&str>,
        lossy: bool,
    ) -> Result<(Vec<DVec3>, Vec<[u32; 3]>), MeshError> {
        let Some(wanted) = wanted else {
            self.check_losses(file, None, lossy)?;
            return Ok((self.vertices.clone(), self.triangles.clone()));
        };
        let chosen = self.find(file, wanted)?;
        self.check_losses(file, Some(&chosen), lossy)?;
        let spans = self.spans().filter(|(solid, _)| chosen.contains(solid));
        let mut places = FxHashMap::default();
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for corners in spans.flat_map(|(_, range)| &self.triangles[range]) {
            let mut kept = [0; 3];
            for (kept, &corner) in kept.iter_mut().zip(corners) {
                *kept = *places.entry(corner).or_insert_with(|| {
                    let next = vertices.len() as u32;
                    // Beyond the vertices it stays beyond them, for repair to refuse.
                    match self.vertices.get(corner as usize) {
                        Some(&vertex) => {
                            vertices.push(vertex);
                            next
                        }
                        None => corner,
                    }
                });
            }
            triangles.push(kept);
        }
        Ok((vertices, triangles))
    }

    fn check_losses(
        &self,
        file: &str,
        solids: Option<&[usize]>,
        lossy: bool,
    ) -> Result<(), MeshError> {
        let concerns = |loss: &&Loss| match (&loss.solids, solids) {
            (Some(changed), Some(chosen)) => chosen.iter().any(|solid| changed.contains(solid)),
            _ => true,
        };
        match self.losses.iter().find(concerns).filter(|_| !lossy) {
            Some(loss) => Err(MeshError::Unread {
                file: file.to_owned(),
                place: loss.place.clone(),
                found: loss.found.clone(),
            }),
            None => Ok(()),
        }
    }

    /// Refuses a part that would unfold to too much.
    pub(super) fn check_room(&self, file: &str, more: usize) -> Result<(), MeshError> {
        let found = self.vertices.len() as u64 + more as u64;
        if found <= MOST_UNFOLDED {
            return Ok(());
        }
        Err(MeshError::TooLarge {
            part: file.to_owned(),
            item: "vertices after all parts are placed",
            limit: MOST_UNFOLDED,
            found,
        })
    }

    /// Adds a polygon, cut into triangles; `place` says where in the file it stands.
    pub(super) fn push_polygon(
        &mut self,
        file: &str,
        place: impl Fn() -> String,
        corners: &[u32],
    ) -> Result<(), MeshError> {
        let wrong = |expected: String, found: String| Err(syntax(file, place(), expected, found));
        match *corners {
            [] | [_] | [_, _] => {
                self.ignore("face of fewer than 3 corners", "it has no area", 1);
                return Ok(());
            }
            // A face may come before its vertices; repair checks that they exist.
            [a, b, c] => {
                self.triangles.push([a, b, c]);
                return Ok(());
            }
            _ => {}
        }
        let count = self.vertices.len();
        if let Some(beyond) = corners.iter().find(|&&c| c as usize >= count) {
            let expected = format!("a face on the {count} vertices before it");
            return wrong(expected, format!("vertex {}", u64::from(*beyond) + 1));
        }
        let points: Vec<DVec3> = corners.iter().map(|&c| self.vertices[c as usize]).collect();
        let Some(cuts) = polygon::triangulate_in_space(&points) else {
            let expected = "a polygon that does not cross itself".to_owned();
            return wrong(expected, "one that does".to_owned());
        };
        let named = cuts.iter().map(|t| t.map(|i| corners[i as usize]));
        self.triangles.extend(named);
        Ok(())
    }
}

/// `1 "housing", 2 "shaft"`, cut off after ten.
fn listed<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    let count = names.len();
    if count == 0 {
        return "no named solids".to_owned();
    }
    let shown: Vec<String> = names
        .take(10)
        .enumerate()
        .map(|(i, name)| format!("{} {}", i + 1, quoted(name)))
        .collect();
    let more = if count > 10 { ", ..." } else { "" };
    format!("{}{more}", shown.join(", "))
}

/// An error at a place in a file.
pub(super) fn syntax(
    file: &str,
    place: impl Into<String>,
    expected: impl Into<String>,
    found: impl Into<String>,
) -> MeshError {
    MeshError::Syntax {
        file: file.to_owned(),
        place: place.into(),
        expected: expected.into(),
        found: found.into(),
    }
}
