//! Repair of a mesh, before anything is computed from it.
//!
//! In order: vertices must be finite and indices in range; vertices closer than a tolerance are
//! welded; faces without area and repeated faces are dropped; open edges are cut where the vertices
//! of others lie on them, so that faces which meet share vertices; the faces of each component are
//! oriented alike, then outwards (a cavity inwards); components that touch or cut through one another
//! become the surface of their union; what is still open is measured, and refused when it is too
//! much. The result does not depend on the order of the input beyond the order of its own vertices
//! and triangles, and a second run changes nothing.

mod faces;
mod orient;
pub(crate) mod report;
mod stitch;
mod unite;
mod weld;

use glam::DVec3;

use self::report::{ComponentReport, RepairOptions, RepairReport};
use crate::mesh::aabb::Aabb;
use crate::mesh::error::MeshError;
use crate::mesh::measure::{face_area, volume};
use crate::mesh::topology::{Edge, Topology};

/// The largest coordinate magnitude accepted, metres: squares and cubes of it stay finite.
const COORDINATE_LIMIT: f64 = 1e12;

/// Vertices, triangles and the report of what was done to them.
type RepairedMesh = (Vec<DVec3>, Vec<[u32; 3]>, RepairReport);

/// Runs the pipeline; see the module documentation.
pub(crate) fn run(
    name: &str,
    mut vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    options: &RepairOptions,
) -> Result<RepairedMesh, MeshError> {
    check_options(name, options)?;
    check_input(name, &vertices, &triangles)?;
    let (input_vertices, input_triangles) = (vertices.len(), triangles.len());

    // A stray vertex that no face uses must not coarsen the weld.
    let used = triangles.iter().flatten().map(|&v| vertices[v as usize]);
    let diagonal = Aabb::around(used).diagonal();
    let weld_distance = options.weld_tolerance * diagonal;
    let (mut triangles, welded) = welded(&vertices, &triangles, weld_distance);
    let changed = change_faces(&vertices, &mut triangles, diagonal, weld_distance);
    if triangles.is_empty() {
        return Err(MeshError::Empty {
            part: name.to_owned(),
            vertices: input_vertices,
            triangles: input_triangles,
            zero_area: changed.zero_area,
            duplicates: changed.duplicate,
        });
    }

    let mut oriented = orient::orient(&vertices, triangles);
    let flipped_faces = oriented.components.iter().map(|c| c.flipped_faces).sum();
    let mut united_components = 0;
    if let Some(united) = unite::unite(name, &vertices, &oriented, weld_distance)? {
        united_components = united.components;
        vertices = united.vertices;
        (triangles, _) = self::welded(&vertices, &united.triangles, weld_distance);
        change_faces(&vertices, &mut triangles, diagonal, weld_distance);
        oriented = orient::orient(&vertices, triangles);
    }
    let (vertices, triangles) = compact(&vertices, oriented.triangles);
    let report = RepairReport {
        input_vertices,
        input_triangles,
        welded_vertices: welded,
        unused_vertices: (input_vertices - welded).saturating_sub(vertices.len()),
        weld_distance,
        zero_area_faces: changed.zero_area,
        duplicate_faces: changed.duplicate,
        stitched_edges: changed.stitched,
        flipped_faces,
        united_components,
        ..described(name, &vertices, &triangles, oriented.components)
    };
    if report.open_area_fraction > options.max_open_fraction {
        return Err(MeshError::Open {
            part: name.to_owned(),
            open_edges: report.open_edges,
            limit: options.max_open_fraction,
            found: report.open_area_fraction,
        });
    }
    Ok((vertices, triangles, report))
}

/// The triangles on welded vertices, and how many vertices became others.
fn welded(vertices: &[DVec3], triangles: &[[u32; 3]], distance: f64) -> (Vec<[u32; 3]>, usize) {
    let welded = weld::weld(vertices, distance);
    let on = |t: &[u32; 3]| t.map(|v| welded.representative[v as usize]);
    (triangles.iter().map(on).collect(), welded.merged)
}

/// Counts of changed faces.
struct FaceChanges {
    zero_area: usize,
    duplicate: usize,
    stitched: usize,
}

/// Drops faces without area and repeated ones, and cuts open edges, until nothing changes.
fn change_faces(
    vertices: &[DVec3],
    triangles: &mut Vec<[u32; 3]>,
    diagonal: f64,
    weld_distance: f64,
) -> FaceChanges {
    let mut changed = FaceChanges {
        zero_area: 0,
        duplicate: 0,
        stitched: 0,
    };
    // A corner on a line where faces meet cuts about one side. In a knot of faces hardly larger
    // than the weld distance cuts can open sides to cut, in numbers that grow exponentially.
    let mut budget = 3 * triangles.len();
    // Cutting faces can repeat one that exists; dropping that one can open an edge.
    loop {
        changed.zero_area += faces::drop_zero_area(vertices, triangles, diagonal);
        changed.duplicate += faces::drop_duplicates(vertices.len(), triangles);
        let cut = stitch::stitch(vertices, triangles, weld_distance, &mut budget);
        changed.stitched += cut;
        if cut == 0 {
            return changed;
        }
    }
}

