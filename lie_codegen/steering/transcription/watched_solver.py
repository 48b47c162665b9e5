"""A nonlinear solver in a process of its own, because fatrop can loop for ever inside its linear algebra.

No call of it can be stopped from within: the oracle is not asked again there, and no option bounds the loop. So the program, a
compiled library, is solved by `python -m lie_codegen.steering.transcription.watched_solver`, one for this process. It has so much
processor time for a request, after which the system ends it; the next program starts another. What else the machine does is not
counted, so that the same program has the same answer on a busy one. A request costs a tenth of a millisecond.
"""

from __future__ import annotations

import atexit
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as Late
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock
from typing import IO, Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.runtime.child import child_environment

#: Seconds of processor time for one program, and more for each variable. A solve takes a tenth of it where it takes long.
_PATIENCE, _EACH = 4.0, 1 / 400
#: A process can be told to end after so much processor time (Windows has no such timer: there it is the clock's, while we wait).
_COUNTS = hasattr(signal, "setitimer")


class WatchedSolver:
    """A casadi nlpsol of a compiled program, called and asked like one."""

    def __init__(self, solver: str, library: str, options: Mapping[str, Any]) -> None:
        self._request = (solver, library, dict(options))
        self._stats: dict[str, Any] = {}
        self._functions: dict[str, Any] = {}

    def __call__(self, **numbers: Array) -> dict[str, Array]:
        """As nlpsol: x0, p, lbx, ubx, lbg, ubg -> x, f, g; NaN where the process had to be ended.

        Raises:
            RuntimeError: as nlpsol.
        """
        given = {name: np.asarray(value, dtype=float) for name, value in numbers.items()}
        seconds = _PATIENCE + _EACH * len(given["x0"])
        answer = _worker.ask((*self._request, given), seconds)
        if isinstance(answer, Exception):
            raise answer
        if answer is None:
            self._stats = {"unified_return_status": f"ended after {seconds:.3g} s of processor time", "iter_count": -1}
            size, rows = len(given["x0"]), len(given["lbg"])
            return {"x": np.full(size, np.nan), "f": np.array(np.nan), "g": np.full(rows, np.nan)}
        result, self._stats = answer
        return dict(result)

    def stats(self) -> dict[str, Any]:
        """Of the last call: iter_count, unified_return_status."""
        return self._stats

    def get_function(self, name: str) -> Any:
        """A function of the program: nlp_f, nlp_g."""
        if name not in self._functions:
            import casadi as ca

            self._functions[name] = ca.external(name, self._request[1])
        return self._functions[name]


@dataclass(frozen=True)
class _Running:
    process: subprocess.Popen[bytes]
    requests: IO[bytes]
    answers: IO[bytes]


class _Worker:
    """The process, started when first asked and again after it had to be ended."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._running: _Running | None = None
        self._reader = ThreadPoolExecutor(1, "lie_codegen-solver")

    def ask(self, request: Any, seconds: float) -> Any:
        """The answer; None if it takes more than so many seconds of processor time, or the process dies."""
        with self._lock:
            try:
                running = self._started()
                for each in (seconds, request):
                    pickle.dump(each, running.requests)
                running.requests.flush()
                return self._answer(running, None if _COUNTS else seconds)
            except (Late, OSError, EOFError, pickle.UnpicklingError):
                self.end()
                return None
            except BaseException:
                # Ctrl-C: the answer that is still to come would be read as the next request's
                self.end()
                raise

    def _answer(self, running: _Running, seconds: float | None) -> Any:
        return self._reader.submit(pickle.load, running.answers).result(seconds)

    def _started(self) -> _Running:
        running = self._running
        if running is None or running.process.poll() is not None:
            if not sys.executable or getattr(sys, "frozen", False):
                raise OSError("no Python to start")
            command = [sys.executable, "-m", "lie_codegen.steering.transcription.watched_solver"]
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=child_environment())
            if process.stdin is None or process.stdout is None:
                raise OSError("no pipes")
            running = self._running = _Running(process, process.stdin, process.stdout)
            self._answer(running, None)
        return running

    def end(self) -> None:
        """Ends the process, if there is one."""
        running, self._running = self._running, None
        if running is not None:
            running.process.kill()
            running.process.wait()
            for stream in (running.requests, running.answers):
                with suppress(OSError):
                    stream.close()


_worker = _Worker()
atexit.register(_worker.end)


def _end_after(seconds: float) -> None:
    """This process ends once it has used so much more processor time: SIGPROF, with nobody to hear it, ends it in the midst of C."""
    if _COUNTS:
        signal.setitimer(signal.ITIMER_PROF, seconds)


def _serve() -> None:
    """Answers requests from standard input until it ends; what solvers print goes to standard error."""
    import casadi as ca

    # Ctrl-C reaches every process of a terminal: the one that asks ends this one, which would only print where it was.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    solvers: dict[str, Any] = {}

    def answer(value: Any) -> None:
        pickle.dump(value, answers)
        answers.flush()

    answer("ready")
    while True:
        try:
            _end_after(pickle.load(sys.stdin.buffer))
            solver, library, options, numbers = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            key = repr((solver, library, sorted(options)))
            if key not in solvers:
                solvers[key] = ca.nlpsol("steer", solver, library, options)
            result = solvers[key](**numbers)
            stats = solvers[key].stats()
            kept = {name: stats.get(name) for name in ("iter_count", "unified_return_status")}
            vectors = {name: np.asarray(result[name]).ravel() for name in ("x", "g")}
            answer(({"f": np.array(float(result["f"])), **vectors}, kept))
        except RuntimeError as error:
            answer(error)


if __name__ == "__main__":
    _serve()
