"""Compiled kernels as objects of the extension type: the same calls, a hundred times sooner."""

from __future__ import annotations

import copyreg
import ctypes
from functools import cache, wraps
from typing import Any, cast

from lie_codegen.codegen.signature import Signature
from lie_codegen.kernel.kernel import Port
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.extension import extension
from lie_codegen.runtime.lane_library import LaneLibrary

_MOST_PORTS = 32


def extension_function(
    compiled: Compiled[Any], library: ctypes.CDLL, lanes: LaneLibrary, signature: Signature
) -> Compiled[Any]:
    """`compiled` behind a fast path for exact arguments; itself where there is no extension, or it computes in floats.

    What the fast path does not take, and every attribute but `batch`, is that of `compiled`.
    """
    module = extension()
    if module is None or signature.real != "double" or len(signature.inputs + signature.outputs) > _MOST_PORTS:
        return compiled
    inputs, outputs = _plain(signature.inputs), _plain(signature.outputs)

    @cache
    def batch() -> Any:
        address = _address(lanes.open(), f"{signature.symbol}_batch")
        return module.function(0, address, inputs, outputs, compiled.batch, compiled.batch, None, compiled.result_type)

    @wraps(compiled.batch)
    def samples(*args: Any, **named: Any) -> Any:
        return batch()(*args, **named)

    call = _address(library, f"{signature.symbol}_call")
    fast = module.function(call, 0, inputs, outputs, compiled, compiled, samples, compiled.result_type)
    copyreg.pickle(type(fast), _reduced)  # the type is compiled with the extension, so it cannot say this itself
    return cast("Compiled[Any]", fast)


def _reduced(fast: Any) -> tuple[Any, ...]:
    reduced: tuple[Any, ...] = fast.reduced()
    return reduced


def _address(library: ctypes.CDLL, symbol: str) -> int:
    return ctypes.cast(library[symbol], ctypes.c_void_p).value or 0


def _plain(ports: tuple[Port, ...]) -> tuple[tuple[str, tuple[int, ...], bool], ...]:
    return tuple((port.name, port.shape, port.is_complex) for port in ports)
