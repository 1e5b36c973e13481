"""Packages that need not be there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def needed_by(caller: str, package: str, extra: str) -> Iterator[None]:
    """Around the import of an optional package: says who needs it and how to get it.

    Raises:
        ModuleNotFoundError: The package is missing. What it misses itself it says itself.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        install = f"pip install {package} (or pegfit with the extra [{extra}])"
        raise ModuleNotFoundError(f"{caller} needs {package}: {install}", name=package) from None
