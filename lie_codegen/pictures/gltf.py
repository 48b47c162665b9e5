"""The triangles of a glTF 2.0 file, as faces of a body one unit in size; geometry alone, no textures."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTH = {"SCALAR": 1, "VEC3": 3}
_LARGEST, _MOST_FACES = 20_000_000, 20_000


def gltf_faces(path: Path) -> list[list[list[float]]]:
    """Triangles, each three points, scaled into a ball of radius 1 about the origin. Node transforms are applied.

    Raises:
        InputError: not a glTF file, too large, or with buffers outside of it.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"view: {path} cannot be read: {error.strerror or error}") from None
    if len(raw) > _LARGEST:
        raise InputError(f"view: {path} has {len(raw)} bytes, at most {_LARGEST}")
    try:
        data, binary = _parts(raw)
        found = _triangles(data, binary)
    except (ValueError, KeyError, IndexError, TypeError, struct.error) as error:
        raise InputError(f"view: {path} is no glTF 2.0 file with its buffers inside: {error}") from None
    if not 0 < len(found) <= _MOST_FACES:
        raise InputError(f"view: {path} has {len(found)} triangles; a page draws 1 to {_MOST_FACES}")
    size = float(np.max(np.linalg.norm(found.reshape(-1, 3), axis=1)))
    return [[[float(x) for x in point] for point in face] for face in np.round(found / (size or 1.0), 5)]


def _parts(raw: bytes) -> tuple[Any, bytes]:
    if len(raw) < 12 or struct.unpack("<I", raw[:4])[0] != _MAGIC:
        return json.loads(raw), b""
    place, data, binary = 12, None, b""
    while place + 8 <= len(raw):
        length, kind = struct.unpack("<II", raw[place : place + 8])
        chunk = raw[place + 8 : place + 8 + length]
        if kind == _JSON:
            data = json.loads(chunk)
        elif kind == _BIN:
            binary = chunk
        place += 8 + length
    return data, binary


def _triangles(data: Any, binary: bytes) -> Array:
    buffers = [_buffer(each, binary) for each in data["buffers"]]
    faces: list[Array] = []

    def accessor(index: int) -> Array:
        each = data["accessors"][index]
        part = data["bufferViews"][each["bufferView"]]
        kind = np.dtype(_TYPES[each["componentType"]]).newbyteorder("<")
        width = _WIDTH[each["type"]]
        stride = part.get("byteStride", kind.itemsize * width)
        start = part.get("byteOffset", 0) + each.get("byteOffset", 0)
        rows = np.ndarray((each["count"], width), kind, buffers[part["buffer"]], start, (stride, kind.itemsize))
        return np.array(rows)

    def visit(index: int, above: Array, depth: int) -> None:
        if depth > 64:
            raise ValueError("nodes nested too deeply")
        node = data["nodes"][index]
        place = above @ _transform(node)
        if "mesh" in node:
            for part in data["meshes"][node["mesh"]]["primitives"]:
                if part.get("mode", 4) != 4:
                    continue
                points = accessor(part["attributes"]["POSITION"]) @ place[:3, :3].T + place[:3, 3]
                order = accessor(part["indices"])[:, 0].astype(int) if "indices" in part else np.arange(len(points))
                faces.append(points[order[: len(order) // 3 * 3]].reshape(-1, 3, 3))
        for child in node.get("children", ()):
            visit(child, place, depth + 1)

    for root in data["scenes"][data.get("scene", 0)]["nodes"]:
        visit(root, np.eye(4), 0)
    return np.concatenate(faces) if faces else np.zeros((0, 3, 3))


def _buffer(each: Any, binary: bytes) -> bytes:
    if "uri" not in each:
        return binary
    head, _, text = str(each["uri"]).partition(",")
    if not head.startswith("data:") or not head.endswith("base64"):
        raise ValueError("a buffer lies in another file")
    return base64.b64decode(text)


def _transform(node: Any) -> Array:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    place = np.eye(4)
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    place[:3, :3] = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ) * np.array(node.get("scale", (1, 1, 1)))
    place[:3, 3] = node.get("translation", (0, 0, 0))
    return place
