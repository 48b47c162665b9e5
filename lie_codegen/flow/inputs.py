"""What drives a system: u(t) as a function, a constant, or samples, brought to one form."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.flow.magnus.drive import Drive, formula_drive, resolved_drive
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import shown
from lie_codegen.recent import Recent
from lie_codegen.runtime.formula_input import FormulaInput, formula_input, fourier_input, lines_input
from lie_codegen.values import Value, contents, settle

if TYPE_CHECKING:
    from lie_codegen.signals.resolved_input import ResolvedInput

#: Functions that were resolved, by what they hold: so many at most, of so many bytes.
_kept: Recent[ResolvedInput] = Recent(32)
_LARGEST = 2**20
#: How far a value that is asked for alone may lie from the same among others, relative to the largest.
_ALIKE = 1e-13


@dataclass(frozen=True, eq=False)
class Signal:
    """u(t) on (n,) components, vectorised over t.

    Attributes:
        dim: n.
        evaluate: (k,) times -> (k, n).
        breakpoints: the times at which it is not smooth.
        formula: what compiled loops evaluate themselves, or None.
        source: what was given, where it is a value.
    """

    dim: int
    evaluate: Callable[[Array], Array]
    breakpoints: Array
    formula: FormulaInput | None = None
    source: Value | None = None

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        return self.evaluate(t)


def as_signal(group: MatrixGroup, u: Any, t: Array) -> Signal:
    """A Signal from what the caller gave.

    Args:
        u: a PeriodicInput, a SampledInput; a callable u(t) -> (n,) (or vectorised: (k,) -> (k, n)), with an optional
            attribute `breakpoints`; an (n,) constant; or (len(t), n) samples at the times t, joined by straight lines.

    Raises:
        ShapeError: naming the shape that was expected.
        NotFiniteError: if u holds NaN or infinity.
    """
    formula = formula_input(u, float(t[0]), float(t[-1]))
    if formula is not None:
        if formula.dim != group.dim:
            raise ShapeError(f"simulate({group.name}): u has {formula.dim} components; the algebra has {group.dim}")
        return _of_formula(formula, t)
    if callable(u):
        source = u if isinstance(u, Value) else None
        return Signal(group.dim, _vectorised(group, u, t), _breakpoints(u, t), source=source)
    values = _numbers(group, u, "u")
    if not np.all(np.isfinite(values)):
        raise NotFiniteError(f"simulate({group.name}): u holds NaN or infinity")
    if values.shape == (group.dim,):
        return _of_formula(fourier_input([0.0], values[None], np.zeros((1, group.dim))), t)
    if values.shape == (len(t), group.dim):
        return _of_formula(lines_input(t, values[:-1], values[1:]), t)
    raise ShapeError(
        f"simulate({group.name}): u has shape {values.shape}; give a function of t, a constant ({group.dim},), or "
        f"samples ({len(t)}, {group.dim}) at the times t"
    )


def as_drive(
    group: MatrixGroup, signal: Signal, eps: Array, t: Array, *, rtol: float, resolution: float | None
) -> Drive:
    """eps u as compiled loops read it: a formula as it is, a function resolved into pieces.

    A fifth of the tolerance is for the pieces.

    Raises:
        InputError, NotFiniteError, ComputationError: see `resolve_function`.
    """
    if signal.formula is not None:
        return formula_drive(signal.formula, eps)
    tolerance = 0.2 * rtol / max(float(np.max(np.abs(eps))), 1e-300)
    found = _pieces(signal, float(t[0]), float(t[-1]), tolerance, resolution, f"simulate({group.name})")
    return resolved_drive(found, eps)


def _pieces(
    signal: Signal, start: float, end: float, tolerance: float, resolution: float | None, where: str
) -> ResolvedInput:
    """A function resolved; that of a value of plain data, as the controls of a plan, is kept for runs to come."""
    from lie_codegen.signals.resolved_input import resolve_function

    key = None
    if signal.source is not None:
        with suppress(TypeError):
            key = contents(signal.source), start, end, tolerance, resolution
    found = None if key is None else _kept.get(key)
    if found is None:
        found = resolve_function(
            signal.evaluate, start, end, tolerance=tolerance, resolution=resolution, breakpoints=signal.breakpoints, where=where
        )  # fmt: skip
        if key is not None and found.series.nbytes <= _LARGEST:
            found.series.flags.writeable = found.times.flags.writeable = found.corners.flags.writeable = False
            _kept.keep(key, found)
    return found


def drive_signal(drive: Drive, t: Array) -> Signal:
    """The input of one trajectory, for the steps that take a Signal."""
    if not drive.terms:
        return _of_formula(drive.formula.scaled(drive.factor[0]), t)

    def evaluate(s: Array) -> Array:
        return drive.values(s, np.zeros_like(s), np.zeros(1))[:, 0]

    return Signal(drive.series.shape[2], evaluate, drive.corners)


def _of_formula(formula: FormulaInput, t: Array) -> Signal:
    """The formula; by numpy, of the first trajectory, where Python asks for values. Kept beside a formula that is smooth at all times."""
    kept: Signal | None = vars(formula).get("_signal")
    if kept is not None:
        return kept
    one = formula if formula.trajectories is None else formula.trajectory(0)

    def evaluate(s: Array) -> Array:
        return one.values(s, np.zeros_like(s), np.zeros(1))[:, 0]

    inside = formula.breakpoints
    if len(inside):
        return Signal(formula.dim, evaluate, inside[(inside >= t[0]) & (inside <= t[-1])], formula)
    made = Signal(formula.dim, evaluate, inside, formula)
    settle(formula, _signal=made)
    return made


def _breakpoints(u: Any, t: Array) -> Array:
    """The times at which u is not smooth; a periodic input repeats its own over [t_0, t_k]."""
    within = getattr(u, "breakpoints_between", None)
    times = within(float(t[0]), float(t[-1])) if callable(within) else getattr(u, "breakpoints", ())
    return np.asarray(times, dtype=float)


def _vectorised(group: MatrixGroup, u: Callable[[Any], Any], t: Array) -> Callable[[Array], Array]:
    probe = t[: min(len(t), 3)]
    try:
        together: Any = np.asarray(u(probe), dtype=float)
    except (TypeError, ValueError, InputError):
        together = None
    expected = (len(probe), group.dim)
    single = _numbers(group, u(float(probe[0])), "u(t)")
    if single.shape != (group.dim,):
        raise ShapeError(f"simulate({group.name}): u(t) has shape {single.shape}; it must be ({group.dim},)")
    # a product of one row and of several is not rounded alike; whoever misreads an array of times is further off
    if (
        together is not None
        and together.shape == expected
        and np.all(np.isfinite(together))
        and np.max(np.abs(together[0] - single), initial=0.0) <= _ALIKE * np.max(np.abs(together), initial=0.0)
    ):
        return lambda s: np.asarray(u(s), dtype=float)
    return lambda s: np.array([u(float(moment)) for moment in s], dtype=float).reshape(len(s), group.dim)


def _numbers(group: MatrixGroup, value: Any, what: str) -> Array:
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(
            f"simulate({group.name}): {what} must be real numbers, formulas of t or a function of t, got {shown(value)}"
        ) from None
