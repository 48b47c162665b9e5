"""The functions that the core calls, and the numbers of everything in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Sizes:
    """Numbers of everything: group, other states, stored matrix entries, controls, parameters, conditions."""

    dim: int
    q: int
    packed: int
    m: int
    parameters: int
    path: int
    end_path: int
    end: int

    @property
    def nx(self) -> int:
        """Local coordinates of a state."""
        return self.dim + self.q


@dataclass(frozen=True)
class Model:
    """Functions by the names that the core calls them by.

    Attributes:
        sizes: numbers of everything.
        functions: CasADi SX functions, or () where none were asked for.
        needs_control: for each row of g, whether a control enters it.
        row_names: of the rows of g, then of those at the end.
    """

    sizes: Sizes
    functions: tuple[Any, ...]
    needs_control: tuple[bool, ...]
    row_names: tuple[str, ...]
