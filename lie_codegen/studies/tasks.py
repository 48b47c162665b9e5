"""What a study runs: a function of columns of inputs that gives a column of each output.

The functions of the front door that take many at once are called once a chunk; others, and a chunk in which one sample raises, are called
sample by sample, so that one bad sample is a status and not an end.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, LieCodegenError, ShapeError
from lie_codegen.kernel.definition import plain
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.plain_data import NoDefinitionError
from lie_codegen.studies.batched import batched_call, replayed_call
from lie_codegen.studies.draws import noise_seed
from lie_codegen.studies.results import Of, Single
from lie_codegen.studies.summaries import summary
from lie_codegen.values import settle

#: One value a sample, by name.
Columns = Mapping[str, Array]


class SampleStatus(IntEnum):
    """What became of a sample, as it stands in the array `status` of a store."""

    NOT_RUN = -1
    DONE = 0
    #: an output is NaN or infinite: the run left the finite numbers, or the answer is not there
    NOT_FINITE = 1
    #: a named error; its outputs are NaN
    RAISED = 2
    #: a plan that does not reach its target
    NOT_SOLVED = 3


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A call of which the space gives some arguments: `Run(lc.closed_loop, "so3", law=law, t=(0, 60))`.

    Attributes:
        function: lc.closed_loop, lc.simulate, lc.steer, lc.order_check, a Kernel, a Propagator, or a function of named columns
            that returns a dict of columns; `each(f)` for a function of one sample.
        arguments, options: what stays the same.
        reduce: what is kept of a result: result -> dict of arrays, the sample first; the summary of its kind if not given
            (see `lie_codegen.studies.summaries`).

    Raises:
        InputError: what cannot be called, as function or as reduce.
    """

    function: Any
    arguments: tuple[Any, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    reduce: Callable[[Any], Mapping[str, Any]] | None = None

    def __init__(
        self, function: Any, *arguments: Any, reduce: Callable[[Any], Mapping[str, Any]] | None = None, **options: Any
    ) -> None:
        if not (callable(function) or isinstance(function, Kernel)):
            raise InputError(
                f"study: {function!r:.60} cannot be run; give a function of the front door with its arguments (lc.studies.Run), "
                "a Kernel, a Propagator, or a function of named columns"
            )
        if reduce is not None and not callable(reduce):
            raise InputError("study: reduce is a function of a result that gives a dict of arrays")
        settle(self, function=function, arguments=arguments, options=dict(options), reduce=reduce)

    def __repr__(self) -> str:
        given = [f"{each!r:.30}" for each in self.arguments] + [
            f"{name}={value!r:.30}" for name, value in self.options.items()
        ]
        return f"Run({', '.join([getattr(self.function, '__name__', type(self.function).__name__), *given])})"

    def outputs(self, columns: Columns, first: int, noise: int) -> dict[str, Array]:
        """Columns of outputs, `status` among them.

        Args:
            columns: one value a sample.
            first: index of the first sample.
            noise: seed of the noise inside the samples.

        Raises:
            InputError: columns or options that the function does not take; an error inside a sample becomes its status.
        """
        count = len(next(iter(columns.values())))
        call = batched_call(self.function, self.arguments, self.options)
        if call is None:
            return self._one_by_one(_single(self), columns, first, noise, count)
        try:
            return self._judged(call(columns, first, noise), count)
        except LieCodegenError:
            if count == 1:
                raise
        return self._one_by_one(call, columns, first, noise, count)

    def _one_by_one(
        self, call: Callable[..., Any], columns: Columns, first: int, noise: int, count: int
    ) -> dict[str, Array]:
        rows: list[dict[str, Array] | None] = []
        error: LieCodegenError | None = None
        for i in range(count):
            try:
                rows.append(self._judged(call({k: v[i : i + 1] for k, v in columns.items()}, first + i, noise), 1))
            except LieCodegenError as raised:
                error = raised
                rows.append(None)
        good = next((row for row in rows if row is not None), None)
        if good is None:
            # nothing tells here what the outputs of a good sample would be
            raise error if error is not None else InputError("study: no samples")
        names = list(good)
        missing = {name: _nothing(column[:1]) for name, column in good.items()} | {
            "status": np.array([SampleStatus.RAISED], dtype=np.int8)
        }
        return {name: np.concatenate([(row or missing)[name] for row in rows]) for name in names}

    def _judged(self, result: Any, count: int) -> dict[str, Array]:
        reduced = self.reduce(result) if self.reduce is not None else summary(result)
        if not isinstance(reduced, Mapping) or not reduced:
            raise InputError(f"study: the outputs are a dict of arrays, got {type(reduced).__name__}")
        found = {str(name): np.asarray(value) for name, value in reduced.items()}
        for name, column in found.items():
            if column.shape[:1] != (count,):
                raise ShapeError(
                    f"study: output {name} has shape {column.shape} for {count} samples; the first axis counts them"
                )
            if column.dtype.kind not in "biufc":
                raise InputError(f"study: output {name} holds {column.dtype}, not numbers")
        status = np.full(count, SampleStatus.DONE, dtype=np.int8)
        for column in found.values():
            finite = np.isfinite(column.reshape(count, -1)).all(axis=1)
            status[~finite] = SampleStatus.NOT_FINITE
        if "solved" in found:
            status[~found["solved"].astype(bool)] = SampleStatus.NOT_SOLVED
        return {**found, "status": status}

    def replay(self, columns: Columns, index: int, seed: int) -> Any:
        """The result of one sample, whole, with the inputs as a call of one would have them.

        Args:
            columns: the inputs of the sample, one value each.
            index: of the sample.
            seed: of the study.

        Raises:
            LieCodegenError: whatever ended the sample.
        """
        call = (
            replayed_call(self.function, self.arguments, self.options)
            or batched_call(self.function, self.arguments, self.options)
            or _single(self)
        )
        with quiet():
            result = call(columns, index, noise_seed(seed))
        return result.result if isinstance(result, Of | Single) else result

    @property
    def fingerprint(self) -> Any:
        """What it is, as plain data: a study is gone on with only where this is the same."""
        parts = {"function": mark(self.function), "arguments": mark(self.arguments), "options": mark(self.options)}
        return parts | ({"reduce": mark(self.reduce)} if self.reduce is not None else {})


def as_run(what: Any, reduce: Callable[[Any], Mapping[str, Any]] | None = None) -> Run:
    """A Run of what a study was given: a Run, a functools.partial, or what can be called."""
    if isinstance(what, Run):
        return what if reduce is None else Run(what.function, *what.arguments, reduce=reduce, **what.options)
    if isinstance(what, functools.partial):
        return Run(what.func, *what.args, reduce=reduce, **what.keywords)
    return Run(what, reduce=reduce)


def _nothing(column: Array) -> Array:
    """What stands in the place of an output that is not there."""
    return np.full(column.shape, np.nan if column.dtype.kind in "fc" else 0, dtype=column.dtype)


def _single(run: Run) -> Callable[[Columns, int, int], Any]:
    def call(columns: Columns, first: int, noise: int) -> Any:
        named = {name: _item(column[0]) for name, column in columns.items()}
        return Single(run.function(*run.arguments, **{**run.options, **named}))

    return call


def _item(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def mark(value: Any) -> Any:
    """Plain data that changes where the value does."""
    try:
        return plain(value)
    except NoDefinitionError:
        pass
    if isinstance(value, Mapping):
        return {str(key): mark(each) for key, each in sorted(value.items(), key=lambda pair: str(pair[0]))}
    if isinstance(value, list | tuple):
        return [mark(each) for each in value]
    if isinstance(value, functools.partial):
        return [mark(value.func), mark(value.args), mark(value.keywords)]
    if is_dataclass(value) and not isinstance(value, type):
        return {
            type(value).__name__: {each.name: mark(getattr(value, each.name)) for each in fields(value) if each.compare}
        }
    if callable(value):
        # without the module: a script is __main__ when it is run and has a name when it is imported
        name = str(getattr(value, "__qualname__", type(value).__qualname__))
        if str(getattr(value, "__module__", "")).startswith("lie_codegen."):
            return name
        try:
            text = inspect.getsource(value)
        except (OSError, TypeError):
            text = ""
        return f"{name} {hashlib.sha256(text.encode()).hexdigest()[:16]}"
    return f"{type(value).__module__}:{type(value).__qualname__}"


@contextmanager
def quiet() -> Iterator[None]:
    """NaN in one sample is a status and not a warning."""
    with np.errstate(all="ignore"):
        yield
