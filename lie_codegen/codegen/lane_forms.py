"""Operations of a tape as C over lanes."""

from __future__ import annotations

from collections.abc import Mapping

#: Operation -> C expression over vectors {0}, {1}, {2}.
LANE_FORMS: Mapping[str, str] = {
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
    "SQRT": "lcg_sqrt({0})",
    "EXP": "lcg_exp({0})",
    "EXPM1": "lcg_expm1({0})",
    "LOG": "lcg_log({0})",
    "SIN": "lcg_sin({0})",
    "COS": "lcg_cos({0})",
    "TAN": "lcg_tan({0})",
    "ASIN": "lcg_asin({0})",
    "ACOS": "lcg_acos({0})",
    "ATAN": "lcg_atan({0})",
    "ATAN2": "lcg_atan2({0}, {1})",
    "SINH": "lcg_sinh({0})",
    "COSH": "lcg_cosh({0})",
    "TANH": "lcg_tanh({0})",
    "FABS": "lcg_fabs({0})",
    "FLOOR": "lcg_floor({0})",
    "CEIL": "lcg_ceil({0})",
    "COPYSIGN": "lcg_copysign({0}, {1})",
    "FMIN": "lcg_fmin({0}, {1})",
    "FMAX": "lcg_fmax({0}, {1})",
    "SIGN": "lcg_sign({0})",
}
#: Of conditions: the operands of the first four are numbers, of the others conditions; the result is a mask.
MASK_FORMS: Mapping[str, str] = {
    "LT": "lcg_lt({0}, {1})",
    "LE": "lcg_le({0}, {1})",
    "EQ": "lcg_eq({0}, {1})",
    "NE": "lcg_ne({0}, {1})",
    "NOT": "lcg_not({0})",
    "AND": "(lcg_m)({0} & {1})",
    "OR": "(lcg_m)({0} | {1})",
}
OF_MASKS = frozenset({"NOT", "AND", "OR"})
#: The first operand is a condition.
CHOICE_FORMS: Mapping[str, str] = {
    "IF_ELSE_ZERO": "lcg_select({0}, {1}, lcg_splat(0.0))",
    "SELECT": "lcg_select({0}, {1}, {2})",
}
#: Without a lane form: libm, one lane after another. The build log says so.
SLOW_FORMS: Mapping[str, str] = {
    "POW": "lcg_each2(pow, {0}, {1})",
    "CONSTPOW": "lcg_each2(pow, {0}, {1})",
    "LOG1P": "lcg_each(log1p, {0})",
    "ASINH": "lcg_each(asinh, {0})",
    "ACOSH": "lcg_each(acosh, {0})",
    "ATANH": "lcg_each(atanh, {0})",
    "ERF": "lcg_each(erf, {0})",
    "HYPOT": "lcg_each2(hypot, {0}, {1})",
    "FMOD": "lcg_each2(fmod, {0}, {1})",
    "REMAINDER": "lcg_each2(remainder, {0}, {1})",
}
