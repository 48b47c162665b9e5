"""What `lc.closed_loop` returns: a motion under a law, as data; what made it stays beside, in its own process."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.codegen.parts import PackageParts
from lie_codegen.control.loop_adaptive import states_within
from lie_codegen.control.loop_error import loop_error
from lie_codegen.control.loop_origin import LoopMaking, LoopOrigin
from lie_codegen.errors import InputError
from lie_codegen.flow.events import EventHits
from lie_codegen.kernel.saved import Saved
from lie_codegen.values import Deferred, settle


class _Absent(Deferred):
    """A deferred field with options of its own: its default comes as the descriptor itself, and is None."""

    def __init__(self) -> None:
        super().__init__(None)

    def __set__(self, owner: Any, value: Any) -> None:
        super().__set__(owner, None if value is self else value)


@dataclass(frozen=True, eq=False, repr=False)
class ClosedLoop(Saved):
    """A motion under a law: X' = X hat(xi), I xi' = ad*_xi I xi + f, or X' = X hat(u).

    Attributes:
        t: (k,) times.
        X: (k, d, d) configurations, on the group to rounding; (k, N, d, d) for N loops.
        xi: (k, n) body velocities; (k, N, n). Of a law that commands the velocity, what it commands.
        outputs: what the law gives along the way, by the names of its outputs (force or torque, phi, W, W_dot, V ...), from
            the true state; and its own states (integral).
        X_d, xi_d: the reference, (k, d, d) and (k, n), or None.
        steps: number of integration steps.
        error_estimate: from the difference to a run with larger local errors, or with twice the step; NaN for a fixed step.
        u: (k, m) the command that acts from each time on, within the limits, its noise and its delay included; (k, N, m).
            None without a law.
        states: the law's and the observer's own states by name, (k, ...) or (k, N, ...): as the law used them at that time.
        group: the group, or None for a mechanism that is not on one.
        events: what was found of each event, in their order.
        origin: the definitions and numbers that it was run from; None for a law written by hand, which has none.
    """

    t: Array
    X: Array
    xi: Array
    outputs: dict[str, Array] = Deferred()  # type: ignore[assignment]
    # what stands there in the class is no default: a descriptor, which lets a field be made when it is asked for
    X_d: Array | None  # type: ignore[misc]
    xi_d: Array | None  # type: ignore[misc]
    steps: int  # type: ignore[misc]
    error_estimate: float  # type: ignore[misc]
    u: Array | None = Deferred(None)  # type: ignore[assignment]
    states: dict[str, Array] = field(default_factory=dict)
    group: Any = None
    events: tuple[EventHits, ...] = ()
    origin: LoopOrigin | None = field(default=_Absent(), repr=False, compare=False)  # type: ignore[assignment]

    @cached_property
    def error(self) -> Array:
        """(k,) or (k, N) distance to the reference, to the identity without one.

        The angle [rad] of X_d^-1 X for rotations, else the norm of the logarithm's coordinates, NaN where there is no
        logarithm; off groups the distance |q - r|.
        """
        return loop_error(self.group, self.X, self.X_d)

    def at(self, t: ArrayLike) -> tuple[Array, Array]:
        """(X, xi) of a single loop at other times: by fresh steps, as exact as the run.

        Args:
            t: one time or (k,) times within the run.

        Returns:
            (d, d) and (n,), or (k, d, d) and (k, n).

        Raises:
            InputError: a time outside the run; several loops; a run by equal steps; one from a file whose law was written by
                hand and has no definition.
        """
        made = self._making
        if made is None or made.pair is None or made.run.many:
            raise InputError(
                "ClosedLoop.at: only of a single loop that closed_loop(rtol=...) ran, on a group; from a file only with a law that "
                "has a definition: run it again"
            )
        moments = np.asarray(t, dtype=float)
        wanted = np.atleast_1d(moments)
        if wanted.ndim != 1 or not np.all((wanted >= self.t[0]) & (wanted <= self.t[-1])):
            raise InputError(
                f"ClosedLoop.at: t must be a number or (k,) numbers from {self.t[0]:.9g} to {self.t[-1]:.9g}"
            )
        X, xi = made.run.loop.plant.split(states_within(made.run, made.pair, wanted))
        return (X, xi) if moments.ndim else (X[0], xi[0])

    def package_parts(self, name: str | None = None, real: str = "double", form: str | None = None) -> PackageParts:
        """The law as C with <name>_loop.c, which runs the first loop without noise, as `lc.generate(run, folder)` writes them.

        Args:
            name: of the package, the law's own if None.
            real: "double" or "float".
            form: as every thing that can be generated takes it; a loop has one form and does not read it.

        Raises:
            InputError: the loop has no law; or it is from a file, and its law was written by hand and has no definition.
        """
        from lie_codegen.control.loop_package import loop_parts

        made = making_of(self, "generate")
        run, parts = made.in_steps()
        return loop_parts(run, made.reference, parts, name, real)

    @property
    def _making(self) -> LoopMaking | None:
        """What ran it: kept beside the fields in its own process, elsewhere made again."""
        made: LoopMaking | None = vars(self).get("_made")
        if made is None and self.origin is not None:
            made = self._made_by(self.origin.again(self.t))._making
        return made

    def _made_by(self, making: LoopMaking) -> ClosedLoop:
        settle(self, _made=making)  # beside the fields: neither == nor a pickle sees it
        return self


def making_of(run: ClosedLoop, what: str) -> LoopMaking:
    """What made a run.

    Raises:
        InputError: it is from a file, and its law was written by hand and has no definition.
    """
    made = run._making
    if made is None:
        raise InputError(
            f"{what}: a loop that was loaded knows its law only by a definition, and this one has none; run closed_loop again"
        )
    return made
