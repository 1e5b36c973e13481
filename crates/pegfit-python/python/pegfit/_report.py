"""Files that runs and paths are written to, one kind per ending."""

from __future__ import annotations

import os
from os import PathLike
from typing import Callable, Union

from pegfit import _core
from pegfit._errors import PegfitError


def write_report(
    path: Union[str, PathLike[str]],
    *,
    page: Callable[[], str],
    table: Callable[[], str],
    summary: Callable[[], str],
) -> None:
    """Writes what the ending chooses: `.html` the page, `.csv` the table, `.json` the summary."""
    contents = {".html": page, ".csv": table, ".json": summary}
    content = contents.get(os.path.splitext(path)[1].lower())
    if content is None:
        expected, found = "a name that ends in .html, .csv or .json", repr(os.fspath(path))
        message = f"path: expected {expected}, found {found}"
        raise PegfitError(message, item="path", expected=expected, found=found)
    _core.write_text(path, content())
