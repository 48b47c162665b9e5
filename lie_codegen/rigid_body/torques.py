"""lc.torque and lc.plates: torques of the environment on a body, as plain data and as formulas over any arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.formulas import formula, parameter_values
from lie_codegen.on_demand import sympy as sp

_STATE = (*(f"X{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)), "w1", "w2", "w3", "t")
#: A direction as a function of time that is no formula.
Function = Callable[[float], ArrayLike]


@dataclass(frozen=True, eq=False, repr=False)
class Plates(Saved):
    """A convex set of flat plates in body axes; a panel is two plates, back to back. Self-shadowing is out of scope.

    Attributes:
        normals: (n, 3) outward, of unit length.
        centres: (n, 3) [m] from the centre of mass.
        areas: (n,) [m^2].
        specular, diffuse: (n,) reflected fractions.
    """

    normals: Array
    centres: Array
    areas: Array
    specular: Array
    diffuse: Array


def plates(
    normals: ArrayLike, centres: ArrayLike, areas: ArrayLike, specular: ArrayLike = 0.0, diffuse: ArrayLike = 0.0
) -> Plates:
    """Flat plates in body axes.

    Args:
        normals: (n, 3) outward normals, of any length.
        centres: (n, 3) [m] centres from the centre of mass.
        areas: (n,) [m^2], or one for all.
        specular, diffuse: (n,) fractions of the light that is reflected so, or one for all.

    Raises:
        InputError: a zero normal, a negative area, fractions below 0 or of sum above 1; the plate is named.
    """
    n, r = np.array(normals, dtype=float), np.array(centres, dtype=float)
    if n.ndim != 2 or n.shape[1] != 3 or r.shape != n.shape:
        raise ShapeError(f"plates: normals have shape {n.shape} and centres {r.shape}; both must be (n, 3)")
    try:
        rest = [np.broadcast_to(np.asarray(each, dtype=float), (len(n),)).copy() for each in (areas, specular, diffuse)]
    except ValueError:
        raise ShapeError(f"plates: areas, specular and diffuse are one number each, or {len(n)}") from None
    if not all(np.all(np.isfinite(each)) for each in (n, r, *rest)):
        raise NotFiniteError("plates: a number is NaN or infinite")
    length = np.linalg.norm(n, axis=1)
    for bad, why in (
        (length == 0, "has a normal of length zero"),
        (rest[0] < 0, "has a negative area"),
        ((rest[1] < 0) | (rest[2] < 0), "reflects a negative fraction"),
        (rest[1] + rest[2] > 1 + 1e-12, "reflects more than it receives: specular + diffuse > 1"),
    ):
        if np.any(bad):
            raise InputError(f"plates: plate {int(np.argmax(bad)) + 1} {why}")
    return Plates(n / length[:, None], r, *rest)


@dataclass(frozen=True, eq=False, repr=False)
class Torque(Saved):
    """A torque in body axes.

    Attributes:
        kind: which of `lc.torque`.
        direction: three expressions in t, a function of t, or None.
        numbers: what else it is made of.
        plates: of solar pressure and drag.
    """

    kind: str
    direction: Any
    numbers: Mapping[str, Any] = field(default_factory=dict)
    plates: Plates | None = None

    @property
    def is_function(self) -> bool:
        """Whether the direction is a Python function of t, which C asks for at each step."""
        return callable(self.direction)

    @property
    def unit(self) -> bool:
        """Whether only the direction counts, the size being in the pressure."""
        return self.plates is not None

    def direction_at(self, ops: Arithmetic, t: Scalar) -> list[Scalar]:
        """The three components at time t, of unit length where only the direction counts."""
        evaluate = ExpressionEvaluator(ops, {time_symbol(): t})
        return self.scaled(ops, [evaluate(each) for each in self.direction])

    def scaled(self, ops: Arithmetic, d: Sequence[Scalar]) -> list[Scalar]:
        """Of unit length where only the direction counts."""
        if not self.unit:
            return list(d)
        size = ops.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        return [each / size for each in d]

    def smooth(
        self, ops: Arithmetic, J: Sequence[Sequence[Scalar]], X: Any, omega: Any, d: Sequence[Scalar], t: Scalar
    ) -> list[Scalar]:
        """N in body axes, but of plates, at body to inertial X; d is the direction (or the field), inertial."""
        if self.kind == "formula":
            return self._formula(ops, X, omega, t)
        b = [X[0][i] * d[0] + X[1][i] * d[1] + X[2][i] * d[2] for i in range(3)]
        if self.kind == "gravity_gradient":
            square = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
            # b is not of unit length here: 3 mu / r^5 r x J r
            scale = ops.constant(3 * self.numbers["mu"]) / (square * square * ops.sqrt(square))
            Jb = [sum(a * c for a, c in zip(row, b, strict=True)) for row in J]
            return [scale * each for each in cross(b, Jb)]
        if self.kind == "eddy_current":
            M = self.numbers["M"]
            induced = cross(omega, b)
            moment = [sum(ops.constant(M[i][j]) * induced[j] for j in range(3)) for i in range(3)]
            return cross(moment, b)
        return cross([ops.constant(m) for m in self.numbers["m"]], b)

    def _formula(self, ops: Arithmetic, X: Any, omega: Any, t: Scalar) -> list[Scalar]:
        kernel = self.numbers.get("kernel")
        if kernel is not None:
            known = {"X": [list(row) for row in X], "omega": list(omega), "t": t}
            inputs = [
                known[port.name] if port.name in known else _constants(ops, self.numbers["parameters"][port.name])
                for port in kernel.inputs
            ]
            return list(kernel.evaluate(ops, *inputs)[0])
        values = [*(X[i][j] for i in range(3) for j in range(3)), *omega, t]
        symbols = [sp.Symbol(name, real=True) for name in _STATE]
        evaluate = ExpressionEvaluator(ops, dict(zip(symbols, values, strict=True)))
        return [evaluate(each) for each in self.numbers["formulas"]]

    @property
    def key(self) -> tuple[str, Kernel | None]:
        """What determines the kernels: a text, and the kernel of one's own, which its text would not tell from another."""
        own = None if self.plates is None else [getattr(self.plates, n).tolist() for n in Plates.__dataclass_fields__]
        numbers = {name: value for name, value in self.numbers.items() if name != "kernel"}
        direction = "function" if self.is_function else self.direction
        return f"{self.kind} {direction} {numbers} {own}", self.numbers.get("kernel")


