"""Poses in whatever form they come."""

from __future__ import annotations

from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pegfit import _core
from pegfit._errors import PoseError

#: Poses of the moving part in the fixed part's frame (or the scene's), metres, as one of
#:
#: - an array `(n, 7)` of rows `x y z qx qy qz qw`,
#: - an array `(n, 4, 4)` of homogeneous matrices,
#: - a pair of translations `(n, 3)` and a `scipy.spatial.transform.Rotation` of as many, or of one.
PosesLike = Union[ArrayLike, tuple[ArrayLike, Any]]

#: A rotation as a quaternion `x y z w`, a matrix `(3, 3)` or a `scipy` `Rotation`.
RotationLike = Union[ArrayLike, Any]

Float = NDArray[np.float64]


def _numbers(values: Any, item: str) -> Float:
    try:
        return np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        expected = "an array of numbers"
        message = f"{item}: expected {expected}, found {error}"
        raise PoseError(message, item=item, expected=expected, found=str(error)) from None


def _refuse(item: str, expected: str, found: str) -> PoseError:
    message = f"{item}: expected {expected}, found {found}"
    return PoseError(message, item=item, expected=expected, found=found)


def _joined(translations: ArrayLike, rotation: Any) -> Float:
    at = _numbers(translations, "translations")
    turned = _numbers(rotation.as_quat(), "rotations")
    if at.ndim != 2 or at.shape[1] != 3 or turned.shape not in [(4,), (1, 4), (len(at), 4)]:
        found = f"{at.shape} and {turned.shape}"
        raise _refuse("poses", "translations (n, 3) and n rotations, or one", found)
    rows = np.empty((len(at), 7))
    rows[:, :3] = at
    rows[:, 3:] = turned
    return rows


def rows(poses: PosesLike) -> Float:
    """The poses as a contiguous array `(n, 7)`; the same array if it is one already."""
    if isinstance(poses, tuple) and len(poses) == 2 and hasattr(poses[1], "as_quat"):
        return _joined(*poses)
    array = _numbers(poses, "poses")
    if array.ndim == 2 and array.shape[1] == 7:
        return array
    if array.ndim == 3 and array.shape[1:] == (4, 4):
        return _core.from_matrices(array)
    expected = "(n, 7), (n, 4, 4), or translations and a Rotation"
    raise _refuse("poses", expected, f"an array of shape {array.shape}")


def quaternion(rotation: RotationLike) -> Float:
    """The rotation as `x y z w`."""
    if hasattr(rotation, "as_quat"):
        rotation = rotation.as_quat()
    array = _numbers(rotation, "rotation")
    if array.shape == (3, 3):
        matrix = np.eye(4)
        matrix[:3, :3] = array
        return _core.from_matrices(matrix[None])[0, 3:]
    if array.shape == (4,):
        return array
    raise _refuse("rotation", "x y z w, a matrix (3, 3) or a Rotation", f"shape {array.shape}")


def three(values: ArrayLike, item: str) -> Float:
    """One number for all axes, or one for each of x, y, z."""
    array = _numbers(np.atleast_1d(values), item)
    if array.shape not in [(1,), (3,)]:
        raise _refuse(item, "one number or three", f"an array of shape {array.shape}")
    return np.array(np.broadcast_to(array, 3))
