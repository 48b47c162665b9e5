"""lc.propagator: X(T; p) of X' = X hat(u(t; p)), X(0) = 1, with its exact derivatives in p, in batches, and its powers."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.flow.input_slopes import dual_basis, slopes_along
from lie_codegen.flow.inputs import as_drive, as_signal
from lie_codegen.flow.magnus.drive import Drive
from lie_codegen.flow.magnus.run import (
    BLOCK,
    MOST_STEPS,
    SINGLE_GOAL,
    MagnusRun,
    as_run,
    magnus_run,
    order_for,
    solver_of,
)
from lie_codegen.flow.magnus.solver import LONG, REACHED, WaveRuns
from lie_codegen.flow.magnus.tangents import tangents
from lie_codegen.flow.parametric_drive import parametric_batch, parametric_drive, wave_numbers
from lie_codegen.flow.propagation import Power, PropagationBatch, power_of
from lie_codegen.flow.simulate_arguments import check_precision, check_tolerance, written
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.signals.parametric_input import ParametricInput, parameter_values
from lie_codegen.signals.sampled_input import SampledInput

_LARGEST_POWER = 10**12


@dataclass(frozen=True, eq=False, repr=False)
class Propagation(Saved):
    """X(T; p) at one p.

    Attributes:
        X: (d, d).
        error_estimate: of its entries.
        steps: number of steps.
        duration: T.
        parameters: name -> value.
        of: the propagator that it is of.
        finest: as many steps as short as the shortest of the run.
        dX: (m, d, d) dX/dp in the order of the parameters: the exact derivative of what the steps compute, so that Newton's
            method on it converges to rounding. Of a SampledInput (m, n, d, d), in the order of its values. Few parameters go
            forward with the steps; where there are more than two for each dimension, n reverse passes give all of them.
        eta: (m, n) X^-1 dX/dp in the algebra; (m, n, n) of samples.
    """

    X: Array
    error_estimate: float
    steps: int
    duration: float
    parameters: dict[str, float]
    of: Propagator = field(repr=False)
    finest: int = field(repr=False)

    def __repr__(self) -> str:
        at = ", ".join(f"{name}={value:.6g}" for name, value in self.parameters.items())
        return (
            f"Propagation({self.of.group.name}, duration={self.duration:.6g}{', ' if at else ''}{at}, {self.steps} steps, "
            f"error_estimate={self.error_estimate:.2g})"
        )

    @cached_property
    def dX(self) -> Array:
        """(m, d, d), or (m, n, d, d); see the class."""
        u, group = self.of.u, self.of.group
        if not isinstance(u, ParametricInput | SampledInput):
            return np.zeros((0, *self.X.shape), self.X.dtype)
        if isinstance(u, SampledInput) or len(u.parameters) > 2 * group.dim:
            eta = slopes_along(group, u, self.parameters, self.duration, self.finest, dual_basis(group))
            found = np.asarray(self.X @ group.hat(np.moveaxis(eta, 0, -1)))
        else:
            found = tangents(group, u, self.parameters, self.duration, self.finest)
        return found + self._of_the_end

    @cached_property
    def eta(self) -> Array:
        """(m, n), or (m, n, n); see the class."""
        return np.asarray(self.of.group.project(np.linalg.solve(self.X, self.dX)))

    def gradient(self, cotangent: ArrayLike) -> Array:
        """d/dp of Re tr(G^H X), the sum of entries of G and X: (m,), or as the values of a SampledInput; one reverse pass.

        The cost is that of a few runs, however many parameters or samples there are.

        Args:
            cotangent: (d, d) G, the derivative of a goal by the entries of X. For |tr(V^H X)|^2 it is 2 tr(V^H X) V.

        Raises:
            ShapeError, NotFiniteError: G is no finite (d, d) matrix.
            InputError: the input has neither parameters nor samples.
        """
        u, group = self.of.u, self.of.group
        where = f"propagator({group.name}).gradient"
        if not isinstance(u, ParametricInput | SampledInput):
            raise InputError(f"{where}: the input has no parameters; give a lc.ParametricInput or a lc.SampledInput")
        G = np.asarray(cotangent)
        if G.shape != self.X.shape or G.dtype.kind not in "biufc":
            raise ShapeError(f"{where}: the cotangent has shape {G.shape}; give {self.X.shape} numbers")
        if not np.all(np.isfinite(G)):
            raise NotFiniteError(f"{where}: the cotangent holds NaN or infinity")
        [found] = slopes_along(group, u, self.parameters, self.duration, self.finest, (self.X.conj().T @ G)[None])
        return np.asarray(found + np.einsum("ij,...ij->...", np.conj(G), self._of_the_end).real)

    @property
    def _of_the_end(self) -> Array:
        """X hat(u(T)) dT/dp where T is a period that depends on the parameters."""
        u = self.of.u
        if self.of.duration != "period" or not isinstance(u, ParametricInput):
            return np.zeros(())[..., None, None]
        slopes = u.period_of(tuple(self.parameters.values()))[1]
        return np.asarray(slopes[:, None, None] * (self.X @ self.of.group.hat(u(self.duration, **self.parameters))))

    def power(self, n: int) -> Power:
        """X(n T) = X(T)^n of a periodic input; see `Propagator.power`."""
        return self.of._power(self, n)


@dataclass(frozen=True, eq=False, repr=False)
class Propagator(Saved):
    """U(a=.5, ...).X; see `propagator`.

    Attributes:
        group: the group.
        u: the input; one that is a function of the user compares by what it is, and is not saved.
        duration: T, or "period".
        rtol: the tolerance.
        resolution: of a u that is no sum of sines and cosines, as in `simulate`.
    """

    group: MatrixGroup
    u: Any
    duration: float | str
    rtol: float
    resolution: float | None = None

    def __repr__(self) -> str:
        names = ", ".join(self.parameters)
        return f"Propagator({self.group.name}, duration={self.duration!r}, parameters=({names}), rtol={self.rtol:g})"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of every derivative."""
        return tuple(getattr(self.u, "parameters", ()))

    def __call__(self, **parameters: float) -> Propagation:
        """X(T; p).

        Raises:
            InputError: a parameter missing or unknown; others as `simulate`.
        """
        where = f"propagator({self.group.name})"
        if isinstance(self.u, ParametricInput):
            values = parameter_values(self.u.parameters, parameters)
            length = self.u.period_of(values)[0] if self.duration == "period" else float(self.duration)
            named = dict(zip(self.u.parameters, values, strict=True))
            if self._wave_runs is not None and self.u.waves is not None:
                numbers = wave_numbers(self.u.waves, values)
                found = self._wave_runs(
                    numbers, length, order=self._order, rtol=self.rtol, most=MOST_STEPS, block=BLOCK
                )
                if found.status != REACHED and not np.all(np.isfinite(numbers)):
                    raise NotFiniteError(f"{where}: a formula of the input is NaN or infinite at {named}")
                if found.status != LONG:
                    return self._propagation(as_run(found, self._order, 0.0, where, MOST_STEPS), length, named)
            drive = parametric_drive(self.u, values, length, self.rtol, self.resolution, where)
        else:
            if parameters:
                raise InputError(f"{where}: no parameter {next(iter(parameters))!r}; the input has none")
            length, named = self._fixed_length(), {}
            t = np.array([0.0, length])
            drive = as_drive(
                self.group,
                as_signal(self.group, self.u, t),
                np.array(1.0),
                t,
                rtol=self.rtol,
                resolution=self.resolution,
            )
        return self._propagation(self._run(drive, length, self._one), length, named)

    def _propagation(self, run: MagnusRun, length: float, named: dict[str, float]) -> Propagation:
        finest = max(run.steps, int(np.ceil(length / run.shortest * (1 - 1e-9))))
        return Propagation(run.X[0], run.error_estimate, run.steps, length, named, self, finest)

    def batch(self, *, threads: int = 1, precision: str = "double", **parameters: ArrayLike) -> PropagationBatch:
        """X(T; p) where any of the parameters are (N,) arrays and the others numbers, side by side on lanes.

        Args:
            threads: that share the members; the result does not depend on it.
            precision: "single" for screening, to 1e-6 at best, as in `simulate`.
            parameters: each by its name, a number or (N,).

        Raises:
            InputError: a parameter missing or unknown, a duration that depends on them.
            ShapeError: arrays of different lengths.
        """
        where = f"propagator({self.group.name})"
        single = check_precision(where, precision)
        if not isinstance(self.u, ParametricInput):
            raise InputError(f"{where}: the input has no parameters; give a lc.ParametricInput")
        values = parameter_values(self.u.parameters, parameters, many=True)
        counts = sorted({len(value) for value in values if isinstance(value, np.ndarray)})
        if len(counts) > 1:
            raise ShapeError(f"{where}: the parameters have lengths {', '.join(map(str, counts))}; give one N")
        count = counts[0] if counts else 1
        if self.duration == "period":
            lengths = {
                self.u.period_of(row)[0] for row in zip(*(np.broadcast_to(v, count) for v in values), strict=True)
            }
            if len(lengths) > 1:
                raise InputError(f"{where}: the period differs from member to member; call them one by one")
            length = lengths.pop()
        else:
            length = float(self.duration)
        drives = parametric_batch(self.u, values, count, length, self.rtol, self.resolution, where)
        runs = [self._run(drive, length, self._one, threads, single) for drive in drives]
        X = np.concatenate([run.X[0] if run.X.ndim == 4 else run.X for run in runs])
        return PropagationBatch(X, max(run.error_estimate for run in runs), max(run.steps for run in runs))

    def power(self, n: int, **parameters: float) -> Power:
        """X(n T) = X(T)^n of a periodic input over one period, with its error.

        Squared and multiplied in extended precision, so that the error is that of X(T), n times.

        Args:
            n: how many periods, from 0 to 10^12.
            parameters: each by its name, a number.

        Raises:
            InputError: n is no integer from 0 to 10^12, or the duration is not "period".
        """
        return self._power(self(**parameters), n)

    def _power(self, one: Propagation, n: int) -> Power:
        if self.duration != "period":
            raise InputError(f'propagator({self.group.name}): powers are of one period; give duration="period"')
        if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 0 <= n <= _LARGEST_POWER:
            raise InputError(f"propagator({self.group.name}).power: n is an integer from 0 to 10^12, given {n!r}")
        return power_of(one.X, int(n), one.error_estimate)

    @property
    def _one(self) -> Array:
        return np.eye(self.group.degree, dtype=complex if self.group.is_complex else float)

    @cached_property
    def _order(self) -> int:
        return order_for("auto", self.rtol)

    @cached_property
    def _wave_runs(self) -> WaveRuns | None:
        """Calls that allocate nothing, where u is a sum of waves and there is a compiler."""
        waves, solver = (None if self.u.breakpoints else self.u.waves), solver_of(self.group)
        return None if waves is None or solver is None else WaveRuns(solver, self.group, waves.count)

    def _fixed_length(self) -> float:
        return float(self.u.T) if self.duration == "period" else float(self.duration)

    def _run(self, drive: Drive, length: float, start: Array, threads: int = 1, single: bool = False) -> MagnusRun:
        times = np.array([0.0, length])
        rtol, order = (max(self.rtol, SINGLE_GOAL), 8) if single else (self.rtol, self._order)
        return magnus_run(self.group, drive, times, start, order=order, rtol=rtol, threads=threads, single=single)


