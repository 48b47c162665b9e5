"""A matplotlib figure that a notebook shows by itself."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A figure that was made without pyplot. Notebooks know how to draw figures only once pyplot was imported, so it says so itself."""

    def _repr_png_(self) -> bytes:
        written = BytesIO()
        self.savefig(written, format="png", dpi=150)
        return written.getvalue()
