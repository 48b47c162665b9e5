"""One trajectory to a tolerance by one call of compiled code: what it is given, and what it found."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.magnus.drive import Drive
from lie_codegen.flow.magnus.library import Input, MagnusLibrary, Solve, read_by
from lie_codegen.groups.matrix_group import MatrixGroup

REACHED, TOO_MANY_AT_FIRST, TOO_MANY, NOT_FINITE, LONG = range(5)
_TASKS_KEPT, _MOST_TIMES_KEPT = 4, 4096
_NOTHING = Input()


class Solved(NamedTuple):
    """What a run found.

    Attributes:
        status: REACHED, or why not; LONG where the loop is to be led by Python, which looks for Ctrl-C between blocks.
        X: (k, d, d) at the times after the first.
        multiple, steps, estimate, longest, shortest: see `MagnusRun`.
    """

    status: int
    X: Array
    multiple: int
    steps: int
    estimate: float
    longest: float
    shortest: float


class SolverTask:
    """Memory for runs with so many times, pieces, rates and terms; one run at a time."""

    def __init__(self, library: MagnusLibrary, norms: Array, count: int, pieces: int, rates: int, terms: int) -> None:
        d, kind = library.group.degree, complex if library.group.is_complex else float
        spans = count + pieces + 1
        self._solve = library.solve
        self.states = [np.empty((count - 1, d, d), kind) for _ in range(2)]
        self._end = np.empty((d, d), kind)
        self.X0 = np.empty((d, d), kind)
        self.times = np.empty(count)
        self._numbers = np.empty(spans + library.work(rates, terms, count - 1))
        self._counts = np.empty(4 * spans, dtype=np.intp)
        self._norms = norms
        self.kept: tuple[Array, ...] = ()
        places = [self._counts.ctypes.data + 8 * spans * k for k in range(4)]
        self.arguments = Solve(
            pieces=pieces, norms=norms.ctypes.data, times=self.times.ctypes.data, X0=self.X0.ctypes.data, count=count,
            knots=self._numbers.ctypes.data, parts=places[0], first=places[1], piece=places[2], slot=places[3],
            space=self._numbers.ctypes.data + 8 * spans, end=self._end.ctypes.data,
        )  # fmt: skip
        self._addresses = [each.ctypes.data for each in self.states]
        self._address = ctypes.addressof(self.arguments)

    def run(self, order: int, rtol: float, atol: float, most: int, block: int) -> Solved:
        """`times`, `X0` and `arguments.u` have been filled in."""
        given = self.arguments
        given.order, given.rtol, given.atol, given.most, given.block = order, rtol, atol, most, block
        given.coarse, given.fine = self._addresses
        status = self._solve(self._address)
        X = self.states[int(given.fine == self._addresses[1])].copy()
        return Solved(status, X, given.multiple, given.steps, given.estimate, given.longest, given.shortest)


class Solver:
    """Runs of one group; tasks of the shapes last used are kept, so that a repeated call allocates nothing."""

    def __init__(self, library: MagnusLibrary, norms: Array) -> None:
        self._library, self._norms = library, norms
        self._idle: dict[tuple[int, int, int, int], list[SolverTask]] = {}

    def __call__(
        self, drive: Drive, times: Array, X0: Array, *, order: int, rtol: float, atol: float, most: int, block: int
    ) -> Solved:
        """One trajectory under a drive of one."""
        shape = (len(times), max(0, len(drive.times) - 1), drive.rates.shape[-1], drive.terms)
        task = self.take(shape)
        task.times[:] = times
        task.X0[:] = X0
        task.arguments.u = read_by(drive, 0)
        solved = task.run(order, rtol, atol, most, block)
        task.arguments.u = _NOTHING
        self.give_back(shape, task)
        return solved

    def take(self, shape: tuple[int, int, int, int]) -> SolverTask:
        """A task that nobody else uses: pop and append are atomic."""
        try:
            return self._idle[shape].pop()
        except (KeyError, IndexError):
            return SolverTask(self._library, self._norms, *shape)

    def give_back(self, shape: tuple[int, int, int, int], task: SolverTask) -> None:
        """For the next call of that shape, unless it holds much memory."""
        if shape[0] + shape[1] > _MOST_TIMES_KEPT:
            return
        if shape not in self._idle and len(self._idle) >= _TASKS_KEPT:
            self._idle.clear()
        self._idle.setdefault(shape, []).append(task)


class WaveRuns:
    """Runs from the identity over [0, length] under `count` waves, whose numbers come as one row: rates, cosines, sines."""

    def __init__(self, solver: Solver, group: MatrixGroup, count: int) -> None:
        self._solver, self._group, self._count = solver, group, count
        self._idle: list[tuple[SolverTask, Array]] = []

    def __call__(self, numbers: Array, length: float, *, order: int, rtol: float, most: int, block: int) -> Solved:
        """One run."""
        try:
            task, row = self._idle.pop()
        except IndexError:
            task, row = self._made()
        row[:] = numbers
        task.times[1] = length
        solved = task.run(order, rtol, 0.0, most, block)
        self._idle.append((task, row))
        return solved

    def _made(self) -> tuple[SolverTask, Array]:
        F, n = self._count, self._group.dim
        task = self._solver.take((2, 0, F, 0))
        task.times[:] = 0.0
        task.X0[:] = np.eye(self._group.degree)
        row, rest = np.empty(F + 2 * F * n), np.concatenate([[1.0], np.zeros(F)])
        place, fixed = row.ctypes.data, rest.ctypes.data
        task.kept = (row, rest)
        task.arguments.u = Input(
            rates=F, rate=place, rate_low=fixed + 8, cosines=place + 8 * F, sines=place + 8 * F * (n + 1), factor=fixed
        )
        return task, row