def propagator(
    group: GroupLike,
    u: Any,
    *,
    duration: float | str,
    rtol: float = 1e-11,
    resolution: float | None = None,
) -> Propagator:
    """U with U(a=.5, w=1.1).X = X(T; p): the flow X' = X hat(u(t; p)) from the identity over [0, T].

    The steps of the group are compiled once; parameters are inputs. `.dX` are exact derivatives, by
    eta <- Ad(exp(-Omega)) eta + rjac(Omega) dOmega at every step, dOmega the derivative of the Magnus formula.

    Args:
        group: a group, a catalogue name or a group file.
        u: a lc.ParametricInput; or an input of time of `simulate` (formulas, samples, a constant, a function), without parameters.
        duration: T, or "period" of a periodic input.
        rtol: as in `simulate`.
        resolution: as in `simulate`, for a u that is no sum of sines and cosines.

    Raises:
        InputError: a duration that is not positive, or "period" of an input that is not periodic.
        ShapeError: u has not one component for each basis element.
        NotFiniteError: u holds NaN or infinity.
        ExpressionError: a formula outside the grammar; one of parameters goes into a lc.ParametricInput.
    """
    G = as_group(group, "propagator")
    where = f"propagator({G.name})"
    goal = check_tolerance(where, rtol, 0.0, None)
    u = written(u)
    if isinstance(u, tuple) and isinstance(u[0], str):
        u = ParametricInput(u, ())
    if isinstance(u, ParametricInput) and u.dim != G.dim:
        raise ShapeError(f"{where}: u has {u.dim} components; the algebra has {G.dim}")
    if duration == "period":
        if getattr(u, "period", None) is None:
            raise InputError(
                f"{where}: the input has no period; give lc.ParametricInput(..., period='2*pi/w') or a number"
            )
    elif isinstance(duration, str) or not (np.isfinite(duration) and duration > 0):
        raise InputError(f'{where}: duration is {duration!r}; give a positive number, or "period"')
    if not isinstance(u, ParametricInput):
        end = float(u.T) if duration == "period" else float(duration)
        as_signal(G, u, np.array([0.0, end]))  # what is no input is refused here, not when it is run
    return Propagator(G, u, duration, goal, resolution)
