"""The store of a study: one zarr group that xarray opens, a chunk of it a task, `done[k]` written last.

NAME            (n, ...) an input or an output; the attribute `role` says which
status          (n,) int8: see `SampleStatus`; -1 where the sample has not been run
study_done      (chunks,) int8: 1 done, 2 failed, 0 not yet
study_bits      (chunks,) int8: class of the processor that ran it, see `bit_class`
study_error     (chunks, 400) uint8: the message of a failed chunk, UTF-8
attributes      `lie_codegen_study`: what, space, seed, n, chunk, versions
"""

from __future__ import annotations

import json
import platform
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.runtime.digests import cpu_identity

if TYPE_CHECKING:
    import zarr

FORMAT, VERSION, KEY = "lie_codegen study", 1, "lie_codegen_study"
NOT_YET, DONE, FAILED = 0, 1, 2
_MESSAGE = 400
#: A file holds at most so many samples of an array; a larger task is one file of several such pieces (zarr's sharding).
_PIECE = 10_000
SERVICE = ("study_done", "study_bits", "study_error")


def bit_class() -> int:
    """1 for a processor with fused multiply-add, whose results differ in the last bits from those of class 2, without; 0 unknown.

    AVX2 and AVX-512 compute the same bits: a wider vector holds more samples and not other sums.
    """
    text = cpu_identity()
    if platform.machine().lower() in ("arm64", "aarch64"):
        return 1
    return (1 if " fma " in f"{text} ".replace("\n", " ") else 2) if "flags" in text else 0


def zarr_module() -> Any:
    """zarr, or an error that says how to get it."""
    try:
        import zarr
    except ImportError:
        raise ComputationError(
            "studies keep their results with zarr: install lie_codegen with its extra, lie_codegen[study]"
        ) from None
    return zarr


