"""A result that nobody holds any more is written to again; one that anybody can still see never is."""

from __future__ import annotations

import copy
import gc
import weakref
from typing import Any

import numpy as np
import pytest
import toy_kernels

from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.extension import extension
from lie_codegen.runtime.library import Library

pytestmark = pytest.mark.skipif(extension() is None, reason="no extension here")


@pytest.fixture(scope="module")
def lib() -> Library:
    made = build_kernels(lambda: toy_kernels.KERNELS)
    assert not isinstance(made.rate, Compiled)
    return made


def test_whatever_the_caller_holds_stays_as_it_was(lib: Library) -> None:
    """By name, in lists, by views and buffers, in tuples taken apart or whole: some thousand results, some let go."""
    rng, held = np.random.default_rng(7), []
    ways = (
        lambda made: made,
        lambda made: made.x_next if isinstance(made, tuple) else made[:2],
        lambda made: memoryview(made[0] if isinstance(made, tuple) else made),
        lambda made: [np.asarray(each).reshape(-1, 1) for each in made] if isinstance(made, tuple) else made.T,
        copy.copy,
    )
    for _ in range(4000):
        x, u = rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)
        made: Any = lib.rate(x, u) if rng.random() < 0.5 else lib.step(x[:2].copy(), u[0], 0.1)
        kept = ways[int(rng.integers(len(ways)))](made)
        held.append((kept, copy.deepcopy(kept) if not isinstance(kept, memoryview) else bytes(kept)))
        del made, kept
        if len(held) > 6:
            held.pop(int(rng.integers(6)))
        for seen, before in held:
            if isinstance(seen, memoryview):
                assert bytes(seen) == before
            elif isinstance(seen, (tuple, list)):
                assert all(np.array_equal(a, b) for a, b in zip(seen, before, strict=True))
            else:
                np.testing.assert_array_equal(seen, before)


def test_a_result_changed_in_place_is_not_given_again(lib: Library) -> None:
    g, u = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    wanted = lib.rate(g, u).copy()
    changes = (
        lambda made: made.setflags(write=False),
        lambda made: setattr(made, "shape", (3, 1)),
        lambda made: setattr(made, "dtype", np.int64),
        lambda made: setattr(made, "dtype", np.dtype(">f8")),
        lambda made: setattr(made, "dtype", np.dtype(float, metadata={"unit": "m"})),
    )
    for change in changes:
        for _ in range(5):
            made = lib.rate(g, u)
            change(made)
            del made
            made = lib.rate(g, u)
            assert made.shape == (3,)
            assert made.dtype == np.dtype(float)
            assert made.dtype.metadata is None
            assert made.flags.carray
            np.testing.assert_array_equal(made, wanted)


def test_a_weak_reference_never_sees_another_result(lib: Library) -> None:
    g, u = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    for _ in range(5):
        made = lib.rate(g, u)
        looks, seen = weakref.ref(made), made.copy()
        del made
        lib.rate(g, -u)
        if (there := looks()) is not None:
            np.testing.assert_array_equal(there, seen)


def test_a_callback_that_calls_again_is_heard(lib: Library) -> None:
    """Letting a result go may run code that calls the same kernel."""
    x, found = np.array([0.3, -0.1]), []
    wanted = lib.step(x, 0.5, 0.1)
    for _ in range(20):
        made = lib.step(x, 0.5, 0.1)
        weakref.finalize(made[0], lambda: found.append(lib.step(x, 0.5, 0.1)))
        del made
    gc.collect()
    assert found
    for each in found:
        assert all(np.array_equal(a, b) for a, b in zip(each, wanted, strict=True))


def test_numbers_in_tuples_hash_as_tuples_do(lib: Library) -> None:
    seen = set()
    for number in range(5):
        made = lib.awkward(float(number), 0.5, 1.0)
        assert hash(made) == hash(tuple(made))
        seen.add(hash(made))
        del made
    assert len(seen) == 5


def test_a_loop_uses_the_memory_of_two_results(lib: Library) -> None:
    g, u, places = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0]), set()
    made = lib.rate(g, u)
    for _ in range(50):
        made = lib.rate(made, u)
        places.add(made.ctypes.data)
    assert len(places) == 2
