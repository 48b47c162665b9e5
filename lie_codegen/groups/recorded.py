"""Groups that were made before, from their records in the cache: neither SymPy nor a proof is needed again."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.records import find_record, store_record


def recorded(source: Any, make: Callable[[], MatrixGroup]) -> MatrixGroup:
    """The group that `make` makes, made or from its record.

    Args:
        source: plain data that determines it.
        make: makes it; not called where a record is found.
    """
    record = find_record("group", source)
    if record is not None:
        with contextlib.suppress(LookupError, TypeError, ValueError):
            return MatrixGroup.recorded(record)
    group = make()
    store_record("group", source, group.record)
    return group