def cross(a: Sequence[Scalar], b: Sequence[Scalar]) -> list[Scalar]:
    """a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plate_force(ops: Arithmetic, b: Any, n: Any, r: Any, numbers: Any, lit: Scalar) -> list[Scalar]:
    """-P A lit r x [(1 - rho_s) b + (2 rho_s n.b + 2/3 rho_d) n]; numbers (P A, rho_s, rho_d), lit = max(0, n.b)."""
    pressure, specular, diffuse = numbers
    along = 2 * specular * lit + 2 * diffuse / ops.constant(3)
    arm = [(1 - specular) * x + along * y for x, y in zip(b, n, strict=True)]
    return [-(pressure * lit) * each for each in cross(r, arm)]


class torque:  # noqa: N801
    """Torques of the environment: gravity_gradient, solar_pressure, drag, eddy_current, residual_dipole, formula.

    A direction (position, sun, velocity, field) is inertial: three numbers, three formulas in t and the parameters, or a
    function of t. Of `sun` and `velocity` only the direction counts, the size is in the pressure; a field keeps its size, and a
    position gives direction and distance.
    """

    @staticmethod
    def gravity_gradient(position: Any, mu: float, *, parameters: Mapping[str, Any] | None = None) -> Torque:
        """3 mu / r^3 b x J b: `position` of the body from the centre of attraction [m], mu [m^3/s^2]."""
        return Torque("gravity_gradient", _direction(position, parameters, "position"), {"mu": _number(mu, "mu")})

    @staticmethod
    def solar_pressure(
        body: Plates, sun: Any, pressure: float = 4.56e-6, *, parameters: Mapping[str, Any] | None = None
    ) -> Torque:
        """-P A max(0, n.b) r x [(1 - rho_s) b + (2 rho_s n.b + 2/3 rho_d) n] a plate; `sun` towards it, pressure P [Pa]."""
        return Torque(
            "solar_pressure",
            _direction(sun, parameters, "sun"),
            {"pressure": _number(pressure, "pressure")},
            _plates(body),
        )

    @staticmethod
    def drag(body: Plates, velocity: Any, pressure: float, *, parameters: Mapping[str, Any] | None = None) -> Torque:
        """-P A max(0, n.b) r x b a plate: `velocity` of the body against the gas, P = rho C_D v^2 / 2 [Pa]."""
        bare = _plates(body)
        dull = Plates(bare.normals, bare.centres, bare.areas, np.zeros_like(bare.areas), np.zeros_like(bare.areas))
        return Torque(
            "drag", _direction(velocity, parameters, "velocity"), {"pressure": _number(pressure, "pressure")}, dull
        )

    @staticmethod
    def eddy_current(M: ArrayLike, field: Any, *, parameters: Mapping[str, Any] | None = None) -> Torque:
        """(M (omega x b)) x b: M (3, 3) or a number [S m^4], b the magnetic `field` [T] in body axes."""
        tensor = np.array(M, dtype=float)
        tensor = tensor * np.eye(3) if tensor.ndim == 0 else tensor
        if tensor.shape != (3, 3) or not np.all(np.isfinite(tensor)):
            raise ShapeError(f"eddy_current: M has shape {tensor.shape}; a number or a finite 3 x 3 matrix")
        return Torque("eddy_current", _direction(field, parameters, "field"), {"M": tensor.tolist()})

    @staticmethod
    def residual_dipole(m: ArrayLike, field: Any, *, parameters: Mapping[str, Any] | None = None) -> Torque:
        """m x b: dipole m (3,) [A m^2] in body axes, b the magnetic `field` [T] in body axes."""
        dipole = np.array(m, dtype=float)
        if dipole.shape != (3,) or not np.all(np.isfinite(dipole)):
            raise ShapeError(f"residual_dipole: m has shape {dipole.shape}; three finite numbers")
        return Torque("residual_dipole", _direction(field, parameters, "field"), {"m": dipole.tolist()})

    @staticmethod
    def formula(formulas: Sequence[Any] | Kernel, parameters: Mapping[str, Any] | None = None) -> Torque:
        """A torque of one's own, N (3,) in body axes.

        Args:
            formulas: three formulas in X11 .. X33 (body to inertial), w1 w2 w3 [rad/s], t [s] and the parameters; or a kernel
                of any of the inputs X (3, 3), omega (3,), t, in any order, whose first output is N.
            parameters: name -> number; of a kernel its other inputs, with their shapes.

        Raises:
            InputError: not three formulas; a kernel with another shape, with complex ports or with an input that has no value.
        """
        if isinstance(formulas, Kernel):
            return Torque("formula", None, _own_kernel(formulas, parameters or {}))
        if isinstance(formulas, str) or not hasattr(formulas, "__len__") or len(formulas) != 3:
            raise InputError(f"torque.formula: three formulas or a kernel are needed, got {formulas!r:.80}")
        values = _parameters(parameters, _STATE, "torque.formula")
        names = {name: sp.Symbol(name, real=True) for name in _STATE}
        read = [formula(each, {**names, **values}, f"torque.formula: N_{i + 1}") for i, each in enumerate(formulas)]
        return Torque("formula", None, {"formulas": read})


def _own_kernel(kernel: Kernel, parameters: Mapping[str, Any]) -> dict[str, Any]:
    shapes = {"X": (3, 3), "omega": (3,), "t": ()}
    where = f"torque.formula: the kernel {kernel.symbol}"
    if any(port.is_complex for port in (*kernel.inputs, kernel.outputs[0])):
        raise InputError(f"{where} has complex ports; a torque is real")
    if kernel.outputs[0].shape != (3,):
        raise ShapeError(f"{where} gives {kernel.outputs[0].name} of shape {kernel.outputs[0].shape}; N is (3,)")
    given, names = {}, [port.name for port in kernel.inputs]
    unknown = sorted(set(parameters) - set(names) | set(parameters) & set(shapes))
    if unknown:
        raise InputError(f"{where}: the parameter {unknown[0]!r} is none of its inputs beside X, omega and t")
    for port in kernel.inputs:
        if port.name in shapes:
            if port.shape != shapes[port.name]:
                raise ShapeError(f"{where}: {port.name} has shape {port.shape}, not {shapes[port.name]}")
            continue
        if port.name not in parameters:
            raise InputError(f"{where} has the input {port.name!r}: rename it X, omega or t, or give it in parameters=")
        value = np.asarray(parameters[port.name], dtype=float)
        if value.shape != port.shape:
            raise ShapeError(f"{where}: the parameter {port.name} has shape {value.shape}, not {port.shape}")
        if not np.all(np.isfinite(value)):
            raise NotFiniteError(f"{where}: the parameter {port.name} holds NaN or infinity")
        given[port.name] = value.tolist()
    return {"kernel": kernel, "parameters": given}


def _constants(ops: Arithmetic, value: Any) -> Any:
    return [_constants(ops, each) for each in value] if isinstance(value, list) else ops.constant(value)


def _direction(value: Any, parameters: Mapping[str, Any] | None, what: str) -> Any:
    if callable(value):
        return value
    entries = value.tolist() if isinstance(value, np.ndarray) else value
    if isinstance(entries, str) or not hasattr(entries, "__len__") or len(entries) != 3:
        raise InputError(f"{what}: three numbers, three formulas in t, or a function of t, got {value!r}")
    values = _parameters(parameters, ("t",), what)
    read = tuple(formula(each, {"t": time_symbol(), **values}, f"{what} {i + 1}") for i, each in enumerate(entries))
    if all(each == 0 for each in read):
        raise InputError(f"{what}: the direction is zero")
    return read


def _parameters(parameters: Mapping[str, Any] | None, taken: Sequence[str], what: str) -> dict[str, sp.Expr]:
    values = parameter_values(parameters)
    for name, value in values.items():
        if name in taken:
            raise InputError(f"{what}: the parameter {name!r} hides a variable; rename it")
        if value.is_Symbol:
            raise InputError(f"{what}: the parameter {name!r} has no value")
    return values


def _number(value: Any, what: str) -> float:
    number = float(value)
    if not np.isfinite(number):
        raise NotFiniteError(f"{what} is {value!r}")
    return number


def _plates(body: Any) -> Plates:
    if not isinstance(body, Plates):
        raise InputError(f"expected plates of lc.plates, got {type(body).__name__}")
    return body
