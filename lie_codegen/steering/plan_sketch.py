"""The controls of a plan as a small picture in SVG, for notebooks; `lc.view` and lie_codegen.pictures draw the large ones."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from lie_codegen.arrays import Array

_WIDTH, _HEIGHT, _MARGIN = 420, 130, 26
_SAMPLES = 240
_COLOURS = ("#1f5aa6", "#c8442f", "#2e8b57", "#d98c1f", "#7a4fa3", "#8a8f98")


def sketch(t: Array, curves: Array, names: Sequence[str]) -> str:
    """Curves (k, m) over times (k,) with their names, the largest size beside the axis; inherits the page's text colour."""
    size = float(np.max(np.abs(curves))) or 1.0
    across = _MARGIN + (t - t[0]) / (t[-1] - t[0]) * (_WIDTH - 2 * _MARGIN)
    middle, half = _HEIGHT / 2, _HEIGHT / 2 - _MARGIN
    lines, words = [], []
    for i, name in enumerate(names):
        colour = _COLOURS[i % len(_COLOURS)]
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, middle - curves[:, i] / size * half, strict=True))
        lines.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        words.append(f'<tspan fill="{colour}">{escape(name)} </tspan>')
    text = 'font-family="sans-serif" font-size="11" fill="currentColor"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{_HEIGHT}" role="img">'
        f"<title>{escape(', '.join(names))} over time</title>"
        f'<path d="M{_MARGIN} {middle}H{_WIDTH - _MARGIN}" stroke="currentColor" stroke-width="0.5"/>'
        + "".join(lines)
        + f'<text x="{_MARGIN}" y="14" {text}>{"".join(words)}</text>'
        f'<text x="{_MARGIN}" y="{_HEIGHT - 8}" {text}>{t[0]:.4g}</text>'
        f'<text x="{_WIDTH - _MARGIN}" y="{_HEIGHT - 8}" text-anchor="end" {text}>{t[-1]:.4g}</text>'
        f'<text x="{_WIDTH - _MARGIN}" y="14" text-anchor="end" {text}>max |u| {size:.4g}</text></svg>'
    )


def moments(duration: float) -> Array:
    """Times at which a sketch of [0, duration] is drawn."""
    return np.linspace(0.0, duration, _SAMPLES)
