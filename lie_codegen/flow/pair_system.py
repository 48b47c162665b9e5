"""X' = X hat(xi), y' = F(t, X, y) as compiled kernels, and as the C of templates/pair853.c reads them."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate
from typing import Any

import numpy as np

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.arrays import Array
from lie_codegen.flow.pair_library import STAGES, Pair, compiled_pair, pair_library
from lie_codegen.kernel.kernel import Port
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.pair_headers import two_files


@dataclass(frozen=True, eq=False)
class System:
    """What is integrated.

    Attributes:
        rate: kernel (X packed, y, t, numbers...) -> y', y = (Theta, xi, ...); or (y, t, numbers...) -> y' where y holds the elements.
        move: kernel (X packed, Theta) -> X exp(Theta), packed; or (elements of y) -> X packed.
        group: entries of y in front, Theta or the elements.
        reach: |Theta| up to which a step may go.
        numbers: the other inputs of the rate in its order, of all members (*shape) or one each (N, *shape).
        steady: whether the rate is known not to read t. Another may change within a moment that only steps which end at all times
            that were asked for get past.
        algebra: of the group, where y begins (Theta, xi, ...) with X' = X hat(xi) and the rate is steady: then states between
            steps are interpolated. None elsewhere. Of elements in y nothing is needed.
        lift: kernel (X packed) -> elements of y, which begin with so many `quaternions`; None where y begins with Theta.
    """

    rate: Compiled[Any]
    move: Compiled[Any]
    group: int
    reach: float
    numbers: tuple[Array, ...] = ()
    steady: bool = False
    algebra: LieAlgebra | None = None
    lift: Compiled[Any] | None = None
    quaternions: int = 0

    @cached_property
    def packed(self) -> int:
        """Doubles of X."""
        return int(self.move.outputs[0].size)

    @cached_property
    def size(self) -> int:
        """Doubles of y."""
        return int(self.rate.outputs[0].size)

    @cached_property
    def kept(self) -> int:
        """Doubles of X that a knot keeps beside y."""
        return self.packed if self.lift is None else 0

    @cached_property
    def turns(self) -> int:
        """Doubles of Theta in y."""
        return self.group if self.lift is None else 0

    @cached_property
    def is_interpolated(self) -> bool:
        """Whether states between steps follow from knots."""
        return self.algebra is not None if self.lift is None else self.steady

    @cached_property
    def number_ports(self) -> tuple[Port, ...]:
        """Inputs of the rate beside X, y and t."""
        return self.rate.inputs[3 if self.lift is None else 2 :]

    @cached_property
    def compiled(self) -> bool:
        """Whether compiled loops can call it."""
        return bool(self.rate.backend.address(many=False)) and pair_library() is not None

    def of_members(self, which: Any) -> System:
        """That of some of the members."""
        kept = [v[which] if self._is_own(k) else v for k, v in enumerate(self.numbers)]
        return replace(self, numbers=tuple(kept))

    def within(self, part: float) -> System:
        """The same with steps that go so much less far."""
        return self if part == 1 else replace(self, reach=self.reach * part)

    @cached_property
    def work_size(self) -> int:
        """Doubles that a step of a single member works with, as templates/pair853.c lays them out."""
        wide = -(-self.size // 8) * 8
        return wide * (STAGES + 4) + 2 * self.packed

    @cached_property
    def brackets(self) -> tuple[Array, Array]:
        """(m, 3) and (m,): [A_i, A_j] = sum_k c A_k of i < j, as indices i, j, k and c."""
        c = np.zeros((1, 1, 1)) if self.algebra is None else self.algebra.structure_constants
        index = np.argwhere(c)
        index = index[index[:, 0] < index[:, 1]]
        return np.ascontiguousarray(index, dtype=np.intp), np.ascontiguousarray(c[tuple(index.T)])

    @cached_property
    def between_size(self) -> int:
        """Doubles that interpolation works with."""
        return int(compiled_pair().between_size(self.turns, self.size))

    def work(self) -> Array:
        """Room for a step."""
        return np.empty(self.work_size)

    @cached_property
    def idle(self) -> list[Any]:
        """Memory of runs that are over, for the next ones."""
        return []

    @cached_property
    def _one(self) -> tuple[int, int]:
        """Where rate and move of one member are."""
        return self.rate.backend.address(many=False), self.move.backend.address(many=False)

    @cached_property
    def blocks(self) -> tuple[int, int]:
        """Where those of eight members at once are, which are compiled when they are first asked for; 0 where they cannot be.

        From elements to X it goes member by member.
        """
        return self.rate.backend.address(many=True), self.move.backend.address(many=self.lift is None)

    @cached_property
    def both(self) -> int:
        """Where the step of two runs at once is, compiled for this rate when it is first asked for; 0 where it cannot be."""
        offsets = [0, *accumulate(port.size for port in self.number_ports)]
        inputs = [*(["X"] if self.lift is None else []), "y", "t", *(f"(n) + {place}" for place in offsets[:-1])]
        flags = (
            f"-DPAIR_RATE(X,y,t,n,rate)={self.rate.signature.symbol}_lanes({','.join(inputs)},rate)",
            "-fwhole-program",
            f"-DPAIR_SIZE={self.size}",
            f"-DPAIR_PACKED={self.kept}",
            f"-DPAIR_TURNS={self.turns}",
            f"-DPAIR_FRONT={self.group}",
            f"-DPAIR_NUMBERS={offsets[-1]}",
            f"-DPAIR_NUMBER_SIZES={','.join(str(port.size) for port in self.number_ports)}{',' if self.number_ports else ''}0",
        )
        return self.rate.backend.beside("pair_two", "pair_two.c", two_files(), flags)

    @cached_property
    def lifting(self) -> int:
        """Where `lift` is; 0 where there is none."""
        return 0 if self.lift is None else self.lift.backend.address(many=False)

    def members_numbers(self) -> tuple[list[Array], list[int]]:
        """The numbers as C reads them, and how far it is from one member to the next: 0 where all have the same."""
        numbers = [np.ascontiguousarray(v, dtype=float) for v in self.numbers]
        return numbers, [v[0].size if self._is_own(k) else 0 for k, v in enumerate(numbers)]

    def record(self) -> Pair:
        """The system of a single member as the C reads it: what it points to stays as long as the system does."""
        return Pair.from_buffer_copy(self._record[0])

    @cached_property
    def _record(self) -> tuple[Pair, Sequence[Any]]:
        """The same, and what has to stay."""
        numbers, _strides = self.members_numbers()
        pointers = (ctypes.c_void_p * max(1, len(numbers)))(*(v.ctypes.data for v in numbers))
        given = Pair()
        given.rate, given.move = self._one
        given.lift, given.front, given.quaternions = self.lifting, self.group, self.quaternions
        given.packed, given.group, given.size, given.reach = self.packed, self.turns, self.size, self.reach
        given.numbers, given.number = len(numbers), ctypes.addressof(pointers)
        index, c = self.brackets
        given.algebra, given.brackets, given.bracket_index, given.bracket_c = (
            self.turns, len(c), index.ctypes.data, c.ctypes.data
        )  # fmt: skip
        return given, (numbers, pointers, index, c)

    def _is_own(self, k: int) -> bool:
        return bool(self.numbers[k].ndim > len(self.number_ports[k].shape))
