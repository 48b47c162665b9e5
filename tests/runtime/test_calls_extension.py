"""The extension type: the fast path and the slow one agree; nothing leaks; the process stays as it was."""

from __future__ import annotations

import gc
import subprocess
import sys
import sysconfig
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy_kernels

from lie_codegen.errors import ShapeError
from lie_codegen.runtime import extension
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.cache_upkeep import cache_info
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.library import Library

HEADERS = (Path(sysconfig.get_path("include")) / "Python.h").is_file()
pytestmark = pytest.mark.skipif(not find_compilers() or not HEADERS, reason="needs a C compiler and Python's headers")


@pytest.fixture(scope="module")
def libs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Library, Library]]:
    """By the extension, and by ctypes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LIE_CODEGEN_CACHE", str(tmp_path_factory.mktemp("cache")))
        fast = build_kernels(lambda: toy_kernels.KERNELS)
        patch.setenv("LIE_CODEGEN_CALL", "ctypes")
        slow = build_kernels(lambda: toy_kernels.KERNELS)
    assert not isinstance(fast.rate, Compiled)
    assert isinstance(slow.rate, Compiled)
    return fast, slow


ARGUMENTS: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = [
    ("rate", (np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0])), {}),
    ("rate", (np.array([0.1, 0.2, 0.3]),), {"u": np.array([1.0, 2.0, 3.0])}),
    ("rate", (), {"u": np.array([1.0, 2.0, 3.0]), "g": np.array([0.1, 0.2, 0.3])}),
    ("rate", (np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0])), {"out": None}),
    ("rate", (np.array([0.1, 0.2, 0.3], dtype=">f8"), np.array([1, 2, 3])), {}),
    ("rate", (np.zeros((3, 2))[:, 0], np.float32([1, 2, 3])), {}),
    ("step", (np.array([0.3, -0.1]), 0.5, 0.1), {}),
    ("step", (np.array([0.3, -0.1]), 1, np.float64(0.1)), {}),
    ("step", (np.array([0.3, -0.1]), True, np.array(0.1)), {}),
    ("step", (np.array([0.3, -0.1]), np.int8(3), 2**62), {}),
    ("turn", (np.eye(2) + 1j, 0.3), {}),
    ("turn", (np.eye(2), 0.3), {}),
    ("awkward", (1.0, -0.0, np.inf), {}),
    ("awkward", (5e-324, np.nan, 1.0), {}),
    ("constant", (), {}),
    ("ignores", (np.array([1.0, 2.0]), 3.0), {}),
]


@pytest.mark.parametrize(("name", "args", "named"), ARGUMENTS)
def test_both_ways_give_the_same_types_and_bits(
    libs: tuple[Library, Library], name: str, args: Any, named: Any
) -> None:
    fast, slow = (lib[name](*args, **named) for lib in libs)
    pairs = zip(fast, slow, strict=True) if isinstance(fast, tuple) else [(fast, slow)]
    for one, other in pairs:
        assert type(one) is type(other)
        assert np.asarray(one).dtype == np.asarray(other).dtype
        np.testing.assert_array_equal(one, other)
    assert not isinstance(fast, tuple) or fast._fields == slow._fields


@pytest.mark.parametrize(
    ("args", "named"),
    [
        ((np.zeros(2), np.zeros(3)), {}),
        ((np.zeros(3), np.zeros((1, 2))), {}),
        ((np.zeros(3),), {}),
        ((np.zeros(3),) * 3, {}),
        ((np.zeros(3),), {"g": np.zeros(3)}),
        ((np.zeros(3),), {"v": np.zeros(3)}),
        ((np.zeros(3), np.zeros(3, complex)), {}),
        ((np.zeros(3), np.zeros(3)), {"out": np.zeros(2)}),
        ((np.zeros(3), "abc"), {}),
    ],
)
@pytest.mark.parametrize("form", ["call", "batch"])
def test_both_ways_refuse_in_the_same_words(libs: tuple[Library, Library], args: Any, named: Any, form: str) -> None:
    words = []
    for lib in libs:
        with pytest.raises(Exception) as caught:  # noqa: PT011
            (lib.rate if form == "call" else lib.rate.batch)(*args, **named)
        words.append((type(caught.value), str(caught.value)))
    assert words[0] == words[1]


def test_a_kernel_passes_for_what_it_wraps(libs: tuple[Library, Library]) -> None:
    fast, slow = libs
    assert (repr(fast.rate), fast.rate.__doc__) == (repr(slow.rate), slow.rate.__doc__)
    assert dir(fast.rate) == dir(slow.rate)
    assert (fast.rate.name, fast.rate.inputs, fast.rate.compiled) == ("rate", slow.rate.inputs, True)
    assert fast.rate.batch.__doc__ == slow.rate.batch.__doc__
    with pytest.raises(AttributeError, match="nothing"):
        fast.rate.nothing  # noqa: B018
    assert callable(fast.rate)
    assert hash(fast.rate) != hash(fast.exp)


def test_a_batch_that_writes_over_its_input_is_right(libs: tuple[Library, Library]) -> None:
    store = np.random.default_rng(3).uniform(-1, 1, (40, 3))
    u = np.array([1.0, 2.0, 3.0])
    expected = libs[0].rate.batch(store[:-1].copy(), u)
    libs[0].rate.batch(store[:-1], u, out=store[1:])
    np.testing.assert_array_equal(store[1:], expected)


def test_several_outputs_into_the_callers_arrays(libs: tuple[Library, Library]) -> None:
    x = np.random.default_rng(5).uniform(-1, 1, (40, 2))
    for lib in libs:
        for function, start in ((lib.step, x[0].copy()), (lib.step.batch, x.copy())):
            expected = function(start, 0.5, 0.1)
            out = tuple(np.full(np.shape(each), np.nan) for each in expected)
            counts = [sys.getrefcount(each) for each in out]
            for _ in range(100):
                got = function(start, 0.5, 0.1, out=out)
            assert type(got) is type(expected)
            for mine, given, right in zip(got, out, expected, strict=True):
                assert mine is given
                np.testing.assert_array_equal(given, right)
            del got, mine, given
            assert [sys.getrefcount(each) for each in out] == counts
            for bad in (out[:-1], (out[0],) * len(out), (*out[:-1], np.zeros(7))):
                with pytest.raises(ShapeError):
                    function(start, 0.5, 0.1, out=bad)
        store = x.copy()
        lib.step.batch(store, 0.5, 0.1, out=(store, *out[1:]))  # the last `out` is a batch's
        np.testing.assert_array_equal(store, expected[0])


def test_libraries_are_collected() -> None:
    class Kept(Compiled):
        """Can be referred to weakly."""

    signature = build_kernels(lambda: [toy_kernels.RATE]).rate.signature
    owner = Kept(signature, None, compiled=True)  # type: ignore[arg-type]
    ports = (("g", (3,), False),)
    module = extension.extension()
    batch = module.function(0, 1, ports, ports, owner.batch, owner.batch, None, None)
    owner.fast = module.function(1, 0, ports, ports, owner, owner, batch, None)  # type: ignore[attr-defined]
    gone = weakref.ref(owner)
    del owner, batch
    gc.collect()
    assert gone() is None


def test_calling_leaves_subnormals_alone(libs: tuple[Library, Library]) -> None:
    libs[0].rate.batch(np.zeros((100, 3)), np.zeros(3))
    libs[0].exp(np.zeros(3))
    tiny = np.array([5e-324, 2e-308])
    np.testing.assert_array_equal(tiny * 0.5 * 2, [0.0, 2e-308])
    assert libs[0].step(np.zeros(2), 5e-324, 1.0).x_next[1] == 5e-324
    result = libs[0].step.batch(np.zeros((9, 2)), np.full(9, 5e-324), 1.0)
    np.testing.assert_array_equal(result.x_next[:, 1], 5e-324)


def test_without_headers_calls_go_through_ctypes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(tmp_path / "cache"))
    real = sysconfig.get_path
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path) if name == "include" else real(name))
    extension._extension.cache_clear()
    try:
        library = build_kernels(lambda: [toy_kernels.RATE])
        assert not list(
            (tmp_path / "cache" / "python").glob("requests/*.json")
        )  # nothing that would outlive its reason
        assert "no Python.h" in " ".join(cache_info().degraded)
        monkeypatch.undo()
        monkeypatch.setenv("LIE_CODEGEN_CACHE", str(tmp_path / "cache"))
        extension._extension.cache_clear()
        assert not isinstance(build_kernels(lambda: [toy_kernels.RATE]).rate, Compiled)  # the headers are there again
    finally:
        extension._extension.cache_clear()
    assert isinstance(library.rate, Compiled)
    np.testing.assert_array_equal(library.rate([0, 0, 0], [1, 2, 3]), [1, 2, 3])


LEAK = """
import resource
import numpy as np
import toy_kernels
from lie_codegen.runtime.build import build_kernels
lib = build_kernels(lambda: toy_kernels.KERNELS)
g, u, U, x = np.zeros(3), np.ones(3), np.eye(2, dtype=complex), np.zeros(2)
G = np.zeros((4, 3))
def work(times):
    for _ in range(times):
        lib.rate(g, u); lib.rate(g=g, u=u); lib.rate(g, u, out=g); lib.turn(U, 0.5); lib.step(x, 0.5, 1)
        lib.rate.batch(G, u); lib.rate.batch(G, u, out=G); lib.turn.batch(U, G[:, 0].copy())
    try:
        lib.rate(g)
    except Exception:
        pass
work(10_000)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
work({times})
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.slow
def test_ten_million_calls_leak_nothing(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", f"{repository}:{repository / 'tests'}")
    code = LEAK.replace("{times}", "1_250_000")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 2_000, "kilobytes"
