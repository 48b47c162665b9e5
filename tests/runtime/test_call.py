"""Calling compiled kernels: arguments, outputs, batches, loops; compiled and interpreted alike."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import toy_kernels

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.runtime.build import build_kernels, interpreted
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.library import Library

HOWS = ["compiled", "ctypes", "interpreted"] if find_compilers() else ["interpreted"]


@pytest.fixture(scope="module", params=HOWS)
def lib(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Library]:
    if request.param == "interpreted":
        yield interpreted(toy_kernels.KERNELS)
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LIE_CODEGEN_CACHE", str(tmp_path_factory.mktemp("cache")))
        patch.setenv("LIE_CODEGEN_CALL", request.param)
        library = build_kernels(lambda: toy_kernels.KERNELS)
        assert library.compiled
        yield library


def rate(g: Any, u: Any) -> np.ndarray[Any, Any]:
    """The body over plain floats: an oracle without CasADi and without C."""
    return np.array(toy_kernels.RATE.evaluate(FloatArithmetic(), g, u)[0])


def test_positional_keyword_lists_and_integers(lib: Library) -> None:
    g, u = [0.1, 0.2, 0.3], [1, 2, 3]
    expected = rate(g, u)
    for result in (lib.rate(g, u), lib.rate(u=u, g=g), lib.rate(np.array(g), u=np.array(u)), lib["rate"](tuple(g), u)):
        assert result.dtype == np.float64
        np.testing.assert_allclose(result, expected, rtol=1e-15)


def test_non_contiguous_foreign_order_and_readonly_arguments(lib: Library) -> None:
    g, u = np.arange(6.0)[::2] / 10, np.asfortranarray(np.arange(9.0).reshape(3, 3))[1]
    expected = rate(g.tolist(), u.tolist())
    np.testing.assert_allclose(lib.rate(g, u), expected, rtol=1e-14)
    swapped, frozen = g.astype(">f8"), u.copy()
    frozen.flags.writeable = False
    np.testing.assert_allclose(lib.rate(swapped, frozen), expected, rtol=1e-14)
    misaligned = np.frombuffer(b"x" + np.ascontiguousarray(g).tobytes(), dtype=np.float64, offset=1)
    np.testing.assert_allclose(lib.rate(misaligned, u), expected, rtol=1e-14)


def test_matrices_are_row_major(lib: Library) -> None:
    X = lib.exp([0, 0, math.pi / 2])
    np.testing.assert_allclose(X, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


def test_complex_ports_and_several_outputs(lib: Library) -> None:
    U = np.array([[1 + 2j, 3], [4j, 5 - 1j]])
    result = lib.turn(U, 0.5)
    np.testing.assert_allclose(result.V, np.exp(0.5j) * U, rtol=1e-15)
    assert isinstance(result.trace, complex)
    assert isinstance(result.part, float)
    assert result.trace == pytest.approx(np.trace(np.exp(0.5j) * U))
    assert result._fields == ("V", "trace", "part")
    np.testing.assert_array_equal(lib.turn([[1, 0], [0, 1]], 0.0).V, np.eye(2))


def test_names_that_c_or_python_reserve(lib: Library) -> None:
    result = lib.awkward(exp=1.0, t0=2.0, index=3.0)
    assert result == (math.exp(1.0) + 6.0, -1.0)
    assert result.lambda_ == -1.0


def test_a_kernel_without_inputs_and_unused_inputs(lib: Library) -> None:
    np.testing.assert_array_equal(lib.constant(), [[1, 2, 3], [0.1, -0.5, 1e-300]])
    np.testing.assert_array_equal(lib.ignores([1, 2], 3), [2, 0])


def test_out_is_written_and_returned(lib: Library) -> None:
    out = np.empty(3)
    g = np.array([0.1, 0.2, 0.3])
    assert lib.rate(g, [1, 2, 3], out=out) is out
    np.testing.assert_array_equal(out, lib.rate(g, [1, 2, 3]))
    expected = out.copy()
    assert lib.rate(g, [1, 2, 3], out=g) is g
    np.testing.assert_array_equal(g, expected)
    V, trace, part = np.empty((2, 2), complex), np.empty((), complex), np.empty(())
    result = lib.turn(np.eye(2), 0.1, out=(V, trace, part))
    assert result.V is V
    assert float(part) == math.cos(0.1)


@pytest.mark.parametrize(
    "out",
    [
        np.empty(4),
        np.empty(3, np.float32),
        np.empty(3, complex),
        np.empty(6)[::2],
        [0.0, 0.0, 0.0],
        (np.empty(3), np.empty(3)),
        np.frombuffer(bytes(24)),
    ],
    ids=["shape", "float32", "complex", "strided", "list", "two", "readonly"],
)
def test_any_other_out_is_refused(lib: Library, out: Any) -> None:
    with pytest.raises(ShapeError, match="rate"):
        lib.rate([0, 0, 0], [0, 0, 0], out=out)


def test_outs_that_overlap_are_refused(lib: Library) -> None:
    both = np.empty(3)
    with pytest.raises(ShapeError, match="share memory"):
        lib.step([0, 0], 0, 0, out=(both[:2], both[1:2].reshape(())))


@pytest.mark.parametrize(
    ("args", "named", "words"),
    [
        (([0, 0], [0, 0, 0]), {}, r"rate: g has shape \(3,\), given \(2,\)"),
        (([0, 0, 0], [[0, 0, 0]]), {}, r"rate: u has shape \(3,\), given \(1, 3\)"),
        (([0, 0, 0],), {}, "missing u"),
        (([0, 0, 0], [0, 0, 0], 1), {}, "takes 2"),
        (([0, 0, 0],), {"v": 1}, "no argument 'v'"),
        (([0, 0, 0],), {"g": 1}, "'g' given twice"),
        (([0, 0, 1j], [0, 0, 0]), {}, "g is real.*complex"),
        (("abc", [0, 0, 0]), {}, "g takes numbers.*str"),
        (([[1], [1, 2], [3]], [0, 0, 0]), {}, "g is ragged"),
        ((None, [0, 0, 0]), {}, "g takes numbers.*NoneType"),
        (([10**400, 0, 0], [0, 0, 0]), {}, "g takes numbers"),
    ],
)
def test_wrong_arguments_are_named(lib: Library, args: Any, named: Any, words: str) -> None:
    with pytest.raises(ShapeError, match=words):
        lib.rate(*args, **named)


def test_batch_with_and_without_a_leading_axis(lib: Library) -> None:
    rng = np.random.default_rng(0)
    G, U = rng.uniform(-1, 1, (2, 17, 3))
    expected = np.array([rate(g, u) for g, u in zip(G.tolist(), U.tolist(), strict=True)])
    np.testing.assert_allclose(lib.rate.batch(g=G, u=U), expected, rtol=1e-13)
    np.testing.assert_allclose(lib.rate.batch(G, U)[5], lib.rate(G[5], U[5]), rtol=1e-15, atol=4e-16)
    np.testing.assert_allclose(lib.rate.batch(G[3], U)[5], lib.rate(G[3], U[5]), rtol=1e-15, atol=4e-16)
    np.testing.assert_allclose(lib.rate.batch(G[::2], U[::-2])[2], lib.rate(G[4], U[12]), rtol=1e-15, atol=4e-16)
    np.testing.assert_array_equal(lib.rate.batch(G[::2], U[::-2])[2:4], lib.rate.batch(G[4:8:2], U[12:8:-2]))
    turned = lib.turn.batch(rng.normal(size=(4, 2, 2)) + 1j, np.arange(4.0))
    assert (turned.V.shape, turned.trace.shape, turned.part.dtype) == ((4, 2, 2), (4,), np.float64)
    np.testing.assert_array_equal(turned.trace, turned.V[:, 0, 0] + turned.V[:, 1, 1])


def test_batch_of_none_and_of_one(lib: Library) -> None:
    assert lib.rate.batch(np.empty((0, 3)), [1, 2, 3]).shape == (0, 3)
    assert lib.step.batch([0, 0], np.empty(0), 0.1).x_next.shape == (0, 2)
    assert lib.exp.batch(np.zeros((1, 3))).tolist() == [np.eye(3).tolist()]


def test_batch_out_may_overlap_the_inputs(lib: Library) -> None:
    G = np.random.default_rng(1).uniform(-1, 1, (9, 3))
    u = np.array([0.1, 0.2, 0.3])
    expected = lib.rate.batch(G, u)
    store = np.empty((10, 3))
    store[:9] = G
    assert np.shares_memory(lib.rate.batch(store[:9], u, out=store[1:]), store)
    np.testing.assert_array_equal(store[1:], expected)
    lib.rate.batch(G, u, out=G)
    np.testing.assert_array_equal(G, expected)
    row = np.zeros((3, 3))
    row[0] = u
    lib.rate.batch(np.zeros((3, 3)), row[0], out=row)
    np.testing.assert_array_equal(row, [lib.rate([0, 0, 0], u)] * 3)


def test_wrong_batches_are_named(lib: Library) -> None:
    with pytest.raises(ShapeError, match=r"g has 4 samples, u has 5"):
        lib.rate.batch(np.zeros((4, 3)), np.zeros((5, 3)))
    with pytest.raises(ShapeError, match="no input has a leading axis"):
        lib.rate.batch([0, 0, 0], [0, 0, 0])
    with pytest.raises(ShapeError, match=r"u has shape \(3,\), or \(N, 3\)"):
        lib.rate.batch(np.zeros((4, 3)), np.zeros((4, 2)))
    with pytest.raises(ShapeError, match=r"u has shape \(\), or \(N,\)"):
        lib.step.batch(np.zeros((4, 2)), np.zeros((4, 1)), 0.1)
    with pytest.raises(ShapeError, match="out="):
        lib.rate.batch(np.zeros((4, 3)), np.zeros(3), out=np.empty((5, 3)))


def test_scan_is_the_loop(lib: Library) -> None:
    u = np.sin(np.arange(12.0))
    state = np.array([0.3, -0.1])
    states = [state]
    for value in u:
        state = lib.step(state, value, 0.05).x_next
        states.append(state)
    np.testing.assert_array_equal(lib.step.scan([0.3, -0.1], u, 0.05, n=12), states)
    np.testing.assert_array_equal(lib.step.scan([0.3, -0.1], u=u, h=0.05, n=12, every=4), states[::4])
    out = np.empty((13, 2))
    assert lib.step.scan([0.3, -0.1], u, 0.05, n=12, out=out) is out
    np.testing.assert_array_equal(out, states)
    np.testing.assert_array_equal(lib.step.scan([0.3, -0.1], 0.0, 0.05, n=0), [[0.3, -0.1]])


def test_wrong_scans_are_refused(lib: Library) -> None:
    with pytest.raises(InputError, match=r"n = 10 is no multiple of every = 4"):
        lib.step.scan([0, 0], 0, 0, n=10, every=4)
    with pytest.raises(InputError, match="every is an integer"):
        lib.step.scan([0, 0], 0, 0, n=10, every=0)
    with pytest.raises(InputError, match="n is an integer"):
        lib.step.scan([0, 0], 0, 0, n=-1)
    with pytest.raises(InputError, match="n is an integer"):
        lib.step.scan([0, 0], 0, 0, n=2.0)
    with pytest.raises(ShapeError, match="3 steps, n = 4"):
        lib.step.scan([0, 0], np.zeros(3), 0, n=4)
    with pytest.raises(InputError, match="exp"):
        lib.exp.scan([0, 0, 0], n=1)
    with pytest.raises(ShapeError, match=r"x has shape \(2,\)"):
        lib.step.scan([0, 0, 0], 0, 0, n=1)


def test_calls_from_many_threads(lib: Library) -> None:
    G, U = np.random.default_rng(2).uniform(-1, 1, (2, 200, 3))
    expected = lib.rate.batch(G, U)
    single = [lib.rate(g, u) for g, u in zip(G, U, strict=True)]
    with ThreadPoolExecutor(8) as pool:
        results = list(pool.map(lib.rate, G, U))
        batches = list(pool.map(lambda _: lib.rate.batch(G, U), range(8)))
    np.testing.assert_array_equal(results, single)
    for batch in batches:
        np.testing.assert_array_equal(batch, expected)


def test_the_library_explains_itself(lib: Library) -> None:
    assert lib.kernels == tuple(kernel.name for kernel in toy_kernels.KERNELS)
    assert set(lib.kernels) <= set(dir(lib))
    assert "rate" in repr(lib)
    assert repr(lib.rate).endswith("kernel rate(g (3,), u (3,)) -> g_dot (3,)>")
    assert "g' = M(g) u" in lib.rate.__doc__
    assert "u: real of shape (3,), float64 [rad/s]: body velocity" in lib.rate.__doc__
    assert [port.name for port in lib.rate.inputs] == ["g", "u"]
    with pytest.raises(AttributeError, match="near: rate"):
        lib.rates  # noqa: B018
