"""The peer diffrax: classical RK4 with constant steps, the last state kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from lie_codegen.benchmarks.peers import jax_modules, need
from lie_codegen.benchmarks.rows import Work


def diffrax_solve(field: Callable[..., Any], start: np.ndarray[Any, Any], steps: int, h: float) -> Work:
    """g' = field(jnp, t, g, jnp.stack) to the last step, compiled.

    Raises:
        AbsentError: it is not installed.
    """
    jax, jnp = jax_modules()
    diffrax = need("diffrax")
    solver = _rk4(diffrax)
    term = diffrax.ODETerm(lambda t, x, _: field(jnp, t, x, jnp.stack))

    def solve(x: Any) -> Any:
        return diffrax.diffeqsolve(
            term, solver, 0.0, steps * h, h, x, adjoint=diffrax.ForwardMode(), max_steps=steps + 1
        ).ys[-1]

    run, first = jax.jit(solve), jnp.asarray(start)
    return lambda: jax.block_until_ready(run(first))


def _rk4(diffrax: Any) -> Any:
    """diffrax has no classical RK4 of its own; this is how one adds a method to it."""
    classical = diffrax.ButcherTableau(
        c=np.array([0.5, 0.5, 1.0]),
        b_sol=np.array([1, 2, 2, 1]) / 6,
        b_error=np.array([1, 2, 2, 1]) / 6 - np.array([1.0, 0, 0, 0]),
        a_lower=(np.array([0.5]), np.array([0.0, 0.5]), np.array([0.0, 0.0, 1.0])),
    )

    class RK4(diffrax.AbstractERK):  # type: ignore[misc]
        tableau: ClassVar[Any] = classical
        interpolation_cls: ClassVar[Any] = diffrax.ThirdOrderHermitePolynomialInterpolation.from_k

        def order(self, terms: Any) -> int:
            return 4

    return RK4()
