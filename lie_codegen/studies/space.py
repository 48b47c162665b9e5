"""The inputs of a study: names and what each is drawn from, as columns of values by sample index."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.studies.designs import Designed, LatinHypercube, Sobol
from lie_codegen.studies.distributions import Distribution, Grid, Joint
from lie_codegen.studies.draws import uniforms

_LARGEST_DESIGN = 20_000_000


class Space:
    """Inputs by name.

    A value is a Distribution, a Joint under a tuple of names, a list or an array (a Grid), a constant, or a function of other
    inputs, which it takes by the names of its arguments, as whole columns.
    """

    def __init__(self, space: Mapping[Any, Any]) -> None:
        if not isinstance(space, Mapping):
            raise InputError(f"study: space maps names of inputs to what they are drawn from, given {space!r:.60}")
        self.inputs: dict[tuple[str, ...], Any] = {}
        self.derived: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {}
        for key, value in space.items():
            names = (key,) if isinstance(key, str) else tuple(key) if isinstance(key, tuple) else ()
            if not names or not all(isinstance(name, str) and name.isidentifier() for name in names):
                raise InputError(f"study: {key!r:.60} is no name of an input")
            if isinstance(value, Joint) != isinstance(key, tuple):
                raise InputError(f"study: {key!r:.60}: several names take a Joint, and a Joint several names")
            if callable(value) and not isinstance(value, Distribution):
                self.derived[names[0]] = (value, tuple(inspect.signature(value).parameters))
            else:
                self.inputs[names] = value if isinstance(value, Distribution) else _plain(names[0], value)
        given = [name for names in self.inputs for name in names]
        twice = sorted({name for name in given if given.count(name) > 1})
        if twice:
            raise InputError(f"study: {', '.join(twice)} is given twice")
        self._order_derived(set(given))

    def _order_derived(self, known: set[str]) -> None:
        """Functions after the inputs that they take."""
        ordered: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {}
        while len(ordered) < len(self.derived):
            ready = {
                name: each
                for name, each in self.derived.items()
                if name not in ordered and {*each[1]} <= known | {*ordered}
            }
            if not ready:
                left = [
                    f"{name} needs {', '.join(sorted({*each[1]} - known - {*ordered}))}"
                    for name, each in self.derived.items()
                    if name not in ordered
                ]
                raise InputError(f"study: {'; '.join(left)}: no such inputs, or a circle")
            ordered.update(ready)
        self.derived = ordered

    @property
    def names(self) -> tuple[str, ...]:
        """All inputs."""
        return (*(name for names in self.inputs for name in names), *self.derived)

    @property
    def grids(self) -> dict[str, Grid]:
        """Those that are gone through."""
        return {names[0]: value for names, value in self.inputs.items() if isinstance(value, Grid)}

    @property
    def whole(self) -> int | None:
        """Samples of the product of the grids; None without a grid."""
        return int(np.prod([len(grid) for grid in self.grids.values()])) if self.grids else None

    @property
    def fixed_size(self) -> bool:
        """Whether the number of samples cannot be changed later."""
        return any(isinstance(value, LatinHypercube) for value in self.inputs.values())

    def columns(self, seed: int, first: int, count: int, n: int) -> dict[str, Array]:
        """name -> (count, ...) values of the samples first, first + 1, ... of n."""
        designed: dict[type[Designed], dict[str, Array]] = {
            kind: self._design(kind, seed, first, count, n)
            for kind in (Sobol, LatinHypercube)
            if any(isinstance(value, kind) for value in self.inputs.values())
        }
        places = self._grid_places(first, count)
        found: dict[str, Array] = {}
        for names, value in self.inputs.items():
            if isinstance(value, Grid):
                found[names[0]] = value.values[places[names[0]]]
            elif isinstance(value, Joint):
                found.update(value.columns(names, uniforms(seed, ",".join(names), first, count, value.slots)))
            elif isinstance(value, Designed):
                found[names[0]] = value.draw(designed[type(value)][names[0]])
            elif isinstance(value, Distribution):
                found[names[0]] = value.draw(uniforms(seed, names[0], first, count, value.slots))
            else:
                found[names[0]] = np.broadcast_to(value, (count, *np.shape(value))).copy()
        for name, (function, needs) in self.derived.items():
            column = np.asarray(function(**{need: found[need] for need in needs}))
            if column.shape[:1] != (count,):
                raise ShapeError(
                    f"study: the function of {name} gives shape {column.shape} for {count} samples; the first axis counts them"
                )
            found[name] = column
        return found

    def _grid_places(self, first: int, count: int) -> dict[str, Array]:
        """Digits of the sample index in the mixed radix of the grids, the last one fastest."""
        index = np.arange(first, first + count)
        places: dict[str, Array] = {}
        for name, grid in reversed(self.grids.items()):
            places[name] = index % len(grid)
            index = index // len(grid)
        return places

    def _design(self, kind: type[Designed], seed: int, first: int, count: int, n: int) -> dict[str, Array]:
        members = [(names[0], value.slots) for names, value in self.inputs.items() if isinstance(value, kind)]
        size = sum(slots for _, slots in members)
        points = _sobol(size, seed, first, count) if kind is Sobol else _hypercube(size, seed, n)[first : first + count]
        ends = np.cumsum([slots for _, slots in members])[:-1]
        return dict(zip((name for name, _ in members), np.split(points, ends, axis=1), strict=True))


def _sobol(size: int, seed: int, first: int, count: int) -> Array:
    from scipy.stats import qmc

    sequence = qmc.Sobol(size, scramble=True, seed=seed)
    if first:
        sequence.fast_forward(first)
    with warnings.catch_warnings():
        # scipy warns of counts that are no powers of two, which is a matter of the whole study and not of a chunk
        warnings.simplefilter("ignore", UserWarning)
        points = sequence.random(count)
    # a scrambled point may be 0 to the last bit, where a quantile function has no value
    return np.asarray(np.clip(points, 2.0**-54, 1 - 2.0**-53))


@lru_cache(maxsize=2)
def _hypercube(size: int, seed: int, n: int) -> Array:
    from scipy.stats import qmc

    if size * n > _LARGEST_DESIGN:
        raise InputError(
            f"study: a Latin hypercube of {n} samples and {size} numbers is laid out at once, at most {_LARGEST_DESIGN}; use Sobol"
        )
    return np.asarray(np.clip(qmc.LatinHypercube(size, seed=seed).random(n), 2.0**-54, 1 - 2.0**-53))


def _plain(name: str, value: Any) -> Any:
    """A list is a grid; a number or a text a constant."""
    if isinstance(value, list | tuple | np.ndarray) and np.ndim(value) > 0:
        return Grid(value)
    if isinstance(value, bool | int | float | complex | str | np.generic):
        return value
    raise InputError(
        f"study: {name} is {value!r:.60}; give a distribution of lc.studies, a list, a number or a function of other inputs"
    )
