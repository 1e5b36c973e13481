//! Density fields as VTK image files, for ParaView.

use std::path::Path;

use ndarray::Array3;
use num_complex::Complex32;
use sdf_grid::DensityField;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, DataSet, Extent, ImageDataPiece, Piece, Version, Vtk,
};

use crate::error::CommandError;
use crate::report::atomic;

/// Writes `exterior` and `interior` (real, imaginary) and `signed_distance` (metres) as point data
/// of an image whose origin and spacing are metres.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write(path: &Path, field: &DensityField) -> Result<(), CommandError> {
    let document = document(field);
    atomic::write_with(path, |out| {
        document
            .write_xml(out)
            .map_err(|e| CommandError::failure(format!("writing {}", path.display()), e))
    })
}

fn document(field: &DensityField) -> Vtk {
    let lattice = &field.lattice;
    let extent = Extent::Ranges(lattice.shape().map(|n| 0..=n as i32 - 1));
    let spacing = lattice.spacing() as f32;
    let data = Attributes {
        point: vec![
            Attribute::scalars("exterior", 2).with_data(components(&field.exterior)),
            Attribute::scalars("interior", 2).with_data(components(&field.interior)),
            Attribute::scalars("signed_distance", 1).with_data(
                x_fastest(&field.signed_distance)
                    .copied()
                    .collect::<Vec<f32>>(),
            ),
        ],
        cell: Vec::new(),
    };
    Vtk {
        version: Version::new((1, 0)),
        title: String::new(),
        byte_order: ByteOrder::LittleEndian,
        file_path: None,
        data: DataSet::ImageData {
            extent: extent.clone(),
            origin: lattice.origin().as_vec3().to_array(),
            spacing: [spacing; 3],
            meta: None,
            pieces: vec![Piece::Inline(Box::new(ImageDataPiece { extent, data }))],
        },
    }
}

/// VTK counts points with x fastest; our arrays count z fastest.
fn x_fastest<T>(values: &Array3<T>) -> impl Iterator<Item = &T> {
    values.view().reversed_axes().into_iter()
}

fn components(values: &Array3<Complex32>) -> Vec<f32> {
    x_fastest(values).flat_map(|v| [v.re, v.im]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use sdf_grid::{Lattice, Sampling};

    #[test]
    fn a_field_reads_back_in_vtk_order() {
        let lattice = Lattice::new(DVec3::new(0.1, 0.2, 0.3), 0.5, [2, 3, 4]).unwrap();
        let place = |(i, j, k): (usize, usize, usize)| (100 * i + 10 * j + k) as f32;
        let field = DensityField {
            lattice,
            exterior: Array3::from_shape_fn([2, 3, 4], |p| Complex32::new(place(p), 1.0)),
            interior: Array3::zeros([2, 3, 4]),
            signed_distance: Array3::from_shape_fn([2, 3, 4], place),
            sigma: 0.1,
            halo: 1.0,
            sampling: Sampling::Point,
            mesh_hash: [0; 32],
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.vti");
        write(&path, &field).unwrap();
        let back = Vtk::import(&path).unwrap();
        let DataSet::ImageData {
            origin,
            spacing,
            pieces,
            ..
        } = back.data
        else {
            panic!("not an image")
        };
        assert_eq!(origin, [0.1, 0.2, 0.3]);
        assert_eq!(spacing, [0.5; 3]);
        let piece = pieces[0].load_piece_data(None).unwrap();
        let values = |name: &str| match piece.data.point.iter().find(|a| a.name() == name).unwrap()
        {
            Attribute::DataArray(array) => array.data.clone().cast_into::<f32>().unwrap(),
            Attribute::Field { .. } => panic!("not an array"),
        };
        let distance = values("signed_distance");
        assert_eq!(distance.len(), 24);
        assert_eq!(distance[..3], [0.0, 100.0, 10.0]);
        assert_eq!(distance[23], 123.0);
        assert_eq!(values("exterior")[2..4], [100.0, 1.0]);
    }
}
