"""All that the shape of a transcription depends on, and the layout of its variables and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from lie_codegen.groups.maps.element_pattern import packed_size, varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup

#: Kinds of nodes by the conditions that hold there.
KINDS = ("first", "inner", "via", "last")


@dataclass(frozen=True)
class Structure:
    """The shape of the program.

    Attributes:
        group, controls: the system.
        intervals: N.
        cones, balls, solids: how many of each; solids are boxes and cylinders.
        via: nodes at which X is given.
        free_time: whether the duration is a variable, and the objective.
        second_order: whether the controls are torques, the state (X, xi).
        periodic: whether the controls end as they begin.
        free: how many directions of the algebra the goal leaves free: X meets target exp(hat(F h)), h a variable.
        guarded: whether the half-space around an element to meet is a condition too: the equations alone also hold half a
            turn away.
    """

    group: MatrixGroup
    controls: tuple[int, ...]
    intervals: int
    cones: int = 0
    balls: int = 0
    solids: int = 0
    via: tuple[int, ...] = ()
    free_time: bool = False
    second_order: bool = False
    periodic: bool = False
    free: int = 0
    guarded: bool = False

    @cached_property
    def size(self) -> int:
        """Doubles of a packed element."""
        return packed_size(self.group)

    @cached_property
    def positions(self) -> tuple[int, ...]:
        """Where the packed entries are in an element, row by row."""
        return tuple(self.group.degree * i + j for i, j in varying_entries(self.group))

    @cached_property
    def variable_ranges(self) -> dict[str, tuple[int, int]]:
        """Where each part of a stage (X, xi, v, s, h, r) is."""
        m = len(self.controls)
        return _ranges(
            ("X", self.size),
            ("xi", self.group.dim if self.second_order else 0),
            ("v", m),
            ("s", 1 if self.free_time else 0),
            ("h", self.free),
            ("r", m),
        )

    @cached_property
    def parameter_ranges(self) -> dict[str, tuple[int, int]]:
        """Where each part of the parameters is."""
        n = self.group.dim
        return _ranges(
            ("target", self.size),
            ("drift", n),
            ("weights", len(self.controls)),
            ("cones", 7 * self.cones),
            ("balls", self.group.degree * self.balls),
            ("solids", self.solid * self.solids),
            ("via", self.size * len(self.via)),
            ("rates", len(self.controls)),
            ("masses", 2 * n * n if self.second_order else 0),
            ("free", n * self.free),
        )

    @property
    def solid(self) -> int:
        """Numbers of a solid: its center, axes, half sizes, whether it is a cylinder, its rounding."""
        q = self.group.degree - 1
        return q * q + 2 * q + 2

    @property
    def stage(self) -> int:
        """Variables of a stage without its rates: what the next one is computed of."""
        return self.variable_ranges["r"][0]

    @property
    def width(self) -> int:
        """Variables of a stage."""
        return self.variable_ranges["r"][1]

    @property
    def variables(self) -> int:
        """All variables: the last stage has no rates."""
        return self.intervals * self.width + self.stage

    @property
    def parameters(self) -> int:
        """All parameters."""
        return self.parameter_ranges["free"][1]

    def kind(self, node: int) -> str:
        """Which conditions hold at a node."""
        if node in (0, self.intervals):
            return "last" if node else "first"
        return "via" if node in self.via else "inner"

    def watched(self, kind: str) -> bool:
        """Whether obstacles are kept away from at nodes of that kind: where X is given that was looked at before."""
        return kind in ("inner", "via") or (kind == "last" and self.free > 0)

    def goal(self, node: int) -> int:
        """Where the element to meet at a node is among the parameters."""
        if node in self.via:
            return self.parameter_ranges["via"][0] + self.size * self.via.index(node)
        return self.parameter_ranges["target"][0]


def _ranges(*sizes: tuple[str, int]) -> dict[str, tuple[int, int]]:
    ranges, start = {}, 0
    for name, size in sizes:
        ranges[name] = (start, start + size)
        start += size
    return ranges
