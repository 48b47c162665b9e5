"""The numerics version: a whole number that rises with the release in which generated code of the catalogue computes other bits."""

from __future__ import annotations

#: Stands in the header, README and manifest of every generated package. `python -m tests.tools.numerics` says whether it has to rise.
NUMERICS_VERSION = 1
