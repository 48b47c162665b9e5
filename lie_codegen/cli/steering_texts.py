"""Numbers, limits, via points and obstacles as they are written on the command line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from lie_codegen.errors import ExpressionError, InputError, ShapeError

if TYPE_CHECKING:
    from lie_codegen.groups.matrix_group import MatrixGroup
    from lie_codegen.steering.blocks import Box, Cylinder
    from lie_codegen.steering.constraints import Ball, Cone, Obstacle

Texts = list[str] | None
CONE, BALL = "AXIS@DIRECTION@ANGLE", "CENTER@RADIUS"
BOX, CYLINDER = "CENTER@HALF_SIZES[@TURN]", "START@END@RADIUS[@rounded]"
Limits = float | tuple[float, float]


def numbers(text: str, option: str, labels: Sequence[str] = ()) -> list[float]:
    """Comma-separated real numbers, exact arithmetic, pi and sqrt allowed; one for each label, if labels are given.

    Raises:
        ShapeError: not real, or not as many as labels.
        ExpressionError: naming the option, the column and the text.
    """
    from lie_codegen.exact.expression import parse_number

    try:
        values = [parse_number(part) for part in text.split(",")]
    except ExpressionError as error:
        raise ExpressionError(f"steer: {option}: {error}") from None
    if (labels and len(values) != len(labels)) or any(value.is_real is not True for value in values):
        wanted = f"{len(labels)} real numbers for {', '.join(labels)}" if labels else "real numbers, comma-separated"
        raise ShapeError(f"steer: {option} needs {wanted}, got {text!r}")
    return [float(value) for value in values]


def target_of(text: str, group: MatrixGroup) -> Any:
    """Coordinates as text, or what the file of that name holds: the rows of an element, or coordinates.

    Raises:
        InputError: the file holds no numbers.
        ShapeError, ExpressionError: as `numbers`.
    """
    from pathlib import Path

    import numpy as np

    path = Path(text)
    if not path.is_file():
        return numbers(text, "--target", group.labels)
    try:
        if path.suffix == ".npy":
            return np.load(path, allow_pickle=False)
        rows = path.read_text(encoding="utf-8").replace(",", " ").splitlines()
        kind = complex if group.is_complex else float
        return np.squeeze(np.array([[kind(each) for each in row.split()] for row in rows if row.strip()]))
    except (ValueError, OSError, UnicodeDecodeError) as error:
        raise InputError(f"steer: --target {path}: rows of numbers are wanted: {error}") from None


def limits_of(text: str, option: str) -> Limits | dict[str, Limits]:
    """ "0.5", "-1:2" or "w1=0.5,w2=-1:2"."""
    if "=" not in text:
        return _limit(text, option)
    parts = [part.split("=") for part in text.split(",")]
    if any(len(part) != 2 for part in parts):
        raise InputError(f"steer: {option} needs a number, low:high, or label=either, comma-separated, got {text!r}")
    return {label.strip(): _limit(value, option) for label, value in parts}


def via_point(text: str) -> tuple[float, list[float]]:
    """ "0.5@0.1,0,0": a fraction of the duration and coordinates of the second kind."""
    fraction, coordinates = _parts(text, "--via", "FRACTION@COORDINATES", 2)
    return _one(fraction, "--via"), numbers(coordinates, "--via")


def obstacle_cone(text: str) -> Cone:
    """ "0,0,1@1,0,0@0.3": a body axis, a direction of space, an angle in rad."""
    from lie_codegen.steering.constraints import Cone

    axis, direction, angle = _parts(text, "--cone", CONE, 3)
    a, d = (numbers(each, "--cone", ("x", "y", "z")) for each in (axis, direction))
    return Cone((a[0], a[1], a[2]), (d[0], d[1], d[2]), _one(angle, "--cone"))


def obstacle_ball(text: str) -> Ball:
    """ "1,0.5@0.2": a center and a radius."""
    from lie_codegen.steering.constraints import Ball

    center, radius = _parts(text, "--ball", BALL, 2)
    return Ball(tuple(numbers(center, "--ball")), _one(radius, "--ball"))


def obstacle_box(text: str) -> Box:
    """ "1,0.5@0.2,0.3@pi/6": a center, half sizes, and how it is turned, if it is: an angle in the plane, the nine numbers of the
    rotation by rows in space.
    """
    import numpy as np

    from lie_codegen.steering.blocks import Box

    center, halves, *turn = _parts(text, "--box", BOX, 2, 3)
    axes: Any = None
    if turn:
        given = numbers(turn[0], "--box")
        if len(given) == 1:
            c, s = np.cos(given[0]), np.sin(given[0])
            axes = [[c, -s], [s, c]]
        elif len(given) == 9:
            axes = np.reshape(given, (3, 3))
        else:
            raise ShapeError(f"steer: --box is turned by one angle or by nine numbers of a rotation, got {turn[0]!r}")
    return Box(tuple(numbers(center, "--box")), tuple(numbers(halves, "--box")), axes)


def obstacle_cylinder(text: str) -> Cylinder:
    """ "0,0,0@0,0,2@0.3@rounded": the middles of its ends, a radius, and whether half balls close it."""
    from lie_codegen.steering.blocks import Cylinder

    start, end, radius, *rounded = _parts(text, "--cylinder", CYLINDER, 3, 4)
    if rounded and rounded[0].strip() != "rounded":
        raise InputError(f"steer: --cylinder needs {CYLINDER}, got {text!r}")
    first, last = (tuple(numbers(each, "--cylinder")) for each in (start, end))
    return Cylinder(first, last, _one(radius, "--cylinder"), bool(rounded))


def obstacles_of(cones: Texts, balls: Texts, boxes: Texts, cylinders: Texts) -> list[Obstacle]:
    """What --cone, --ball, --box and --cylinder say, each any number of times."""
    kinds: Iterable[tuple[Any, Texts]] = (
        (obstacle_cone, cones),
        (obstacle_ball, balls),
        (obstacle_box, boxes),
        (obstacle_cylinder, cylinders),
    )
    return [read(text) for read, texts in kinds for text in texts or ()]


def _limit(text: str, option: str) -> Limits:
    ends = [_one(part, option) for part in text.split(":")]
    if len(ends) > 2:
        raise InputError(f"steer: {option}: a number or low:high, got {text!r}")
    return ends[0] if len(ends) == 1 else (ends[0], ends[1])


def _one(text: str, option: str) -> float:
    values = numbers(text, option)
    if len(values) != 1:
        raise ShapeError(f"steer: {option} needs one number, got {text!r}")
    return values[0]


def _parts(text: str, option: str, form: str, *counts: int) -> list[str]:
    parts = text.split("@")
    if len(parts) not in counts:
        raise InputError(f"steer: {option} needs {form}, got {text!r}")
    return parts
