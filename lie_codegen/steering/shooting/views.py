"""What the templates of the shooting solver see."""

from __future__ import annotations

from dataclasses import dataclass

from lie_codegen.codegen.views import StatementView
from lie_codegen.steering.shooting.defaults import Defaults


@dataclass(frozen=True)
class Store:
    """<parameter>[entry] = <value>; a literal needs spreading over the lanes."""

    parameter: str
    entry: int
    value: str
    is_literal: bool


@dataclass(frozen=True)
class LaneKernel:
    """One static C function over lanes."""

    name: str
    formula: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    unused: tuple[str, ...]
    statements: tuple[StatementView, ...]
    stores: tuple[Store, ...]


@dataclass(frozen=True)
class SteeringView:
    """What the templates see."""

    prefix: str
    title: str
    labels: tuple[str, ...]
    dim: int
    degree: int
    is_complex: bool
    size: int
    full_size: int
    controls: tuple[int, ...]
    identity: tuple[str, ...]
    varying: tuple[int, ...]
    first: tuple[int, ...]
    second: tuple[int, ...]
    areas: tuple[tuple[str, ...], ...]
    cosines: tuple[str, ...]
    quiet_rounds: int
    is_deep: bool
    wave_size: str
    lengths: tuple[int, ...]
    depth: int
    seed_steps: int
    relaxations: int
    kernels: tuple[LaneKernel, ...]
    defaults: Defaults
