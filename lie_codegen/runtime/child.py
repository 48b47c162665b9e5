"""What another Python of this package needs to know."""

from __future__ import annotations

import os
import sys


def child_environment(**more: str) -> dict[str, str]:
    """The environment in which a child finds the modules that this process finds, with further variables."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path), **more}
