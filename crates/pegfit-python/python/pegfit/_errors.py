"""Exceptions, each with its evidence; and counts, refused by name where the compiled half could not
even take them."""

from __future__ import annotations

import operator
from typing import Any, Optional


class PegfitError(Exception):
    """Anything that pegfit refuses or cannot do.

    Attributes:
        file: The file or part that it is about, if there is one.
        item: What in it: a key, an argument, a row.
        expected: What would have been accepted.
        found: What was there.

    >>> from pegfit import Mesh
    >>> try:
    ...     Mesh([[0, 0, 0]], [[0, 0, 0]], name="point")
    ... except PegfitError as error:
    ...     print(type(error).__name__, error.file, error.item)
    MeshError point unit
    """

    def __init__(
        self,
        message: str,
        *,
        file: Optional[str] = None,
        item: Optional[str] = None,
        expected: Optional[str] = None,
        found: Optional[str] = None,
    ) -> None:
        super().__init__(message)
        self.file = file
        self.item = item
        self.expected = expected
        self.found = found


class MeshError(PegfitError):
    """A mesh cannot be read or used."""


class SceneError(PegfitError):
    """A scene, a pair, or what is asked of it, cannot be used."""


class PoseError(PegfitError, ValueError):
    """Poses or rotations are of the wrong shape, not finite or not rotations."""


class TableError(PegfitError, OSError):
    """A table cannot be baked, opened or read, or was closed."""


class DeviceError(PegfitError):
    """The haptic loop cannot run as asked."""


_MOST = 2**63 - 1


def count(
    value: Any, item: str, error: type[PegfitError] = PegfitError, most: int = _MOST
) -> int:
    """The value if it is a whole number from 1 to `most`; `error` if not."""
    try:
        found = operator.index(value)
    except TypeError:
        found = 0
    if not 0 < found <= most:
        expected = "a positive whole number" if most == _MOST else f"1 to {most}"
        message = f"{item}: expected {expected}, found {value!r}"
        raise error(message, item=item, expected=expected, found=repr(value))
    return found


def count_or_none(
    value: Any, item: str, error: type[PegfitError] = PegfitError
) -> Optional[int]:
    """The same, or `None` for what is to be chosen."""
    return None if value is None else count(value, item, error)
