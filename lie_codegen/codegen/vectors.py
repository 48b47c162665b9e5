"""Test vectors: admissible inputs and what CasADi's interpreter answers to them."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lie_codegen.errors import CodegenError
from lie_codegen.kernel.kernel import Kernel

#: Vectors a kernel.
COUNT = 8


@dataclass(frozen=True)
class TestVector:
    """Flat C-order doubles, a tuple a port."""

    __test__ = False

    inputs: tuple[tuple[float, ...], ...]
    outputs: tuple[tuple[float, ...], ...]


def make_vectors(kernel: Kernel, count: int = COUNT, real: str = "double") -> tuple[TestVector, ...]:
    """`count` vectors, seeded by the kernel's symbol alone; for real = "float" the inputs are floats.

    Raises:
        CodegenError: the sampler gives a wrong shape, or a sample has no finite answer.
    """
    from lie_codegen.kernel.casadi_arithmetic import flatten, function_of

    function = function_of(kernel)
    rounded: Callable[[float], float] = _as_float if real == "float" else float
    rng = random.Random(kernel.symbol)  # a string seed does not depend on PYTHONHASHSEED
    vectors = []
    for _ in range(count):
        sample = kernel.sample(rng)
        inputs = tuple(
            tuple(rounded(float(entry)) for entry in flatten(port, value))
            for port, value in zip(kernel.inputs, sample, strict=True)
        )
        for port, values in zip(kernel.inputs, inputs, strict=True):
            if len(values) != port.size:
                raise CodegenError(f"kernel {kernel.symbol}: sample of {port.name} has {len(values)} entries")
        results = function.call([list(values) for values in inputs])
        outputs = tuple(tuple(float(entry) for entry in result.nonzeros()) for result in results)
        if any(entry - entry != 0.0 for values in inputs + outputs for entry in values):
            raise CodegenError(f"kernel {kernel.symbol} is not finite at its own sample {inputs}: mend the sampler")
        vectors.append(TestVector(inputs, outputs))
    return tuple(vectors)


def _as_float(entry: float) -> float:
    return float(np.float32(entry))
