"""The closed table of CasADi's scalar operations, each with its C form.

An operation missing here is refused by name: nothing is ever printed as something else.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lie_codegen.errors import CodegenError

#: Operation -> C expression over double operands {0}, {1}, {2}. Every result is a double.
C99_FORMS: Mapping[str, str] = {
    "ASSIGN": "{0}",
    "LIFT": "{0}",
    "ADD": "{0} + {1}",
    "SUB": "{0} - {1}",
    "MUL": "{0} * {1}",
    "DIV": "{0} / {1}",
    "NEG": "-{0}",
    "INV": "1.0 / {0}",
    "TWICE": "2.0 * {0}",
    "SQ": "{0} * {0}",
    "POW": "pow({0}, {1})",
    "CONSTPOW": "pow({0}, {1})",
    "SQRT": "sqrt({0})",
    "EXP": "exp({0})",
    "EXPM1": "expm1({0})",
    "LOG": "log({0})",
    "LOG1P": "log1p({0})",
    "SIN": "sin({0})",
    "COS": "cos({0})",
    "TAN": "tan({0})",
    "ASIN": "asin({0})",
    "ACOS": "acos({0})",
    "ATAN": "atan({0})",
    "ATAN2": "atan2({0}, {1})",
    "SINH": "sinh({0})",
    "COSH": "cosh({0})",
    "TANH": "tanh({0})",
    "ASINH": "asinh({0})",
    "ACOSH": "acosh({0})",
    "ATANH": "atanh({0})",
    "ERF": "erf({0})",
    "HYPOT": "hypot({0}, {1})",
    "FABS": "fabs({0})",
    "FLOOR": "floor({0})",
    "CEIL": "ceil({0})",
    "FMOD": "fmod({0}, {1})",
    "REMAINDER": "remainder({0}, {1})",
    "COPYSIGN": "copysign({0}, {1})",
    "FMIN": "fmin({0}, {1})",
    "FMAX": "fmax({0}, {1})",
    "SIGN": "{0} < 0.0 ? -1.0 : ({0} > 0.0 ? 1.0 : {0})",
    "LT": "(double)({0} < {1})",
    "LE": "(double)({0} <= {1})",
    "EQ": "(double)({0} == {1})",
    "NE": "(double)({0} != {1})",
    "NOT": "(double)({0} == 0.0)",
    "AND": "(double)({0} != 0.0 && {1} != 0.0)",
    "OR": "(double)({0} != 0.0 || {1} != 0.0)",
    # A conditional, not a product: the branch not taken may be infinite or NaN.
    "IF_ELSE_ZERO": "{0} != 0.0 ? {1} : 0.0",
    "SELECT": "{0} != 0.0 ? {1} : {2}",
}

_LEAST_FLOAT, _MOST_FLOAT = 1.1754943508222875e-38, 3.4028234663852886e38

#: Macros a C parameter would be replaced by, in C or in the GNU dialects.
_MACROS = ("HUGE_VAL", "NAN", "INFINITY", "NULL", "I", "errno", "assert", "complex", "imaginary", "unix", "linux")

_FUNCTIONS = frozenset(re.findall(r"[a-z]\w*(?=\()", " ".join(C99_FORMS.values())))
#: Names that no C parameter may have: the functions that the forms call, in double and in float, and macros.
RESERVED = _FUNCTIONS | frozenset(f"{name}f" for name in _FUNCTIONS) | frozenset(_MACROS)
#: The same in single precision: sinf for sin, 1.0f for 1.0.
C99_FLOAT_FORMS: Mapping[str, str] = {
    op: re.sub(r"([a-z]\w*)\(", r"\1f(", re.sub(r"(\d\.\d)", r"\1f", form)).replace("(double)", "(float)")
    for op, form in C99_FORMS.items()
}


def c_literal(value: float) -> str:
    """The shortest decimal that reads back as exactly `value`; a negative one in parentheses."""
    if math.isnan(value):
        return "(double)NAN"
    if math.isinf(value):
        return "HUGE_VAL" if value > 0 else "(-HUGE_VAL)"
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def c_float_literal(value: float) -> str:
    """The shortest decimal that reads back as the float nearest to `value`.

    What is smaller than every normal float becomes the least of them, not zero: such constants guard divisions, or end
    a series.

    Raises:
        CodegenError: it is too large for a float.
    """
    if math.isnan(value):
        return "(float)NAN"
    if math.isinf(value):
        return "HUGE_VALF" if value > 0 else "(-HUGE_VALF)"
    if value != 0.0 and abs(value) < _LEAST_FLOAT:
        value = math.copysign(_LEAST_FLOAT, value)
    if abs(value) > _MOST_FLOAT:
        raise CodegenError(f"the constant {value!r} is no number in single precision: generate with real='double'")
    text = repr(float(str(np.float32(value))))
    return f"({text}f)" if text.startswith("-") else f"{text}f"


_CALLED = re.compile(r"\b(" + "|".join(sorted(_FUNCTIONS | {"floor", "hypot", "ldexp"})) + r")\(")
_FLOATING = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)(?![\w.])")


def in_single(text: str) -> str:
    """A C text in double, written in single precision: its type, the functions of math.h that it calls, its constants, NAN."""
    text = _CALLED.sub(r"\1f(", re.sub(r"\bdouble\b", "float", text))
    return _FLOATING.sub(r"\1f", text)


@dataclass(frozen=True)
class Target:
    """A C dialect a tape can be printed in: scalar doubles, or later lanes of them.

    Attributes:
        type_name: C type of a temporary.
        forms: operation -> expression, with {0}, {1}, {2} for the operands.
        literal: a double as an operand.
        load: expression of one entry of an input; {0} is the array, {1} the entry.
    """

    type_name: str
    forms: Mapping[str, str]
    literal: Callable[[float], str]
    load: str = "{0}[{1}]"

    def expression(self, op: str, operands: tuple[str, ...]) -> str:
        """The C expression of one operation.

        Raises:
            CodegenError: the target has no form for it.
        """
        form = self.forms.get(op)
        if form is None:
            raise CodegenError(
                f"operation {op} has no C form in the target {self.type_name}: write the kernel without it"
            )
        return form.format(*operands)


#: Plain C99 with libm.
C99 = Target("double", C99_FORMS, c_literal)
#: The same in single precision, for processors without double.
C99_FLOAT = Target("float", C99_FLOAT_FORMS, c_float_literal)
#: The name of a real type -> target.
REALS: Mapping[str, Target] = {"double": C99, "float": C99_FLOAT}
