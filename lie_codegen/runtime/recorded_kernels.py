"""Kernels that were made before, from their records in the cache: what a kernel is, while its body waits until somebody derives with it.

So a law whose library is in the cache is made, compared, saved, built and generated without SymPy.
"""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from functools import cached_property
from importlib import import_module
from typing import Any

from lie_codegen.door import warnings_given
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.plain_data import Definition
from lie_codegen.runtime.records import find_record, store_record

_OWN = {field.name for field in fields(Kernel)}


def recorded_kernel(definition: Definition, make: Callable[[], Any]) -> Any:
    """What `make` makes: from its record, or made and recorded if it is one kernel of plain data.

    Args:
        definition: determines the kernel.
        make: makes it, or several; not called where there is a record, until the body or the sampler is.
    """
    record = find_record("kernel", definition.text)
    if record is not None:
        with contextlib.suppress(LookupError, TypeError, ValueError, AttributeError, ImportError):
            return _from_record(record, make)
    warned = warnings_given()
    made = make()
    # What was warned of is made again every time, so that the warning is heard every time.
    if isinstance(made, Kernel) and warnings_given() == warned:
        with contextlib.suppress(TypeError):
            store_record("kernel", definition.text, _record(made))
    return made


class _Later:
    """Body and sampler of a kernel that is made when one of them is first called."""

    def __init__(self, make: Callable[[], Kernel]) -> None:
        self._make = make

    @cached_property
    def kernel(self) -> Kernel:
        return self._make()

    def body(self, *arguments: Any) -> tuple[Any, ...]:
        return self.kernel.body(*arguments)

    def sample(self, rng: random.Random) -> tuple[Any, ...]:
        return self.kernel.sample(rng)


def _record(kernel: Kernel) -> dict[str, Any]:
    """All but body and sampler, as plain data.

    Raises:
        TypeError: a field that a class of laws adds is no plain data.
    """
    more = {field.name: getattr(kernel, field.name) for field in fields(kernel) if field.name not in _OWN}
    return {
        "class": [type(kernel).__module__, type(kernel).__qualname__],
        "name": kernel.name,
        "namespace": kernel.namespace,
        "inputs": [asdict(port) for port in kernel.inputs],
        "outputs": [asdict(port) for port in kernel.outputs],
        "formula": kernel.formula,
        "source": kernel.source,
        "sampled": kernel.sampler is not None,
        "more": {name: _plain(value) for name, value in more.items()},
    }


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if value is None or type(value) in (bool, int, float, str):
        return value
    raise TypeError(f"{type(value).__name__} is no plain data")


def _from_record(record: Mapping[str, Any], make: Callable[[], Kernel]) -> Kernel:
    module, name = record["class"]
    later = _Later(make)
    made: Kernel = getattr(import_module(module), name)(
        name=record["name"],
        namespace=record["namespace"],
        inputs=_ports(record["inputs"]),
        outputs=_ports(record["outputs"]),
        body=later.body,
        formula=record["formula"],
        source=record["source"],
        sampler=later.sample if record["sampled"] else None,
        **{key: _tuples(value) for key, value in record["more"].items()},
    )
    return made


def _ports(data: list[dict[str, Any]]) -> tuple[Port, ...]:
    return tuple(Port(**{**port, "shape": tuple(port["shape"])}) for port in data)


def _tuples(value: Any) -> Any:
    return tuple(_tuples(each) for each in value) if isinstance(value, list) else value
