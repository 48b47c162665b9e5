"""The driving of a study: in the caller, or in a thread beside it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from lie_codegen.door import on_behalf
from lie_codegen.studies.progress import bar


class Work:
    """The driving of a study, here or in a thread beside."""

    def __init__(
        self, drive: Callable[[Callable[[int, int], None]], None], lock: AbstractContextManager[Any], progress: Any
    ) -> None:
        self._drive, self._lock, self._progress = drive, lock, progress
        self._thread: threading.Thread | None = None
        self._error: BaseException | None = None

    def here(self) -> None:
        """Until it ends; Ctrl-C leaves a store to go on with."""
        with self._lock, bar(self._progress) as tell:
            self._drive(tell)

    def beside(self) -> None:
        """Returns at once."""
        self._thread = threading.Thread(target=on_behalf(self._caught), daemon=True)
        self._thread.start()

    def _caught(self) -> None:
        try:
            self.here()
        except BaseException as error:
            self._error = error

    def wait(self, timeout: float | None) -> None:
        """Until it ends; raises what ended it."""
        if self._thread is not None:
            self._thread.join(timeout)
            if self._error is not None:
                raise self._error
