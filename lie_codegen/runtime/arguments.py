"""From what a caller passes to checked arrays: the one place where shapes and types are judged."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.codegen.signature import Signature
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.kernel.kernel import Port
from lie_codegen.lost_parts import has_masks
from lie_codegen.runtime.outputs import empty

#: The name of a real type -> (of real entries, of complex ones).
DTYPES: dict[str, tuple[np.dtype[Any], np.dtype[Any]]] = {
    "double": (np.dtype(np.float64), np.dtype(np.complex128)),
    "float": (np.dtype(np.float32), np.dtype(np.complex64)),
}


def dtype_of(port: Port, real: str = "double") -> np.dtype[Any]:
    """float64 or complex128; in floats float32 or complex64."""
    return DTYPES[real][port.is_complex]


@lru_cache(maxsize=256)
def named_results(name: str, fields: tuple[str, ...]) -> Any:
    """The class of a call's results; to make one takes longer than most kernels."""
    return namedtuple(name, fields)


def bind(signature: Signature, args: Sequence[Any], named: Mapping[str, Any]) -> list[Any]:
    """Positional and keyword arguments in the order of the ports.

    Raises:
        ShapeError: one is missing, unknown, or given twice.
    """
    names = [port.name for port in signature.inputs]
    if len(args) > len(names):
        raise ShapeError(f"{signature.name} takes {_count(names)}, {len(args)} given")
    values = dict(zip(names, args, strict=False))
    for name, value in named.items():
        if name not in names:
            raise ShapeError(f"{signature.name} has no argument {name!r}: it takes {_count(names)}")
        if name in values:
            raise ShapeError(f"{signature.name}: argument {name!r} given twice")
        values[name] = value
    missing = [name for name in names if name not in values]
    if missing:
        raise ShapeError(f"{signature.name}: missing {', '.join(missing)}; it takes {_count(names)}")
    return [values[name] for name in names]


def as_array(kernel: str, port: Port, value: Any, real: str = "double") -> Array:
    """Any numbers as a C-contiguous, aligned array of the port's type, of any shape.

    Raises:
        ShapeError: not numbers, ragged, or complex where the port is real.
        InputError: masked entries; a number that is beyond the floats, where they are asked for.
    """
    wanted = dtype_of(port, real)
    if type(value) is np.ndarray and value.dtype is wanted and value.flags.c_contiguous and value.flags.aligned:
        return value
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ShapeError(f"{kernel}: {port.name} is ragged: expected {describe(port)}") from error
    if has_masks((value,)):
        raise InputError(f"{kernel}: {port.name} has masked entries, which are no numbers; fill them (.filled(...))")
    if array.dtype.kind == "c" and not port.is_complex:
        raise ShapeError(f"{kernel}: {port.name} is real, {describe(port)}; complex numbers were given")
    if array.dtype.kind not in "biufc":
        raise ShapeError(f"{kernel}: {port.name} takes numbers, {describe(port)}; given {type(value).__name__}")
    if real == "double":
        return np.require(array, dtype=wanted, requirements=["C", "A"]).reshape(array.shape)
    try:
        with np.errstate(over="raise"):
            return np.require(array, dtype=wanted, requirements=["C", "A"]).reshape(array.shape)
    except FloatingPointError as error:
        raise InputError(
            f"{kernel}: {port.name} has a number beyond 3.4e38, which no float is; compute in doubles"
        ) from error


def checked(kernel: str, port: Port, value: Any, real: str = "double") -> Array:
    """As `as_array`, of exactly the port's shape.

    Raises:
        ShapeError: any other shape.
    """
    array = as_array(kernel, port, value, real)
    if array.shape != port.shape:
        raise ShapeError(f"{kernel}: {port.name} has shape {port.shape}, given {array.shape}")
    return array


def sequences(
    signature: Signature, values: Sequence[Any], axis: str, ports: Sequence[Port]
) -> tuple[list[Array], list[int], int | None]:
    """Arrays with or without a leading axis, their strides in doubles, and its length (None if none has it).

    Raises:
        ShapeError: a shape that is neither, or two lengths.
    """
    arrays, strides, length, first = [], [], None, ""
    for port, value in zip(ports, values, strict=True):
        array = as_array(signature.name, port, value, signature.real)
        if array.shape == port.shape:
            strides.append(0)
        elif array.shape[1:] == port.shape and array.ndim:
            if length is not None and len(array) != length:
                raise ShapeError(
                    f"{signature.name}: {first} has {length} {axis}, {port.name} has {len(array)}: give one number"
                )
            length, first = len(array), first or port.name
            strides.append(port.size)
        else:
            expected = ", ".join(["N", *map(str, port.shape)]) + ("," if not port.shape else "")
            raise ShapeError(
                f"{signature.name}: {port.name} has shape {port.shape}, or ({expected}) for N {axis}; "
                f"given {array.shape}"
            )
        arrays.append(array)
    return arrays, strides, length


def outputs_for(signature: Signature, out: Any, lead: tuple[int, ...]) -> list[Array]:
    """New output arrays, or the caller's, checked.

    Raises:
        ShapeError: `out` is not what the kernel returns, to the last detail.
    """
    ports = signature.outputs
    if out is None:
        return [empty(lead + port.shape, dtype_of(port, signature.real)) for port in ports]
    given = list(out) if isinstance(out, (tuple, list)) else [out]
    if len(given) != len(ports):
        raise ShapeError(f"{signature.name} has {len(ports)} outputs, out= has {len(given)}")
    for port, array in zip(ports, given, strict=True):
        shape, dtype = lead + port.shape, dtype_of(port, signature.real)
        if not isinstance(array, np.ndarray) or array.shape != shape or array.dtype != dtype or not array.flags.carray:
            raise ShapeError(
                f"{signature.name}: out= for {port.name} must be a writable C-contiguous array, {dtype} {shape}; "
                f"given {_describe_array(array)}"
            )
    for index, array in enumerate(given):
        if any(np.may_share_memory(array, other) for other in given[:index]):
            raise ShapeError(f"{signature.name}: two arrays of out= share memory")
    return given


def unshared(inputs: list[Array], outputs: list[Array]) -> list[Array]:
    """Inputs, copied where a write to an output could change a sample that is yet to be read."""
    return [
        array.copy() if any(np.may_share_memory(array, output) for output in outputs) else array for array in inputs
    ]


def describe(port: Port) -> str:
    """Shape of a port, in words."""
    kind = "complex" if port.is_complex else "real"
    return f"a {kind} scalar" if not port.shape else f"{kind} of shape {port.shape}"


def _describe_array(array: Any) -> str:
    if not isinstance(array, np.ndarray):
        return type(array).__name__
    layout = "" if array.flags.carray else ", not writable and C-contiguous"
    return f"{array.dtype} {array.shape}{layout}"


def _count(names: Sequence[str]) -> str:
    return f"{len(names)} ({', '.join(names)})"
