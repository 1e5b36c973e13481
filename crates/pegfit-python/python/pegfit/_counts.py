"""Counts and sizes, refused by name where the compiled half could not even take them."""

from __future__ import annotations

import operator
from typing import Any, Optional

from pegfit._errors import PegfitError

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
