//! What every mesh goes through before anything is computed from it.
//!
//! In order: vertices must be finite and indices in range; vertices closer than a tolerance are
//! welded; faces without area and repeated faces are dropped; open edges are cut where the vertices
//! of others lie on them, so that faces which meet share vertices; the faces of each component are
//! oriented alike, then outwards (a cavity inwards); what is still open is measured, and refused
//! when it is too much. The result does not depend on the order of the input beyond the order of
//! its own vertices and triangles, and a second run changes nothing.

mod edges;
mod faces;
mod holes;
mod orient;
mod stitch;
mod weld;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::mesh::{Aabb, face_area, volume};
use crate::mesh_error::MeshError;

/// The largest coordinate magnitude accepted, metres: squares and cubes of it stay finite.
const COORDINATE_LIMIT: f64 = 1e12;

/// What hygiene may change and what it refuses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct HygieneOptions {
    /// Vertices closer than this fraction of the diagonal of the bounds become one, 0 .. 0.01;
    /// 0 welds only equal positions.
    pub weld_tolerance: f64,
    /// The largest [`HygieneReport::open_area_fraction`] accepted, 0 .. 1.
    pub max_open_fraction: f64,
}

impl Default for HygieneOptions {
    /// Weld at 1e-6 of the diagonal (finer than any tessellation, coarser than single precision),
    /// refuse above 10 % of open area.
    fn default() -> Self {
        Self {
            weld_tolerance: 1e-6,
            max_open_fraction: 0.1,
        }
    }
}

/// What hygiene found and changed in one component of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ComponentReport {
    /// Triangles kept.
    pub triangles: usize,
    /// Of these, how many were reversed; all of them if the component was inside out.
    pub flipped_faces: usize,
    /// Enclosed volume, cubic metres, negative for a cavity; 0 for a sheet that encloses nothing,
    /// whose outside is unknown.
    pub volume: f64,
    /// It lies inside another component and therefore points inwards.
    pub cavity: bool,
    /// It cuts through one at least as large or coincides with it.
    pub overlaps: bool,
}

/// What hygiene found and changed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HygieneReport {
    /// File or part name.
    pub name: String,
    /// Vertices in the input.
    pub input_vertices: usize,
    /// Triangles in the input, after polygons were cut.
    pub input_triangles: usize,
    /// Vertices kept.
    pub vertices: usize,
    /// Triangles kept.
    pub triangles: usize,
    /// Vertices that became another one because they lay within the weld tolerance of it.
    pub welded_vertices: usize,
    /// Vertices dropped because no kept triangle uses them.
    pub unused_vertices: usize,
    /// Distance below which vertices were welded, metres.
    pub weld_distance: f64,
    /// Triangles dropped because they have no area (fewer than three distinct corners after
    /// welding, or a height below 1e-9 of the diagonal).
    pub zero_area_faces: usize,
    /// Triangles dropped because another kept one has the same corners, or because they and an
    /// opposite copy form a wall between two solids that touch.
    pub duplicate_faces: usize,
    /// Open edges cut at vertices that lie on them within the weld distance (T-junctions).
    pub stitched_edges: usize,
    /// Kept triangles whose orientation was reversed.
    pub flipped_faces: usize,
    /// Parts of the surface connected through edges of exactly two faces.
    pub components: usize,
    /// Components that lie inside another one and therefore point inwards.
    pub cavities: usize,
    /// Components that cut through one at least as large or coincide with it; the solid is their
    /// union, but the surface inside it still counts in areas and volumes.
    pub overlapping_components: usize,
    /// Each of the components, in the order of their first faces.
    pub per_component: Vec<ComponentReport>,
    /// Edges with only one face.
    pub open_edges: usize,
    /// Edges with more than two faces.
    pub nonmanifold_edges: usize,
    /// Edges of two faces that cannot be oriented alike (the surface is one-sided there).
    pub inconsistent_edges: usize,
    /// True if every edge is used equally often in both directions: the surface encloses a solid
    /// and winding numbers are whole.
    pub watertight: bool,
    /// Area of fans that would close the boundary loops, over that area plus the area present,
    /// 0 .. 1. The fans share the centroid of their loop.
    pub open_area_fraction: f64,
    /// Enclosed volume, cubic metres.
    pub volume: f64,
    /// Area of the kept triangles, square metres.
    pub area: f64,
    /// Box around the kept triangles, metres.
    pub bounds: Aabb,
}

