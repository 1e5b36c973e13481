//! Options and report of the repair of a mesh.

use serde::{Deserialize, Serialize};

use crate::mesh::aabb::Aabb;

/// Options of the repair of a mesh: its tolerances.
///
/// See the example of [`RepairReport`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RepairOptions {
    /// Vertices closer than this fraction of the diagonal of the bounds become one, 0 .. 0.01;
    /// 0 welds only equal positions.
    pub weld_tolerance: f64,
    /// The largest [`RepairReport::open_area_fraction`] accepted, 0 .. 1.
    pub max_open_fraction: f64,
}

impl Default for RepairOptions {
    /// Weld at 1e-6 of the diagonal (finer than any tessellation, coarser than single precision),
    /// refuse above 10 % of open area.
    fn default() -> Self {
        Self {
            weld_tolerance: 1e-6,
            max_open_fraction: 0.1,
        }
    }
}

/// Findings and changes in one component of the surface.
///
/// See the example of [`RepairReport`].
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
}

/// Findings and changes of the repair of a mesh.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{RepairOptions, TriangleMesh, shapes};
///
/// // A cube, one face of which is the wrong way round.
/// let cube = shapes::cuboid(DVec3::splat(0.01))?;
/// let mut triangles = cube.triangles().to_vec();
/// triangles[0].swap(1, 2);
/// let vertices = cube.vertices().to_vec();
/// let options = RepairOptions::default();
/// let (_, report) = TriangleMesh::clean("cube", vertices, triangles, &options)?;
/// assert!(report.watertight && report.flipped_faces == 1);
/// assert!((report.per_component[0].volume - 1e-6).abs() < 1e-15);
/// assert_eq!(report.warnings().len(), 1);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepairReport {
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
    /// Components of the input that touched, cut through or coincided with others: the surface of
    /// their union took their place.
    pub united_components: usize,
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

impl RepairReport {
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
            self.united_components,
            "components touched, cut through or coincided with others: united",
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