/// The report of a mesh to which nothing but the flipping of faces was done.
fn described(
    name: &str,
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    components: Vec<ComponentReport>,
) -> RepairReport {
    let topology = Topology::new(triangles, vertices.len());
    let count = |is: fn(&Edge<'_>) -> bool| topology.edges().filter(is).count();
    let faces = triangles.iter().map(|t| t.map(|v| vertices[v as usize]));
    let area: f64 = faces.map(face_area).sum();
    let missing = missing_area(vertices, &topology);
    RepairReport {
        name: name.to_owned(),
        input_vertices: vertices.len(),
        input_triangles: triangles.len(),
        vertices: vertices.len(),
        triangles: triangles.len(),
        welded_vertices: 0,
        unused_vertices: 0,
        weld_distance: 0.0,
        zero_area_faces: 0,
        duplicate_faces: 0,
        stitched_edges: 0,
        flipped_faces: components.iter().map(|c| c.flipped_faces).sum(),
        components: components.len(),
        cavities: components.iter().filter(|c| c.cavity).count(),
        united_components: 0,
        per_component: components,
        open_edges: count(|e| e.is_open()),
        nonmanifold_edges: count(|e| e.is_nonmanifold()),
        inconsistent_edges: count(|e| e.is_inconsistent()),
        watertight: topology.is_closed(),
        open_area_fraction: missing / (missing + area),
        volume: volume(vertices, triangles),
        area,
        bounds: Aabb::around(vertices.iter().copied()),
    }
}

/// Area of the fans that close the boundary loops, each about the centroid of its loop's vertices.
fn missing_area(vertices: &[DVec3], topology: &Topology<'_>) -> f64 {
    let fan = |ring: &Vec<u32>| {
        let at = |i: usize| vertices[ring[i % ring.len()] as usize];
        let center = (0..ring.len()).map(at).sum::<DVec3>() / ring.len() as f64;
        let faces = (0..ring.len()).map(|i| face_area([center, at(i), at(i + 1)]));
        faces.sum::<f64>()
    };
    let loops = topology.boundary_loops(vertices);
    loops.iter().map(fan).fold(0.0, |sum, area| sum + area)
}

fn check_options(name: &str, options: &RepairOptions) -> Result<(), MeshError> {
    let check = |item, found: f64, high: f64, expected| {
        if (0.0..=high).contains(&found) {
            return Ok(());
        }
        Err(MeshError::OutOfRange {
            part: name.to_owned(),
            item,
            expected,
            found,
        })
    };
    check(
        "weld-tolerance",
        options.weld_tolerance,
        0.01,
        "a fraction 0 .. 0.01",
    )?;
    check(
        "max-open-fraction",
        options.max_open_fraction,
        1.0,
        "a fraction 0 .. 1",
    )
}

fn check_input(name: &str, vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), MeshError> {
    // Face numbers and their three edges are counted in 32 bits.
    let limit = u64::from(u32::MAX / 4);
    for (item, found) in [
        ("vertices", vertices.len() as u64),
        ("triangles", triangles.len() as u64),
    ] {
        if found > limit {
            return Err(MeshError::TooLarge {
                part: name.to_owned(),
                item,
                limit,
                found,
            });
        }
    }
    let finite = |v: &DVec3| v.is_finite() && v.abs().max_element() <= COORDINATE_LIMIT;
    if let Some(vertex) = vertices.iter().position(|v| !finite(v)) {
        return Err(MeshError::NonFiniteVertex {
            part: name.to_owned(),
            vertex,
            limit: COORDINATE_LIMIT,
            found: vertices[vertex],
        });
    }
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&found) = corners.iter().find(|&&v| v as usize >= vertices.len()) {
            return Err(MeshError::IndexOutOfRange {
                part: name.to_owned(),
                triangle,
                expected: vertices.len(),
                found,
            });
        }
    }
    Ok(())
}

/// Keeps the vertices that are used, in the order of their first use.
pub(crate) fn compact(
    vertices: &[DVec3],
    mut triangles: Vec<[u32; 3]>,
) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut place = vec![u32::MAX; vertices.len()];
    let mut kept = Vec::new();
    for corner in triangles.iter_mut().flatten() {
        let slot = &mut place[*corner as usize];
        if *slot == u32::MAX {
            *slot = kept.len() as u32;
            // Adding zero turns -0 into 0, so that equal meshes have equal bits.
            kept.push(vertices[*corner as usize] + 0.0);
        }
        *corner = *slot;
    }
    (kept, triangles)
}