impl HygieneReport {
    /// One sentence for each thing that was changed or that makes results less certain; empty for
    /// a mesh that needed nothing.
    pub fn warnings(&self) -> Vec<String> {
        let mut list = Vec::new();
        let mut say = |count: usize, text: &str| {
            if count > 0 {
                list.push(format!("{}: {count} {text}", self.name));
            }
        };
        say(self.zero_area_faces, "zero-area faces dropped");
        say(self.duplicate_faces, "duplicate faces dropped");
        say(
            self.stitched_edges,
            "open edges cut at the vertices on them (T-junctions)",
        );
        say(self.flipped_faces, "faces pointed the wrong way: reversed");
        say(
            self.cavities,
            "components lie inside others: taken as cavities",
        );
        say(
            self.overlapping_components,
            "components cut through or coincide with others: the solid is their union",
        );
        say(
            self.nonmanifold_edges,
            "edges have more than two faces (non-manifold)",
        );
        say(
            self.inconsistent_edges,
            "edges lie where the surface is one-sided: inside and outside are uncertain",
        );
        say(
            self.open_edges,
            &format!(
                "open edges: {:.3} % of the area is missing",
                100.0 * self.open_area_fraction
            ),
        );
        list
    }
}

/// Vertices, triangles and the report of what was done to them.
type Cleaned = (Vec<DVec3>, Vec<[u32; 3]>, HygieneReport);

/// Runs the pipeline; see the module documentation.
pub(crate) fn run(
    name: &str,
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    options: &HygieneOptions,
) -> Result<Cleaned, MeshError> {
    check_options(name, options)?;
    check_input(name, &vertices, &triangles)?;
    let (input_vertices, input_triangles) = (vertices.len(), triangles.len());

    // A stray vertex that no face uses must not coarsen the weld.
    let used = triangles.iter().flatten().map(|&v| vertices[v as usize]);
    let diagonal = Aabb::around(used).diagonal();
    let weld_distance = options.weld_tolerance * diagonal;
    let welded = weld::weld(&vertices, weld_distance);
    let mut triangles: Vec<_> = triangles
        .iter()
        .map(|t| t.map(|v| welded.representative[v as usize]))
        .collect();

    let (mut zero_area_faces, mut duplicate_faces, mut stitched_edges) = (0, 0, 0);
    // A corner on a line where faces meet cuts about one side. In a knot of faces hardly larger than
    // the weld distance cuts can open sides to cut, in numbers that grow exponentially.
    let mut budget = 3 * triangles.len();
    // Cutting faces can repeat one that exists; dropping that one can open an edge.
    loop {
        zero_area_faces += faces::drop_zero_area(&vertices, &mut triangles, diagonal);
        duplicate_faces += faces::drop_duplicates(&mut triangles);
        let cut = stitch::stitch(&vertices, &mut triangles, weld_distance, &mut budget);
        stitched_edges += cut;
        if cut == 0 {
            break;
        }
    }
    if triangles.is_empty() {
        return Err(MeshError::Empty {
            part: name.to_owned(),
            vertices: input_vertices,
            triangles: input_triangles,
            zero_area: zero_area_faces,
            duplicates: duplicate_faces,
        });
    }

    let oriented = orient::orient(&vertices, triangles);
    let components = oriented.components;
    let (vertices, triangles) = compact(&vertices, oriented.triangles);

    let edges = edges::Edges::of(&triangles);
    let area: f64 = triangles
        .iter()
        .map(|t| face_area(t.map(|v| vertices[v as usize])))
        .sum();
    let missing = holes::missing_area(&vertices, &edges.boundary());
    let report = HygieneReport {
        name: name.to_owned(),
        input_vertices,
        input_triangles,
        vertices: vertices.len(),
        triangles: triangles.len(),
        welded_vertices: welded.merged,
        unused_vertices: input_vertices - welded.merged - vertices.len(),
        weld_distance,
        zero_area_faces,
        duplicate_faces,
        stitched_edges,
        flipped_faces: components.iter().map(|c| c.flipped_faces).sum(),
        components: components.len(),
        cavities: components.iter().filter(|c| c.cavity).count(),
        overlapping_components: components.iter().filter(|c| c.overlaps).count(),
        per_component: components,
        open_edges: edges.count(|faces| faces.len() == 1),
        nonmanifold_edges: edges.count(|faces| faces.len() > 2),
        inconsistent_edges: edges.count(edges::inconsistent),
        watertight: edges.count(|faces| edges::net_uses(faces) != 0) == 0,
        open_area_fraction: missing / (missing + area),
        volume: volume(&vertices, &triangles),
        area,
        bounds: Aabb::around(vertices.iter().copied()),
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

fn check_options(name: &str, options: &HygieneOptions) -> Result<(), MeshError> {
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
fn compact(vertices: &[DVec3], mut triangles: Vec<[u32; 3]>) -> (Vec<DVec3>, Vec<[u32; 3]>) {
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
