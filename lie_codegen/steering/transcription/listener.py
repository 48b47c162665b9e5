"""A voice for long solves: the objective and the violation of an iterate, at most once a second."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

_PAUSE = 1.0


class Listener(ca.Callback):
    """What CasADi's solvers call after each iteration; it never stops them."""

    def __init__(self, variables: int, constraints: int, parameters: int) -> None:
        ca.Callback.__init__(self)
        self._sizes = {
            "x": variables,
            "f": 1,
            "g": constraints,
            "lam_x": variables,
            "lam_g": constraints,
            "lam_p": parameters,
        }
        self._say: Callable[[str], None] = lambda line: None
        self._count, self._spoken = 0, 0.0
        self.construct("listener", {})

    def listen(self, say: Callable[[str], None]) -> None:
        """A new solve begins; `say` is called with what there is to tell."""
        self._say, self._count, self._spoken = say, 0, time.perf_counter()

    def get_n_in(self) -> int:
        """CasADi's interface."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """CasADi's interface."""
        return 1

    def get_sparsity_in(self, i: int) -> Any:
        """CasADi's interface."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(i)], 1)

    def eval(self, arg: Sequence[Any]) -> list[Any]:
        """CasADi's interface."""
        self._count += 1
        if time.perf_counter() - self._spoken >= _PAUSE:
            self._spoken = time.perf_counter()
            objective, gap = float(arg[1]), float(np.max(np.abs(np.minimum(np.asarray(arg[2]), 0.0)), initial=0.0))
            self._say(f"iteration {self._count}, objective {objective:.6g}, largest negative constraint {gap:.1e}")
        return [0]
