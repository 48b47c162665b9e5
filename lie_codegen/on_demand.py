"""SymPy, SciPy and CasADi, imported when something of them is first used.

A quarter of a second and more of processor time each: what is found in the cache by its definition needs none of them. Modules import them from
here, `from lie_codegen.on_demand import sympy as sp`; nothing is bound in `sys.modules` before the package itself is there.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any


class OnDemand(ModuleType):
    """Stands for a package: what is asked of it is the package's own, which is imported by the first question."""

    def __getattr__(self, name: str) -> Any:
        value = getattr(import_module(self.__name__), name)
        self.__dict__[name] = value  # the next time nothing is called
        return value


if TYPE_CHECKING:
    import casadi as casadi
    import scipy as scipy
    import sympy as sympy
if not TYPE_CHECKING:
    casadi, scipy, sympy = OnDemand("casadi"), OnDemand("scipy"), OnDemand("sympy")
