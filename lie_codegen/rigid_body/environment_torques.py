"""lc.torque: torques of the environment from what a user gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.mechanics.formulas import formula, parameter_values
from lie_codegen.on_demand import sympy as sp
from lie_codegen.rigid_body.plates import Plates, checked_plates
from lie_codegen.rigid_body.torques import STATE, Torque


class torque:  # noqa: N801
    """Torques of the environment: gravity_gradient(position, mu), solar_pressure(body, sun, pressure), drag(body, velocity, pressure),
    eddy_current(M, field), residual_dipole(m, field), formula(formulas).

    A direction (position, sun, velocity, field) is inertial: three numbers, three formulas in t and the parameters, or a
    function of t. Of `sun` and `velocity` only the direction counts, the size is in the pressure; a field keeps its size, and a
    position gives direction and distance.
    """

    @staticmethod
    def gravity_gradient(position: Any, mu: float, *, parameters: Mapping[str, Any] | None = None) -> Torque:
        """3 mu / r^3 b x J b, b the direction of the position in body axes.

        Args:
            position: of the body from the centre of attraction; as the class says. [m]
            mu: of that centre. [m^3/s^2]
            parameters: name -> number, of formulas.

        Raises:
            InputError: a position that is none, a parameter without a value.
            NotFiniteError: a mu that is NaN or infinite.
        """
        return Torque("gravity_gradient", _direction(position, parameters, "position"), {"mu": _number(mu, "mu")})

    @staticmethod
    def solar_pressure(
        body: Plates, sun: Any, pressure: float = 4.56e-6, *, parameters: Mapping[str, Any] | None = None
    ) -> Torque:
        """-P A max(0, n.b) r x [(1 - rho_s) b + (2 rho_s n.b + 2/3 rho_d) n] a plate, b the direction towards the sun in body axes.

        Args:
            body: of `plates`.
            sun: towards it; as the class says.
            pressure: P. [Pa]
            parameters: name -> number, of formulas.

        Raises:
            InputError: a direction that is none, a parameter without a value.
            NotFiniteError: a pressure that is NaN or infinite.
        """
        return Torque(
            "solar_pressure",
            _direction(sun, parameters, "sun"),
            {"pressure": _number(pressure, "pressure")},
            checked_plates(body),
        )

    @staticmethod
    def drag(body: Plates, velocity: Any, pressure: float, *, parameters: Mapping[str, Any] | None = None) -> Torque:
        """-P A max(0, n.b) r x b a plate, b the direction of the velocity in body axes, n its normal, r its centre.

        Args:
            body: of `plates`.
            velocity: of the body against the gas; as the class says.
            pressure: P = rho C_D v^2 / 2. [Pa]
            parameters: name -> number, of formulas.

        Raises:
            InputError: a direction that is none, a parameter without a value.
            NotFiniteError: a pressure that is NaN or infinite.
        """
        bare = checked_plates(body)
        dull = Plates(bare.normals, bare.centres, bare.areas, np.zeros_like(bare.areas), np.zeros_like(bare.areas))
        return Torque(
            "drag", _direction(velocity, parameters, "velocity"), {"pressure": _number(pressure, "pressure")}, dull
        )

    @staticmethod
    def eddy_current(M: ArrayLike, field: Any, *, parameters: Mapping[str, Any] | None = None) -> Torque:
        """(M (omega x b)) x b, b the magnetic field in body axes.

        Args:
            M: (3, 3) or a number. [S m^4]
            field: as the class says. [T]
            parameters: name -> number, of formulas.

        Raises:
            InputError: a field that is none, a parameter without a value.
            ShapeError: an M of another shape, or not finite.
        """
        tensor = np.array(M, dtype=float)
        tensor = tensor * np.eye(3) if tensor.ndim == 0 else tensor
        if tensor.shape != (3, 3) or not np.all(np.isfinite(tensor)):
            raise ShapeError(f"eddy_current: M has shape {tensor.shape}; a number or a finite 3 x 3 matrix")
        return Torque("eddy_current", _direction(field, parameters, "field"), {"M": tensor.tolist()})

    @staticmethod
    def residual_dipole(m: ArrayLike, field: Any, *, parameters: Mapping[str, Any] | None = None) -> Torque:
        """m x b, b the magnetic field in body axes.

        Args:
            m: (3,) dipole in body axes. [A m^2]
            field: as the class says. [T]
            parameters: name -> number, of formulas.

        Raises:
            InputError: a field that is none, a parameter without a value.
            ShapeError: an m that is not three finite numbers.
        """
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
        values = _parameters(parameters, STATE, "torque.formula")
        names = {name: sp.Symbol(name, real=True) for name in STATE}
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
