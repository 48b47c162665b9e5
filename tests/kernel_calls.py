"""Kernels of a group as numpy functions, by the CasADi interpreter: complex arrays in and out, flat vectors inside."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

import lie_codegen as lc
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.kernel.kernel import Kernel, Port


@cache
def load(name: str) -> MatrixGroup:
    return lc.group(name)


@cache
def kernel(name: str, kernel_name: str) -> Kernel:
    return group_kernel(load(name), kernel_name)


@cache
def function(name: str, kernel_name: str) -> ca.Function:
    return function_of(kernel(name, kernel_name))


def call(name: str, kernel_name: str, *arguments: Any) -> np.ndarray:
    k = kernel(name, kernel_name)
    flat = [flatten(port, value) for port, value in zip(k.inputs, arguments, strict=True)]
    return unflatten(k.outputs[0], np.array(function(name, kernel_name)(*flat)))


@cache
def function_of_group(group: MatrixGroup, kernel_name: str) -> ca.Function:
    return function_of(group_kernel(group, kernel_name))


def call_group(group: MatrixGroup, kernel_name: str, *arguments: Any) -> np.ndarray:
    """The same of a group that has no name of its own."""
    k = group_kernel(group, kernel_name)
    flat = [flatten(port, value) for port, value in zip(k.inputs, arguments, strict=True)]
    return unflatten(k.outputs[0], np.array(function_of_group(group, kernel_name)(*flat)))


def interpreted(kernel: Kernel) -> Callable[..., list[np.ndarray]]:
    """The kernel by the CasADi interpreter, called thousands of times: arrays in, flat outputs out, through buffers that are laid once."""
    function = function_of(kernel)
    given, made = ([np.zeros(port.size) for port in ports] for ports in (kernel.inputs, kernel.outputs))
    buffer, evaluate = function.buffer()
    for place, array in enumerate(given):
        buffer.set_arg(place, memoryview(array))
    for place, array in enumerate(made):
        buffer.set_res(place, memoryview(array))

    def call(*arguments: Any, kept: Any = (function, buffer)) -> list[np.ndarray]:
        for array, value in zip(given, arguments, strict=True):
            array[:] = np.ravel(value)
        evaluate()
        return [array.copy() for array in made]

    return call


def flatten(port: Port, value: Any) -> np.ndarray:
    array = np.asarray(value, dtype=complex if port.is_complex else float)
    return np.stack([array.real, array.imag], axis=-1).ravel() if port.is_complex else array.ravel()


def unflatten(port: Port, flat: np.ndarray) -> np.ndarray:
    values = flat.ravel()
    return (values[::2] + 1j * values[1::2] if port.is_complex else values).reshape(port.shape)


def adjoint_matrix(group: MatrixGroup, x: np.ndarray) -> np.ndarray:
    """ad_x from commutators of matrices: shares nothing with the structure constants."""
    X = group.hat(x)
    return np.array([group.vee(X @ A - A @ X) for A in group.basis]).T
