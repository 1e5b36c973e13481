//! What the fuzz targets share. Each takes arbitrary bytes; a panic, a hang, an overflow or a
//! value that breaks a promise of the library is a finding, an error is not.

#[cfg(feature = "programs")]
mod programs;

use glam::DVec3;
#[cfg(feature = "programs")]
pub use programs::{hid, replay, table};
use sdf_grid::mesh_io::{MeshFile, MeshFormat, ReadOptions};
use sdf_grid::{
    Bvh, DensityField, DensityKernel, DensityOptions, Lattice, LengthUnit, RepairOptions, Silent,
    TriangleMesh, signed_distances,
};

/// Parses and cleans a mesh file, and checks what comes out.
pub fn mesh(format: MeshFormat, bytes: &[u8]) {
    let Ok(file) = MeshFile::parse("fuzz", bytes, format, None) else {
        return;
    };
    let solids = file.solids();
    let mut options = ReadOptions {
        unit: LengthUnit::M,
        // What is refused by its name is no fault of what is read.
        lossy: true,
        ..ReadOptions::default()
    };
    options.repair.max_open_fraction = 1.0;
    if !solids.is_empty() {
        options.solid = Some(solids.len().to_string());
        let _ = file.clean(&options);
        options.solid = None;
    }
    if let Ok((mesh, _)) = file.clean(&options) {
        check(&mesh, options.repair.weld_tolerance);
    }
}

/// What repair promises of a mesh: every number finite, every index valid, every face with an
/// area, and a mesh that the same tolerance accepts a second time.
fn check(mesh: &TriangleMesh, weld_tolerance: f64) {
    assert!(!mesh.triangles().is_empty());
    assert!(mesh.vertices().iter().all(|v| v.is_finite()));
    assert!(mesh.volume().is_finite() && mesh.centroid().is_finite());
    assert!(mesh.area() > 0.0);
    let count = mesh.vertices().len() as u32;
    assert!(mesh.triangles().iter().flatten().all(|&v| v < count));
    let options = RepairOptions {
        max_open_fraction: 1.0,
        weld_tolerance,
    };
    let (vertices, triangles) = (mesh.vertices().to_vec(), mesh.triangles().to_vec());
    let again = TriangleMesh::clean("again", vertices, triangles, &options);
    assert!(again.is_ok(), "a clean mesh is refused");
}

/// Repair of vertices of any bits and triangles of any indices.
pub fn repair(bytes: &[u8]) {
    let Some((&[flags, count], rest)) = bytes.split_first_chunk() else {
        return;
    };
    let take = usize::from(count).min(rest.len() / 6);
    let (positions, indices) = rest.split_at(6 * take);
    // Coordinates on a coarse grid meet one another often; others are halves of any bits.
    let vertices: Vec<DVec3> = positions
        .as_chunks::<6>()
        .0
        .iter()
        .map(|c| {
            let number = |i: usize| match flags & 1 {
                0 => f64::from(i16::from_le_bytes([c[i], c[i + 1]]) % 5),
                _ => f64::from(f32::from_bits(u32::from_le_bytes([0, 0, c[i], c[i + 1]]))),
            };
            DVec3::new(number(0), number(2), number(4))
        })
        .collect();
    let wide = u32::from(count) + u32::from(flags & 2);
    let triangles = indices
        .as_chunks::<3>()
        .0
        .iter()
        .map(|t| t.map(|i| u32::from(i) % wide.max(1)))
        .collect();
    let options = RepairOptions {
        max_open_fraction: 1.0,
        weld_tolerance: [1e-6, 0.0, 1e-2, 1e-3][usize::from(flags >> 2 & 3)],
    };
    if let Ok((mesh, report)) = TriangleMesh::clean("fuzz", vertices, triangles, &options) {
        assert!(report.area.is_finite() && report.volume.is_finite());
        check(&mesh, options.weld_tolerance);
    }
}

/// The density field of small meshes with many coplanar, touching and overlapping triangles: merging
/// them must neither fail nor move the boundary.
pub fn field(bytes: &[u8]) {
    let Some((&[flags, count], rest)) = bytes.split_first_chunk() else {
        return;
    };
    let take = usize::from(count).min(rest.len() / 6);
    let (positions, indices) = rest.split_at(3 * take);
    let grid = [3, 5, 17, 255][usize::from(flags & 3)];
    let place = |p: &[u8; 3]| DVec3::from_array(p.map(|c| f64::from(c % grid)));
    let vertices: Vec<DVec3> = positions.as_chunks::<3>().0.iter().map(place).collect();
    let wide = vertices.len().max(1) as u32;
    let triangles = indices.as_chunks::<3>().0.iter();
    let triangles = triangles.map(|t| t.map(|i| u32::from(i) % wide)).collect();
    let options = RepairOptions {
        max_open_fraction: 1.0,
        ..RepairOptions::default()
    };
    let Ok((mesh, _)) = TriangleMesh::clean("fuzz", vertices, triangles, &options) else {
        return;
    };
    let (low, size) = (mesh.bounds().min, mesh.bounds().size().max_element());
    let lattice = Lattice::new(low - 0.21 * size, 0.31 * size, [5; 3]).expect("a lattice");
    let distances = signed_distances(&mesh, &lattice, &Silent).expect("distances");
    let bvh = Bvh::build(&mesh);
    for ((x, y, z), distance) in distances.indexed_iter() {
        let nearest = bvh.nearest(lattice.position([x, y, z])).distance;
        let found = f64::from(distance.abs());
        assert!((found - nearest).abs() <= 1e-6 * size, "{found} {nearest}");
    }
    // The kernel's tables take most of the time of a small field.
    if flags & 0xf0 == 0 {
        let kernel = DensityKernel::new(0.1).expect("a kernel");
        let field = DensityField::compute(
            &mesh,
            &kernel,
            &lattice,
            &DensityOptions::default(),
            &Silent,
        )
        .expect("a field of a clean mesh");
        let mut values = field.exterior.iter().chain(&field.interior);
        assert!(values.all(|z| z.is_finite()));
    }
}

/// A 3MF archive, not compressed, whose model is `model`.
pub fn stored_3mf(model: &[u8]) -> Vec<u8> {
    let rels: &[u8] = br#"<Relationships><Relationship Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let stored =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, bytes) in [("_rels/.rels", rels), ("3D/3dmodel.model", model)] {
        writer.start_file(name, stored).expect("a name");
        std::io::Write::write_all(&mut writer, bytes).expect("memory");
    }
    writer.finish().expect("memory").into_inner()
}
