"""The deepest chain of calls of a C file, as gcc tells it."""

from __future__ import annotations

import re
from functools import cache


def deepest(graph: str, entry: str = "") -> int:
    """Bytes of the deepest chain of calls, from a function if one is named, in a graph of gcc's -fcallgraph-info=su."""
    own = {
        title: int(size) for title, size in re.findall(r'node: \{ title: "([^"]+)" label: "[^"]*?\\n(\d+) bytes', graph)
    }
    calls: dict[str, set[str]] = {}
    for source, target in re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', graph):
        calls.setdefault(source, set()).add(target)

    @cache
    def below(title: str) -> int:
        return own.get(title, 0) + max((below(target) for target in calls.get(title, ())), default=0)

    assert own
    return below(entry) if entry else max(map(below, own))
