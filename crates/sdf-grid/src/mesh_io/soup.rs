//! What parsers hand on: vertices and triangles as the file gives them, and the solids they form.

use std::ops::Range;

use glam::DVec3;

use super::unit::LengthUnit;
use crate::mesh::error::MeshError;
use crate::mesh::polygon;

/// Most vertices that a file which places parts several times may unfold to: such a file may be
/// far smaller than its mesh.
const MOST_UNFOLDED: u64 = 1 << 26;

/// One of the solids in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Solid {
    /// Its name in the file; empty if it has none.
    pub name: String,
    /// Number of its triangles, before hygiene.
    pub triangles: usize,
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
    /// Name and first triangle of each solid; it goes on to the first of the next.
    pub(super) starts: Vec<(String, usize)>,
}

impl Soup {
    /// Starts a solid; one that gets no triangle is forgotten.
    pub(super) fn begin_solid(&mut self, name: &str) {
        if self
            .starts
            .last()
            .is_some_and(|s| s.1 == self.triangles.len())
        {
            self.starts.pop();
        }
        self.starts.push((name.to_owned(), self.triangles.len()));
    }

    /// The solids that have triangles.
    pub(super) fn solids(&self) -> Vec<Solid> {
        self.ranges()
            .map(|(name, range)| Solid {
                name: name.to_owned(),
                triangles: range.len(),
            })
            .collect()
    }

    fn ranges(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        let ends = self.starts.iter().skip(1).map(|s| s.1);
        let ends = ends.chain([self.triangles.len()]);
        let starts = self
            .starts
            .iter()
            .map(|(name, start)| (name.as_str(), *start));
        starts
            .zip(ends)
            .map(|((name, start), end)| (name, start..end))
            .filter(|(_, range)| !range.is_empty())
    }

    /// Keeps one solid: the only one of that name, else the one of that number from 1.
    pub(super) fn select(self, file: &str, wanted: &str) -> Result<Self, MeshError> {
        let found: Vec<_> = self.ranges().collect();
        let named: Vec<usize> = (0..found.len()).filter(|&i| found[i].0 == wanted).collect();
        let chosen = match named[..] {
            [only] => Some(only),
            [] => wanted
                .parse::<usize>()
                .ok()
                .and_then(|number| number.checked_sub(1))
                .filter(|&i| i < found.len()),
            _ => None,
        };
        let Some(chosen) = chosen else {
            return Err(MeshError::Solid {
                file: file.to_owned(),
                wanted: wanted.to_owned(),
                matches: named.len(),
                found: listed(found.iter().map(|f| f.0)),
            });
        };
        let triangles = self.triangles[found[chosen].1.clone()].to_vec();
        Ok(Self {
            triangles,
            vertices: self.vertices,
            unit: self.unit,
            starts: Vec::new(),
        })
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
                let found = corners.len().to_string();
                return wrong("a face of at least 3 corners".to_owned(), found);
            }
            // A face may come before its vertices; hygiene checks that they exist.
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
        .map(|(i, name)| format!("{} {name:?}", i + 1))
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
