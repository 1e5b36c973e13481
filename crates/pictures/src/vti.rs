//! Density fields as VTK image files, for ParaView: XML with the values appended as they are.

use std::io::Write;
use std::path::Path;

use ndarray::Array3;
use num_complex::Complex32;
use sdf_grid::DensityField;
use sdf_grid::atomic::{self, AtomicError};

/// Writes `exterior` and `interior` (real, imaginary) and `signed_distance` (metres) as point data
/// of an image whose origin and spacing are metres.
///
/// # Errors
/// If the file cannot be written.
pub fn write_vti(path: &Path, field: &DensityField) -> Result<(), AtomicError> {
    atomic::write_with(path, |out| {
        write_to(out, field).map_err(|source| AtomicError {
            path: path.to_owned(),
            source,
        })
    })
}

/// Of each point: a name, how many numbers, and all of them.
type Values<'a> = (&'static str, usize, Box<dyn Iterator<Item = f32> + 'a>);

fn write_to(out: &mut dyn Write, field: &DensityField) -> std::io::Result<()> {
    let lattice = field.lattice();
    let points = lattice.len() as u64;
    let arrays: [Values<'_>; 3] = [
        ("exterior", 2, Box::new(components(&field.exterior))),
        ("interior", 2, Box::new(components(&field.interior))),
        (
            "signed_distance",
            1,
            Box::new(x_fastest(&field.signed_distance).copied()),
        ),
    ];
    let [x, y, z] = lattice.shape().map(|n| n - 1);
    let extent = format!("0 {x} 0 {y} 0 {z}");
    let origin = lattice.origin();
    let spacing = lattice.spacing();
    writeln!(
        out,
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\">\n\
         <ImageData WholeExtent=\"{extent}\" Origin=\"{} {} {}\" \
         Spacing=\"{spacing} {spacing} {spacing}\">\n\
         <Piece Extent=\"{extent}\">\n<PointData>",
        origin.x, origin.y, origin.z
    )?;
    let mut offset = 0;
    for (name, components, _) in &arrays {
        writeln!(
            out,
            "<DataArray type=\"Float32\" Name=\"{name}\" NumberOfComponents=\"{components}\" \
             format=\"appended\" offset=\"{offset}\"/>"
        )?;
        offset += size_of::<u64>() as u64 + bytes(points, *components);
    }
    // The data begin behind the underscore.
    write!(
        out,
        "</PointData>\n<CellData/>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_"
    )?;
    for (_, components, values) in arrays {
        out.write_all(&bytes(points, components).to_le_bytes())?;
        for value in values {
            out.write_all(&value.to_le_bytes())?;
        }
    }
    writeln!(out, "\n</AppendedData>\n</VTKFile>")
}

fn bytes(points: u64, components: usize) -> u64 {
    points * components as u64 * size_of::<f32>() as u64
}

/// VTK counts points with x fastest; our arrays count z fastest.
fn x_fastest<T>(values: &Array3<T>) -> impl Iterator<Item = &T> {
    values.view().reversed_axes().into_iter()
}

fn components(values: &Array3<Complex32>) -> impl Iterator<Item = f32> {
    x_fastest(values).flat_map(|v| [v.re, v.im])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use sdf_grid::{FIELD_VERSION, FieldProvenance, Lattice, Sampling};

    fn field() -> DensityField {
        let place = |(i, j, k): (usize, usize, usize)| (100 * i + 10 * j + k) as f32;
        DensityField {
            exterior: Array3::from_shape_fn([2, 3, 4], |p| Complex32::new(place(p), 1.0)),
            interior: Array3::zeros([2, 3, 4]),
            signed_distance: Array3::from_shape_fn([2, 3, 4], place),
            provenance: FieldProvenance {
                version: FIELD_VERSION,
                mesh: String::new(),
                sigma: 0.1,
                halo: 1.0,
                tolerance: 1e-3,
                sampling: Sampling::Point,
                lattice: Lattice::new(DVec3::new(0.1, 0.2, 0.3), 0.5, [2, 3, 4]).unwrap(),
            },
        }
    }

    /// The value of an attribute of the first element that `mark` stands in.
    fn attribute<'a>(text: &'a str, mark: &str, name: &str) -> &'a str {
        let element = text.split('<').find(|e| e.contains(mark)).unwrap();
        let (_, rest) = element.split_once(&format!(" {name}=\"")).unwrap();
        rest.split_once('"').unwrap().0
    }

    #[test]
    fn a_field_reads_back_in_vtk_order() {
        let mut file = Vec::new();
        write_to(&mut file, &field()).unwrap();
        let mark = b"<AppendedData encoding=\"raw\">\n_";
        let end = b"\n</AppendedData>\n</VTKFile>\n";
        let at = file.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len();
        let (head, data) = (std::str::from_utf8(&file[..at]).unwrap(), &file[at..]);
        assert!(data.ends_with(end));
        assert_eq!(attribute(head, "VTKFile", "byte_order"), "LittleEndian");
        assert_eq!(attribute(head, "VTKFile", "header_type"), "UInt64");
        assert_eq!(attribute(head, "ImageData W", "WholeExtent"), "0 1 0 2 0 3");
        assert_eq!(attribute(head, "Piece", "Extent"), "0 1 0 2 0 3");
        assert_eq!(attribute(head, "ImageData W", "Origin"), "0.1 0.2 0.3");
        assert_eq!(attribute(head, "ImageData W", "Spacing"), "0.5 0.5 0.5");
        let mut next = 0;
        let mut values = |name: &str, components: usize| -> Vec<f32> {
            let named = format!("\"{name}\"");
            let count = attribute(head, &named, "NumberOfComponents");
            assert_eq!(count.parse(), Ok(components));
            let offset: usize = attribute(head, &named, "offset").parse().unwrap();
            assert_eq!(offset, next);
            let (size, rest) = data[offset..].split_at(8);
            let size = u64::from_le_bytes(size.try_into().unwrap()) as usize;
            assert_eq!(size, 4 * 24 * components);
            next = offset + 8 + size;
            let (numbers, _) = rest[..size].as_chunks();
            numbers.iter().map(|b| f32::from_le_bytes(*b)).collect()
        };
        let exterior = values("exterior", 2);
        assert_eq!(exterior[2..4], [100.0, 1.0]);
        assert!(values("interior", 2).iter().all(|v| *v == 0.0));
        let distance = values("signed_distance", 1);
        assert_eq!(distance[..3], [0.0, 100.0, 10.0]);
        assert_eq!(distance[23], 123.0);
        assert_eq!(data.len(), next + end.len());
    }
}
