"""A figure on a dark page: every colour keeps its hue and takes the lightness that contrasts as it did on white."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from lie_codegen.arrays import Array

#: Lightness of the page and of black on it, in OKLab (Ottosson 2020), where equal steps look equal.
_PAGE, _INK = 0.19, 0.95
_MARK, _PALE, _FAINT = 0.66, 0.85, 0.93
_TO_LMS = np.array(
    [[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566], [0.0883024619, 0.2817188376, 0.6299787005]]
)  # fmt: skip
_TO_LAB = np.array(
    [[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099], [0.0259040371, 0.7827717662, -0.8086757660]]
)  # fmt: skip


def dark_colour(colours: Any) -> Array:
    """(..., 4) RGBA colours for the dark page; transparency stays.

    Lightness is turned round, white to the page and black to the ink. A mark (not a pale fill or a grid) is made no darker than
    0.66, six times the luminance of the page: turned round, orange would be brown.
    """
    rgba = np.array(colours, dtype=float)
    rgb = rgba[..., :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lab = np.cbrt(linear @ _TO_LMS.T) @ _TO_LAB.T
    turned = _INK - (_INK - _PAGE) * lab[..., 0]
    share = np.clip(
        (_FAINT - lab[..., 0]) / (_FAINT - _PALE), 0.0, 1.0
    )  # continuous, so that shaded bodies show no edge
    lab[..., 0] = turned + share * np.maximum(_MARK - turned, 0.0)
    back = np.clip((lab @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_LMS).T, 0.0, 1.0)
    rgba[..., :3] = np.where(back <= 0.0031308, 12.92 * back, 1.055 * back ** (1 / 2.4) - 0.055)
    shown: Array = np.clip(rgba, 0.0, 1.0)
    return shown


def dark(figure: Any) -> Any:
    """A copy of the matplotlib figure, drawn for a dark page."""
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

    figure.canvas.draw()  # ticks and texts of colour bars are made by the first drawing
    shown = pickle.loads(pickle.dumps(figure))
    for artist in _artists(shown):
        turned = list(_colours(artist))
        if turned and artist.get_alpha() is not None and not isinstance(artist, Line2D | Text):
            artist.set_alpha(None)  # these colours hold it already, faces and edges each their own
        for setter, colour in turned:
            setter(colour)
    return shown


def _artists(figure: Any) -> list[Any]:
    """Every artist once, with what `findobj` leaves out: boxes and arrows of texts, the panes of axes in space."""
    found = list(dict.fromkeys(figure.findobj()))
    more = []
    for artist in found:
        more += [getattr(artist, name, None) for name in ("arrow_patch", "pane")]
        if hasattr(artist, "get_bbox_patch"):
            more.append(artist.get_bbox_patch())
    return list(dict.fromkeys([*found, *(each for each in more if each is not None)]))


def _colours(artist: Any) -> Iterator[tuple[Callable[[Any], Any], Any]]:
    """Of one artist: how a colour is set, and what it is on the dark page."""
    from matplotlib import colors
    from matplotlib.axis import Tick
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import Collection
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

    if isinstance(artist, Tick) or hasattr(artist, "patch"):
        return  # the lines and label of a tick, the background of a figure and of axes are artists of their own
    if isinstance(artist, ScalarMappable) and artist.get_array() is not None:
        scale = artist.get_cmap()
        table = scale(np.linspace(0, 1, 256))
        # a scale that goes through white stands for "nothing" there, and takes the page; others are seen on both
        if np.min(table[:, :3], axis=1).max() > 0.9:
            yield artist.set_cmap, colors.ListedColormap(dark_colour(table))
        return
    if isinstance(artist, Line2D):
        names: tuple[str, ...] = ("color", "markerfacecolor", "markeredgecolor")
    elif isinstance(artist, Text):
        names = ("color",)
    else:
        names = tuple(name for name in ("facecolor", "edgecolor") if hasattr(artist, f"get_{name}"))
    for name in names:
        # faces in space are told sorted by depth, as they were last drawn; matplotlib keeps them in their own order beside that
        kept = vars(artist).get(f"_{name}3d")
        value = getattr(artist, f"get_{name}")() if kept is None else kept
        if isinstance(value, str) and value in ("none", "auto", "inherit", "face"):
            continue
        rgba = colors.to_rgba_array(value)
        if len(rgba) and np.any(rgba[:, 3]):
            turned = dark_colour(rgba)
            yield getattr(artist, f"set_{name}"), turned if isinstance(artist, Collection) else tuple(turned[0])
