//! Poses as rows of numbers.

use fft_correlate::Pose;
use glam::{DMat3, DQuat, DVec3};
use ndarray::{Array2, ArrayView2};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::failure::{Failure, Kind};

/// Quaternions this close to unit length, and matrices this close to rotations, are taken for
/// rounded ones.
const SLACK: f64 = 1e-3;

/// A row `x y z qx qy qz qw`; `place` is said in the failure.
pub(crate) fn pose(row: &[f64; 7], place: usize) -> Result<Pose, Failure> {
    let [x, y, z, qx, qy, qz, qw] = *row;
    let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
    let translation = DVec3::new(x, y, z);
    let length = rotation.length();
    // Written so that NaN is refused.
    let unit = (length - 1.0).abs() <= SLACK;
    if unit && translation.is_finite() {
        return Ok(Pose {
            rotation: rotation / length,
            translation,
        });
    }
    let expected = match translation.is_finite() {
        true => "a quaternion x, y, z, w of length 1",
        false => "finite numbers",
    };
    let item = format!("pose {place}");
    Err(Failure::found(
        Kind::Pose,
        item,
        expected,
        format!("{row:?}"),
    ))
}

/// A pose as such a row.
pub(crate) fn row(pose: &Pose) -> [f64; 7] {
    let ([x, y, z], [qx, qy, qz, qw]) = (pose.translation.to_array(), pose.rotation.to_array());
    [x, y, z, qx, qy, qz, qw]
}

/// Rows of numbers as an array.
pub(crate) fn array<const N: usize>(rows: impl ExactSizeIterator<Item = [f64; N]>) -> Array2<f64> {
    let mut array = Array2::zeros((rows.len(), N));
    for (mut to, from) in array.rows_mut().into_iter().zip(rows) {
        to.as_slice_mut()
            .into_iter()
            .for_each(|to| to.copy_from_slice(&from));
    }
    array
}

/// A unit quaternion `x y z w`.
pub(crate) fn quaternion([x, y, z, w]: [f64; 4]) -> Result<DQuat, Failure> {
    Ok(pose(&[0.0, 0.0, 0.0, x, y, z, w], 0)?.rotation)
}

/// Homogeneous matrices (n, 4, 4) as rows of poses (n, 7).
#[pyfunction]
pub(crate) fn from_matrices<'py>(
    py: Python<'py>,
    matrices: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let matrices = matrices.as_array();
    let mut rows = Vec::with_capacity(matrices.shape()[0]);
    for (place, matrix) in matrices.outer_iter().enumerate() {
        rows.push(row(&of_matrix(matrix, place)?));
    }
    Ok(array(rows.into_iter()).into_pyarray(py))
}

fn of_matrix(m: ArrayView2<'_, f64>, place: usize) -> Result<Pose, Failure> {
    let column = |j: usize| DVec3::new(m[[0, j]], m[[1, j]], m[[2, j]]);
    let turn = DMat3::from_cols(column(0), column(1), column(2));
    let off = turn.transpose() * turn - DMat3::IDENTITY;
    let straight = off.to_cols_array().iter().all(|v| v.abs() <= SLACK);
    let last = [m[[3, 0]], m[[3, 1]], m[[3, 2]], m[[3, 3]] - 1.0];
    let affine = last.iter().all(|v| v.abs() <= 1e-9);
    if !(straight && affine && turn.determinant() > 0.0) {
        let expected = "a rotation and a translation, last row 0 0 0 1";
        let item = format!("matrix {place}");
        return Err(Failure::found(Kind::Pose, item, expected, format!("{m}")));
    }
    let [x, y, z] = column(3).to_array();
    let [qx, qy, qz, qw] = DQuat::from_mat3(&turn).normalize().to_array();
    pose(&[x, y, z, qx, qy, qz, qw], place)
}
