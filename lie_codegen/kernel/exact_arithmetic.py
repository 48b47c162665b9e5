"""The kernel arithmetic over SymPy: the exact, printable form of a kernel."""

from __future__ import annotations

from typing import Any

from lie_codegen.exact.numbers import exact_number
from lie_codegen.on_demand import sympy as sp


class ExactArithmetic:
    """SymPy expressions."""

    def constant(self, value: Any) -> sp.Expr:
        return exact_number(value)

    sin = staticmethod(sp.sin)
    cos = staticmethod(sp.cos)
    tan = staticmethod(sp.tan)
    exp = staticmethod(sp.exp)
    log = staticmethod(sp.log)
    sqrt = staticmethod(sp.sqrt)
    sinh = staticmethod(sp.sinh)
    cosh = staticmethod(sp.cosh)
    tanh = staticmethod(sp.tanh)
    acos = staticmethod(sp.acos)
    asin = staticmethod(sp.asin)
    atan = staticmethod(sp.atan)
    atan2 = staticmethod(sp.atan2)
    fabs = staticmethod(sp.Abs)

    def expm1(self, x: Any) -> sp.Expr:
        return sp.exp(x) - 1

    def less(self, a: Any, b: Any) -> Any:
        return sp.Lt(a, b)

    def where(self, condition: Any, then: Any, otherwise: Any) -> Any:
        return sp.Piecewise((then, condition), (otherwise, True))