class Store:
    """A study's arrays.

    Args:
        place: a folder or anything that zarr opens (a URL, a zarr store).
    """

    def __init__(self, place: Any) -> None:
        self.place = place
        try:
            self.root: zarr.Group = zarr_module().open_group(place, mode="r+", use_consolidated=False)
        except FileNotFoundError:  # zarr's own errors are of this kind
            raise InputError(f"{place} is no store of a study") from None
        manifest = self.root.attrs.get(KEY)
        if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
            raise InputError(f"{place} is no store of a study")
        if manifest.get("version") != VERSION:
            raise InputError(
                f"{place} is of version {manifest.get('version')!r}; this package reads version {VERSION}: update it"
            )
        self.manifest: dict[str, Any] = manifest

    @classmethod
    def create(
        cls, place: Any, manifest: Mapping[str, Any], inputs: Mapping[str, Array], outputs: Mapping[str, Array]
    ) -> Store:
        """An empty store for columns like these.

        Raises:
            InputError: an input and an output have one name, or the place is taken.
        """
        clash = sorted(({*inputs} & {*outputs}) | ({*inputs, *outputs} & {*SERVICE}))
        if clash:
            raise InputError(
                f"study: {', '.join(clash)} is the name of an input and of an output; rename one (reduce= names the outputs)"
            )
        n, chunk = int(manifest["n"]), int(manifest["chunk"])
        # it is built beside its place and moved there when whole, so that a kill in between leaves nothing half made
        building = _building(place)
        try:
            root = zarr_module().create_group(building if building is not None else place, overwrite=False)
            for role, columns in (("input", inputs), ("output", outputs)):
                for name, column in columns.items():
                    _column(root, name, column, n, chunk, role)
            chunks = -(-n // chunk)
            for name, shape in (("study_done", (chunks,)), ("study_bits", (chunks,))):
                root.create_array(
                    name,
                    shape=shape,
                    chunks=(1,),
                    dtype="int8",
                    fill_value=0,
                    dimension_names=("study_chunk",),
                    compressors=None,
                )
            root.create_array(
                "study_error", shape=(chunks, _MESSAGE), chunks=(1, _MESSAGE), dtype="uint8", fill_value=0,
                dimension_names=("study_chunk", "study_character"), compressors=None,
            )  # fmt: skip
            root.attrs[KEY] = {"format": FORMAT, "version": VERSION, **manifest}
            if building is not None:
                building.rename(place)
        except OSError as error:
            raise InputError(f"study: no store can be made at {place}: {error.strerror or error}") from None
        finally:
            if building is not None:
                shutil.rmtree(building, ignore_errors=True)
        return cls(place)

    @property
    def n(self) -> int:
        """Samples."""
        return int(self.manifest["n"])

    @property
    def chunk(self) -> int:
        """Samples of a task."""
        return int(self.manifest["chunk"])

    @property
    def chunks(self) -> int:
        """Tasks."""
        return -(-self.n // self.chunk)

    def names(self, role: str) -> list[str]:
        """The inputs, or the outputs (without the status)."""
        found = [name for name, array in self.root.arrays() if array.attrs.get("role") == role and name != "status"]
        order = self.manifest["names"]
        return sorted(found, key=lambda name: (order.index(name) if name in order else len(order), name))

    def span(self, k: int) -> tuple[int, int]:
        """First sample of a chunk, and their number."""
        return k * self.chunk, min(self.chunk, self.n - k * self.chunk)

    def write(self, k: int, columns: Mapping[str, Array]) -> None:
        """All of a chunk; that it is done is written last, so a chunk that was cut off is not done.

        What became of the samples comes after what they are: who reads the file finds none that is said to be there and is not.
        """
        first, count = self.span(k)
        for name, column in sorted(columns.items(), key=lambda item: item[0] == "status"):
            self._array(name)[first : first + count] = column
        self._array("study_bits")[k] = bit_class()
        self._array("study_done")[k] = DONE

    def fail(self, k: int, message: str) -> None:
        """A chunk that could not be run, and why; it is tried again when the study is gone on with."""
        text = np.zeros(_MESSAGE, dtype=np.uint8)
        encoded = message.encode()[:_MESSAGE]
        text[: len(encoded)] = np.frombuffer(encoded, dtype=np.uint8)
        self._array("study_error")[k] = text
        self._array("study_done")[k] = FAILED

    def done(self) -> Array:
        """(chunks,) 0, 1 or 2."""
        return np.asarray(self._array("study_done")[:])

    def bits(self) -> set[int]:
        """Classes of the processors that ran it."""
        return set(np.asarray(self._array("study_bits")[:])[self.done() == DONE].tolist())

    def error(self, k: int) -> str:
        """The message of a failed chunk."""
        return bytes(np.asarray(self._array("study_error")[k]).tobytes()).rstrip(b"\0").decode(errors="replace")

    def read(self, name: str, first: int = 0, count: int | None = None) -> Array:
        """Samples of an array."""
        last = self.n if count is None else first + count
        return np.asarray(self._array(name)[first:last])

    def note(self, **values: Any) -> None:
        """Change what the manifest says."""
        self.manifest = {**self.manifest, **values}
        self.root.attrs[KEY] = self.manifest

    def grow(self, n: int) -> None:
        """More samples: the arrays get longer, and a last chunk that was short is to be run again."""
        old, chunk = self.n, self.chunk
        self._array("study_done")  # opened before anything changes
        if old % chunk:
            self._array("study_done")[old // chunk] = 0
        chunks = -(-n // chunk)
        for name, array in self.root.arrays():
            array.resize((n if name not in SERVICE else chunks, *array.shape[1:]))
        self.note(n=n)

    def _array(self, name: str) -> Any:
        return self.root[name]


def _building(place: Any) -> Path | None:
    """Where a store in a folder is built; None for stores that are no folders."""
    if not isinstance(place, Path):
        return None
    if place.exists():
        raise InputError(f"study: {place} exists and is no study; give another store=")
    place.parent.mkdir(parents=True, exist_ok=True)
    building = place.with_name(f".{place.name}.building")
    shutil.rmtree(building, ignore_errors=True)
    return building


def _column(root: Any, name: str, column: Array, n: int, chunk: int, role: str) -> None:
    rest = column.shape[1:]
    labels = None
    dtype = column.dtype
    if dtype.kind == "U":
        raise InputError(f"study: {name} holds texts")
    fill: Any = np.nan if dtype.kind in "fc" else -1 if name == "status" else 0
    # the entries of a random column do not compress; packing them costs more than it saves
    shape = {"chunks": (chunk, *rest)} if chunk <= _PIECE else {"chunks": (_PIECE, *rest), "shards": (chunk, *rest)}
    root.create_array(
        name, shape=(n, *rest), dtype=dtype, fill_value=fill, compressors=None, attributes={"role": role} | (labels or {}),
        dimension_names=("sample", *(f"{name}_{axis}" for axis in range(len(rest)))), **shape,
    )  # fmt: skip


def same_manifest(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """What differs, in words."""
    keys = ("what", "space", "seed")
    return [key for key in keys if json.dumps(old.get(key), sort_keys=True) != json.dumps(new.get(key), sort_keys=True)]
