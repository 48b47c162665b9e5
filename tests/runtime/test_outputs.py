"""Memory of large results: aligned, never shared by two live arrays, handed out again, bounded."""

from __future__ import annotations

import gc
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.runtime.extension import extension
from lie_codegen.runtime.outputs import empty, idle_bytes

pytestmark = pytest.mark.skipif(extension() is None, reason="no extension here")
REAL = np.dtype(float)


def test_large_arrays_are_aligned_writable_and_of_the_shape() -> None:
    for shape in [(4096,), (5000, 3), (100, 7, 9), (3, 2**19)]:
        for dtype in (REAL, np.dtype(complex)):
            array = empty(shape, dtype)
            assert array.shape == shape
            assert array.dtype == dtype
            assert array.flags.carray
            assert array.ctypes.data % 64 == 0
            array[...] = 1.5
            assert np.all(array == 1.5)


def test_memory_is_handed_out_again_and_only_when_nobody_looks_at_it() -> None:
    first = empty((50_000,), REAL)
    place, view = first.ctypes.data, first[100:200]
    view[:] = 7.0
    del first
    gc.collect()
    second = empty((50_000,), REAL)  # the view keeps the block
    assert second.ctypes.data != place
    second[:] = 0.0
    assert np.all(view == 7.0)
    del view
    third = empty((50_000,), REAL)
    assert third.ctypes.data == place


def test_live_results_never_overlap() -> None:
    rng, live = np.random.default_rng(0), []
    for step in range(400):
        array = empty((int(rng.integers(4096, 40_000)),), REAL)
        array[:] = step
        live.append((step, array))
        if len(live) > 20:
            number, gone = live.pop(int(rng.integers(0, 20)))
            assert np.all(gone == number)
    for number, array in live:
        assert np.all(array == number)


def test_what_lies_idle_is_bounded() -> None:
    before = [empty((2**24,), REAL) for _ in range(6)]  # 768 MB, untouched
    del before
    assert idle_bytes() <= 512 * 2**20


def test_sizes_that_cannot_be_are_numpys_errors() -> None:
    with pytest.raises((ValueError, MemoryError)):
        empty((2**40, 2**40), REAL)
    with pytest.raises(ValueError, match="negative"):
        extension().empty((-1,), False)


@pytest.mark.parametrize("name", ["so3", "su3"])
def test_batches_are_the_same_from_used_memory(name: str) -> None:
    library, rng = lc.build(name), np.random.default_rng(1)
    n = lc.group(name).dim
    for count in (1000, 5000, 20_000):
        x = rng.normal(size=(count, n))
        wanted = np.empty_like(library.exp.batch(x))
        library.exp.batch(x, out=wanted)
        for _ in range(3):
            np.testing.assert_array_equal(library.exp.batch(x), wanted)
        np.testing.assert_array_equal(library.exp.batch(x, threads=2), wanted)
        assert np.array_equal(pickle.loads(pickle.dumps(library.exp.batch(x))), wanted)


def test_threads_that_drop_results_at_once_do_not_meet() -> None:
    library = lc.build("so3")
    x = np.random.default_rng(2).normal(size=(8192, 3))
    wanted = library.exp.batch(x).copy()
    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(lambda _: np.array_equal(library.exp.batch(x), wanted), range(64)))
