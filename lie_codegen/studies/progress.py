"""The progress of a study: a bar with the time left, in a terminal or a notebook."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lie_codegen.errors import InputError

Tell = Callable[[int, int], None]


@contextmanager
def bar(progress: bool | Tell | None) -> Iterator[Tell]:
    """A function of (samples done, samples) that shows them.

    Args:
        progress: True, False, a function of one's own, or None: shown where somebody watches.
    """
    if progress is not None and not isinstance(progress, bool):
        if not callable(progress):
            raise InputError(f"study: progress is True, False or a function of (done, samples), given {progress!r:.60}")
        yield progress
        return
    watched = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    if progress is False or (progress is None and not watched):
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    # plain text in a notebook too: the widget that rich would show there needs another package, and stays in the page afterwards
    console = Console(stderr=True, force_jupyter=False)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as shown:
        task = shown.add_task("study", total=None)
        yield lambda done, total: shown.update(task, completed=done, total=total)
