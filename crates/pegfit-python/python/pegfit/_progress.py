"""Progress of long calls."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Any, Callable, Optional, Union

#: `True` for a bar on standard error (tqdm's where it is installed), or a function that is called
#: with the number of units done and their total, stage by stage.
Progress = Union[None, bool, Callable[[int, int], object]]

Report = Callable[[str, int, int], object]


class Bar:
    """A bar per stage: tqdm's where it is installed, else a line that is written again."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            tqdm = None
        self._make: Any = tqdm
        self._bar: Any = None
        self._stage = ""

    def __call__(self, stage: str, done: int, total: int) -> None:
        if self._make is None:
            ending = "\n" if done >= total else ""
            print(f"\r{stage}: {done} of {total}", end=ending, file=sys.stderr, flush=True)
            return
        if stage != self._stage or self._bar is None:
            self.close()
            self._stage, self._bar = stage, self._make(total=total, desc=stage, leave=False)
        self._bar.n = done
        self._bar.refresh()

    def close(self) -> None:
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


class Reporting:
    """What the compiled half calls while a `with` lasts; `None` if nobody wants to know."""

    def __init__(self, progress: Progress) -> None:
        self._bar: Optional[Bar] = Bar() if progress is True else None
        self._report: Optional[Report] = self._bar
        if callable(progress):
            given = progress
            self._report = lambda _stage, done, total: given(done, total)

    def __enter__(self) -> Optional[Report]:
        return self._report

    def __exit__(
        self,
        kind: Optional[type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        if self._bar is not None:
            self._bar.close()
