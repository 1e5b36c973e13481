//! A part's surface for the page.

use std::collections::HashMap;

use glam::{DVec3, IVec3};
use sdf_grid::TriangleMesh;

/// A surface of more triangles is shown coarser.
pub const MOST_TRIANGLES: usize = 200_000;

/// Cells along the longest side when a surface is made coarser for the first time.
const CELLS: f64 = 400.0;

/// A surface as it goes over the wire: vertices and triangles (u32 each), positions (three f32
/// each, metres), corners (three u32 each); little-endian.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeshMessage {
    /// What is sent.
    pub bytes: Vec<u8>,
    /// Triangles that are sent.
    pub triangles: usize,
}

impl MeshMessage {
    /// All of `mesh` if it has at most `most` triangles; else vertices that share a cell of a grid
    /// become one, in cells as large as it takes. What the loop feels is always the whole surface.
    pub fn from_mesh(mesh: &TriangleMesh, most: usize) -> Self {
        if mesh.triangles().len() <= most {
            return Self::write(mesh.vertices(), mesh.triangles());
        }
        let longest = mesh.bounds().size().max_element();
        let mut cells = CELLS;
        loop {
            let (vertices, triangles) = coarser(mesh, longest / cells);
            if triangles.len() <= most || cells < 2.0 {
                return Self::write(&vertices, &triangles);
            }
            cells *= 0.75;
        }
    }

    fn write(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut bytes = Vec::with_capacity(8 + 12 * (vertices.len() + triangles.len()));
        for count in [vertices.len(), triangles.len()] {
            bytes.extend((count as u32).to_le_bytes());
        }
        for vertex in vertices {
            bytes.extend(
                (vertex.to_array())
                    .into_iter()
                    .flat_map(|x| (x as f32).to_le_bytes()),
            );
        }
        bytes.extend(triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
        Self {
            bytes,
            triangles: triangles.len(),
        }
    }
}

/// Vertices of one cell become their mean; triangles that lose a corner are left out.
fn coarser(mesh: &TriangleMesh, cell: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut numbers: HashMap<IVec3, u32> = HashMap::new();
    let mut sums: Vec<(DVec3, f64)> = Vec::new();
    let merged: Vec<u32> = mesh
        .vertices()
        .iter()
        .map(|vertex| {
            let key = (*vertex / cell).floor().as_ivec3();
            let number = *numbers.entry(key).or_insert_with(|| {
                sums.push((DVec3::ZERO, 0.0));
                sums.len() as u32 - 1
            });
            let sum = &mut sums[number as usize];
            *sum = (sum.0 + *vertex, sum.1 + 1.0);
            number
        })
        .collect();
    let triangles = mesh
        .triangles()
        .iter()
        .map(|corners| corners.map(|i| merged[i as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    (sums.iter().map(|(sum, n)| *sum / *n).collect(), triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sdf_grid::shapes::PegInHole;

    #[test]
    fn a_surface_is_sent_whole() {
        let (hole, _) = PegInHole::Combined.pair(0.0).unwrap();
        let message = MeshMessage::from_mesh(&hole, MOST_TRIANGLES);
        let word = |at: usize| u32::from_le_bytes(message.bytes[at..at + 4].try_into().unwrap());
        let (vertices, triangles) = (hole.vertices().len(), hole.triangles().len());
        assert_eq!([word(0), word(4)], [vertices as u32, triangles as u32]);
        assert_eq!(message.bytes.len(), 8 + 12 * (vertices + triangles));
        let x = f32::from_bits(word(8 + 12));
        assert_eq!(x, hole.vertices()[1].x as f32);
        assert_eq!(word(8 + 12 * vertices + 4), hole.triangles()[0][1]);
    }

    #[test]
    fn a_large_surface_is_sent_coarser_and_stays_where_it_is() {
        let (hole, _) = PegInHole::Circular.pair(0.0).unwrap();
        let most = hole.triangles().len() / 2;
        let message = MeshMessage::from_mesh(&hole, most);
        assert!(message.triangles <= most && message.triangles > 8);
        let count = u32::from_le_bytes(message.bytes[..4].try_into().unwrap()) as usize;
        let numbers: Vec<f64> = message.bytes[8..8 + 12 * count]
            .chunks_exact(4)
            .map(|four| f64::from(f32::from_le_bytes(four.try_into().unwrap())))
            .collect();
        let bounds = hole.bounds();
        for p in numbers.chunks_exact(3) {
            let p = DVec3::new(p[0], p[1], p[2]);
            assert!(bounds.grown(1e-6).contains(p), "{p}");
        }
    }
}
