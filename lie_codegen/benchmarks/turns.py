"""Tools that compute one thing each in a process of its own, told in turn to run: both ends of the pipe.

The child says in a line of JSON what it computed and how long the first call took, or why it cannot take part; then it runs as often as a
line on its stdin says and answers with the processor time of a call, that of all its threads.
"""

from __future__ import annotations

import base64
import json
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from typing import IO, Any, Protocol

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.rows import AbsentError

#: What a tool does when it is told to run, and what of it is compared: the second is not timed.
Call = Callable[[], Any]
Read = Callable[[Any], Array]
#: Rounds, the least that is timed at once, and when a tool is not asked again: seconds.
ROUNDS, _LEAST, _PATIENCE = 7, 2e-3, 2.0


class Case(Protocol):
    """What is computed: `python -m MODULE TOOL ARGUMENTS RTOL` runs a tool on it."""

    @property
    def name(self) -> str:
        """As it is printed."""

    @property
    def command(self) -> tuple[str, ...]:
        """Module and arguments."""

    def error(self, found: Array, ours: Array) -> float:
        """Against what is stored, and how far from ours where nothing is; infinity for another shape."""


class Tool:
    """A process that runs a case when it is told to.

    Attributes:
        name: of the tool.
        absent: why it takes no part, or "".
        found: what it computed.
        first: processor seconds of preparing and the first call.
        seconds: of a later call, the least of the rounds.
    """

    def __init__(self, name: str, case: Case, rtol: float) -> None:
        module, *arguments = case.command
        command = [sys.executable, "-m", module, name, *arguments, repr(rtol)]
        self.name = name
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self.seconds, self._spent = float("inf"), 0.0
        line = _pipe(self._process.stdout).readline()
        answer: dict[str, Any] = json.loads(line) if line else {"absent": "the process ended"}
        self.absent: str = answer.get("absent", "")
        self.found: Array = np.empty(0)
        if not self.absent:
            data = np.frombuffer(base64.b64decode(answer["data"]), dtype=complex)
            self.found = data.reshape(answer["shape"])
        self.first = float(answer.get("first", "nan"))

    def run(self) -> None:
        """One round, often enough to be measured; none where the tool has had its time."""
        if self._spent >= _PATIENCE:
            return
        count = 1 if not np.isfinite(self.seconds) else int(np.clip(_LEAST / self.seconds, 1, 200))
        _pipe(self._process.stdin).write(f"{count}\n")
        _pipe(self._process.stdin).flush()
        line = _pipe(self._process.stdout).readline()
        if line:
            seconds = float(json.loads(line)["seconds"])
            self.seconds, self._spent = min(self.seconds, seconds), self._spent + count * seconds

    def end(self) -> None:
        """No more rounds."""
        _pipe(self._process.stdin).close()
        self._process.wait()


def _pipe(pipe: IO[str] | None) -> IO[str]:
    if pipe is None:
        raise RuntimeError("a process without pipes")
    return pipe


def answer(prepare: Callable[[], tuple[Call, Read]]) -> None:
    """The child's end: prepare, say what was computed, then run whenever told to."""
    out = sys.stdout
    with redirect_stdout(sys.stderr):  # what a tool prints is no answer of ours
        start = time.process_time()
        try:
            call, read = prepare()
            result = call()
            first = time.process_time() - start
            found = np.ascontiguousarray(read(result), dtype=complex)
        except AbsentError as reason:
            _say(out, absent=str(reason))
            return
        except Exception as error:  # whatever a foreign library raises, the others go on
            _say(out, absent=f"{type(error).__name__}: {str(error).splitlines()[0][:120] if str(error) else ''}")
            return
        _say(out, first=first, shape=found.shape, data=base64.b64encode(found.tobytes()).decode())
        for line in sys.stdin:
            count = int(line)
            start = time.process_time()
            for _ in range(count):
                call()
            _say(out, seconds=(time.process_time() - start) / count)


def _say(out: IO[str], **what: Any) -> None:
    out.write(json.dumps(what) + "\n")
    out.flush()


def imported(name: str) -> Any:
    """The module of a peer.

    Raises:
        AbsentError: it cannot be imported: a broken installation is as good as none.
    """
    from importlib import import_module

    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name == name:
            raise AbsentError("not installed") from None
        raise AbsentError(f"{name} cannot be imported: {error}") from None
    except Exception as error:
        raise AbsentError(f"{name} cannot be imported: {type(error).__name__}: {str(error)[:80]}") from None
