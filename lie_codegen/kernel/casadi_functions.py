"""The kernels of a group as CasADi Functions, each made when it is first asked for."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from lie_codegen.kernel.kernel import Kernel

if TYPE_CHECKING:
    import casadi as ca


class CasadiFunctions:
    """What `group.casadi` is: the kernels of the group as `casadi.Function`s, in CasADi's shapes (see `casadi_function`).

    Attributes:
        exp, log: x (n) -> X (d, d), and back.
        product_exp, wei_norman_matrix, wei_norman_rate: g (n) -> X, M(g), and (g, u) -> g'.
        compose, inverse: X Y and X^-1. Ad, ad, bracket: (n, n), (n, n), (n).
        ljac, rjac, ljac_inv, rjac_inv: the left and right Jacobians of exp and their inverses.
        defect, renormalise: how far X is from the group, and one step back to it.
        rkmk4_step: (X, u0, um, u1, h) -> X_next of X' = X hat(u), on the group for |h u| <= 1/4.
    """

    exp: ca.Function
    log: ca.Function
    product_exp: ca.Function
    wei_norman_matrix: ca.Function
    wei_norman_rate: ca.Function
    compose: ca.Function
    inverse: ca.Function
    Ad: ca.Function
    ad: ca.Function
    bracket: ca.Function
    ljac: ca.Function
    rjac: ca.Function
    ljac_inv: ca.Function
    rjac_inv: ca.Function
    defect: ca.Function
    renormalise: ca.Function
    rkmk4_step: ca.Function

    def __init__(self, name: str, names: Sequence[str], make: Callable[[str], Kernel]) -> None:
        self._name, self._names, self._make = name, tuple(names), make
        self._made: dict[str, ca.Function] = {}
        self._lock = threading.Lock()

    def __getattr__(self, name: str) -> ca.Function:
        if name not in self.__dict__.get("_names", ()):
            raise AttributeError(
                f"{self!r} has no function {name!r}; it has {', '.join(self.__dict__.get('_names', ()))}"
            )
        from lie_codegen.kernel.casadi_function import casadi_function

        with self._lock:
            if name not in self._made:
                self._made[name] = casadi_function(self._make(name))
            return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._names})

    def __repr__(self) -> str:
        return f"<CasADi functions of {self.__dict__.get('_name')}>"
