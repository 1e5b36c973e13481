"""The loop on a page, in a notebook or a browser of its own."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import weakref
from os import PathLike, fspath
from pathlib import Path
from typing import Optional, Union

from pegfit._errors import PegfitError
from pegfit._pair import Pair

_COMMAND = "import sys; from pegfit._command import main; sys.argv[0] = 'pegfit'; main()"

#: Seconds that a program gets to stop its hand.
_PATIENCE = 10


def _stop(child: subprocess.Popen[str], folder: tempfile.TemporaryDirectory[str]) -> None:
    if child.poll() is None:
        child.send_signal(signal.SIGTERM if sys.platform == "win32" else signal.SIGINT)
        try:
            child.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
    if child.stdout:
        child.stdout.close()
    folder.cleanup()


class Page:
    """A page with the 1 kHz loop behind it; a notebook shows it as it is.

    It lives until `close`, the end of a `with` block, or until nobody refers to it any more.

    Attributes:
        url: Its address on this machine; whoever has it may come in.
        height: Of the frame in a notebook, pixels.
    """

    def __init__(
        self, child: subprocess.Popen[str], folder: tempfile.TemporaryDirectory[str], height: int
    ) -> None:
        line = child.stdout.readline() if child.stdout else ""
        if not line:
            child.wait()
            said = child.stderr.read() if child.stderr else ""
            _stop(child, folder)
            raise PegfitError(said.strip() or "pegfit play ended without a page")
        self.url: str = json.loads(line)["url"]
        self.height = height
        self._end = weakref.finalize(self, _stop, child, folder)

    def close(self) -> None:
        """Ends the loop; its hand lets go."""
        self._end()

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Page at {self.url}" if self._end.alive else "Page, closed"

    def _repr_html_(self) -> str:
        if not self._end.alive:
            return "<p>This page is closed.</p>"
        style = f"width: 100%; height: {int(self.height)}px; border: 1px solid #e2e8f0"
        return f'<iframe src="{self.url}" style="{style}" title="pegfit play"></iframe>'


def play(
    pair: Union[Pair, str, PathLike[str], None] = None,
    *,
    table: Union[str, PathLike[str], None] = None,
    open: bool = False,
    height: int = 640,
) -> Page:
    """The loop on a page (`docs/play.md`): a mouse holds the moving part and sees what it feels.

    Args:
        pair: A pair, or a scene file; the paper's three pairs if `None`.
        table: A table of it, interpolated instead of evaluating directly.
        open: Also open it in a browser of its own.
        height: Of the frame in a notebook, pixels.

    Raises:
        PegfitError: The page cannot be served, with the command's own words.

    >>> with play() as page:
    ...     page.url.startswith("http://127.0.0.1:")
    True
    >>> page
    Page, closed
    """
    # Deleted with the page.
    folder = tempfile.TemporaryDirectory(prefix="pegfit-play-")
    words = ["play", "--json", "--quiet", "--embed"]
    if not open:
        words.append("--no-open")
    if isinstance(pair, Pair):
        words.append(str(pair._write_scene(Path(folder.name))))
    elif pair is not None:
        words.append(fspath(pair))
    if table is not None:
        words += ["--table", fspath(table)]
    child = subprocess.Popen(
        [sys.executable, "-c", _COMMAND, *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    return Page(child, folder, height)
