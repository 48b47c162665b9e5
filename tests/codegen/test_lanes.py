"""Batches on lanes: every operation, any number, any alignment, for every kind of vector this machine can run."""

from __future__ import annotations

import platform
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy_kernels
from operation_kernels import every_operation, mixed, sided, sizes

import lie_codegen as lc
from lie_codegen.codegen.lane_forms import CHOICE_FORMS, LANE_FORMS, MASK_FORMS, SLOW_FORMS
from lie_codegen.codegen.lanes import lane_body
from lie_codegen.codegen.opcodes import C99_FORMS
from lie_codegen.codegen.package import render_library
from lie_codegen.codegen.reciprocals import with_shared_reciprocals
from lie_codegen.codegen.tape import tape_of
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime.backend import CtypesBackend, load_library
from lie_codegen.runtime.build import build_kernels, interpreted
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.compiler import FLAGS, find_compilers
from lie_codegen.runtime.library import Library

X86 = platform.machine() in ("x86_64", "AMD64")
MACHINES = ["native", *(["haswell", "x86-64"] if X86 else []), "plain"]
CLOSE: dict[str, Any] = {"rtol": 2e-15, "atol": 5e-16}

pytestmark = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")


KERNELS = (*toy_kernels.KERNELS, every_operation(), mixed(), sizes(), sided())


@pytest.fixture(scope="module", params=MACHINES)
def lib(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Library:
    if request.param == "haswell" and "avx2" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("no AVX2 here")
    folder = tmp_path_factory.mktemp("lanes")
    sources = render_library("toy", KERNELS)
    for name, text in sources.files.items():
        (folder / name).write_text(text)
    machine = ["-march=native", "-DLCG_LANES=1"] if request.param == "plain" else [f"-march={request.param}"]
    command = [*find_compilers()[0].command, "-O1", *machine, *FLAGS, "-Wall", "-Wextra", "-Werror"]
    subprocess.run([*command, "-o", "toy.so", sources.main, "-lm"], cwd=folder, check=True)
    shared = load_library(folder / "toy.so")
    functions = [Compiled(each, CtypesBackend(shared, each), compiled=True) for each in sources.signatures]
    return Library("toy", functions, folder / "toy.so", sources.notes)


@pytest.fixture(scope="module")
def oracle() -> Library:
    return interpreted(KERNELS)


def parts(result: Any) -> tuple[Any, ...]:
    return result if isinstance(result, tuple) else (result,)


def points(count: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    rng = np.random.default_rng(4)
    x, y = rng.uniform(-4, 4, (2, max(count, 1)))
    x[::5], y[::7] = y[::5], 0.0
    x[:1] = -0.0
    return x[:count], y[:count]


@pytest.mark.parametrize("count", [1, 40])
def test_every_operation_is_right_on_lanes(lib: Library, oracle: Library, count: int) -> None:
    x, y = points(count)
    got, expected = lib.every.batch(x, y), oracle.every.batch(x, y)
    np.testing.assert_allclose(got, expected, rtol=2e-15, atol=1e-300)


def test_not_a_number_goes_the_way_of_the_interpreter(lib: Library, oracle: Library) -> None:
    x, y = (grid.ravel() for grid in np.meshgrid([np.nan, np.inf, -np.inf, 0.0, 1.0, -2.5], [np.nan, np.inf, 0.0, 3.0]))
    np.testing.assert_allclose(lib.every.batch(x, y), oracle.every.batch(x, y), rtol=2e-15)


def test_conditions_are_numbers_and_numbers_conditions(lib: Library, oracle: Library) -> None:
    rng = np.random.default_rng(5)
    x, y, unread = rng.integers(-1, 2, (30, 3)).astype(float), rng.integers(-1, 2, 30).astype(float), np.zeros((2, 2))
    x[3, 2] = np.nan
    for got, expected in zip(lib.mixed.batch(x, y, unread), oracle.mixed.batch(x, y, unread), strict=True):
        np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("scale", [0.1, 1.0, 9.0])
def test_what_no_lane_needs_is_skipped_and_nothing_else(lib: Library, oracle: Library, scale: float) -> None:
    """All lanes on one side, on both sides, all on the other."""
    x = np.random.default_rng(8).normal(size=(203, 2)) * scale
    x[17] = np.nan
    for got, expected in zip(lib.sided.batch(x), oracle.sided.batch(x), strict=True):
        np.testing.assert_allclose(got, expected, rtol=4e-15, atol=1e-15)
    kept = np.delete(x, 17, axis=0)
    for one, whole in zip(lib.sided.batch(kept[:1]), lib.sided.batch(kept), strict=True):
        np.testing.assert_array_equal(one[0], whole[0])


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 8, 9, 15, 16, 17, 31])
def test_any_number_of_samples_and_nothing_written_beyond(lib: Library, count: int) -> None:
    rng = np.random.default_rng(6)
    shapes = ((5,), (7,), (11,), (3, 6))
    arguments = [rng.integers(-9, 9, (count, *shape)).astype(float) for shape in shapes]
    guarded = [np.full(count * size + 2, 77.0) for size in (11, 18, 7)]
    out = tuple(g[1:-1].reshape(count, *shape) for g, shape in zip(guarded, ((11,), (3, 6), (7,)), strict=True))
    lib.sizes.batch(*arguments, out=out)
    assert all(g[0] == g[-1] == 77.0 for g in guarded)
    a, b, c, d = arguments
    total = a.sum(1) + b.sum(1)
    np.testing.assert_array_equal(out[0], c + total[:, None])
    np.testing.assert_array_equal(out[1], d - total[:, None, None])
    np.testing.assert_array_equal(out[2], b * total[:, None])


def test_a_result_does_not_depend_on_its_place(lib: Library) -> None:
    g, u = np.random.default_rng(7).uniform(-1, 1, (2, 21, 3))
    whole = lib.rate.batch(g, u)
    for start in range(10):
        for stop in (start + 1, 15, 21):
            np.testing.assert_array_equal(lib.rate.batch(g[start:stop], u[start:stop]), whole[start:stop])
    np.testing.assert_array_equal(lib.rate.batch(g[3], u), lib.rate.batch(np.tile(g[3], (21, 1)), u))


def test_any_alignment(lib: Library) -> None:
    memory = np.zeros(3 * 20 + 8)
    g = np.random.default_rng(8).uniform(-1, 1, (20, 3))
    expected = lib.rate.batch(g, g)
    for shift in range(8):
        moved = memory[shift : shift + 60].reshape(20, 3)
        moved[:] = g
        np.testing.assert_array_equal(lib.rate.batch(moved, moved), expected)
        out = memory[shift : shift + 60].reshape(20, 3)
        np.testing.assert_array_equal(lib.rate.batch(g, g, out=out), expected)


def test_batches_are_calls_to_a_few_units_in_the_last_place(lib: Library) -> None:
    g, u = np.random.default_rng(9).uniform(-1.2, 1.2, (2, 50, 3))
    np.testing.assert_allclose(lib.rate.batch(g, u), [lib.rate(*each) for each in zip(g, u, strict=True)], **CLOSE)
    U = np.random.default_rng(9).normal(size=(13, 2, 2)) + 1j
    turned = lib.turn.batch(U, g[:13, 0].copy())
    np.testing.assert_allclose(turned.V, np.exp(1j * g[:13, 0])[:, None, None] * U, **CLOSE)


def test_threads_change_nothing(lib: Library) -> None:
    g, u = np.random.default_rng(10).uniform(-1, 1, (2, 5_003, 3))
    expected = lib.rate.batch(g, u)
    for threads in (1, 2, 3, 64):
        np.testing.assert_array_equal(lib.rate.batch(g, u, threads=threads), expected)
        np.testing.assert_array_equal(lib.rate.batch(g[0], u, threads=threads), lib.rate.batch(g[0], u))
    for wrong in (0, -1, 1.5, True, "2"):
        with pytest.raises(InputError, match="threads is an integer"):
            lib.rate.batch(g, u, threads=wrong)


def scans(lib: Library, starts: Any, u: Any, h: Any, n: int) -> np.ndarray[Any, Any]:
    return np.array([lib.step.scan(x, a, b, n=n) for x, a, b in zip(starts, u, h, strict=True)])


@pytest.mark.parametrize("count", [1, 2, 8, 11])
def test_loops_at_once_are_loops_one_by_one(lib: Library, count: int) -> None:
    rng = np.random.default_rng(11)
    starts, u, h = rng.uniform(-1, 1, (count, 2)), rng.uniform(-1, 1, (count, 12)), rng.uniform(0, 0.1, count)
    expected = scans(lib, starts, u, h, 12)
    got = lib.step.scan_batch(starts, u, h, n=12)
    assert got.shape == (count, 13, 2)
    np.testing.assert_allclose(got, expected, rtol=1e-14, atol=1e-15)
    np.testing.assert_array_equal(lib.step.scan_batch(starts, u, h, n=12, every=4), got[:, ::4])
    shared = lib.step.scan_batch(starts, u[:1], 0.05, n=12)
    np.testing.assert_allclose(shared, scans(lib, starts, [u[0]] * count, [0.05] * count, 12), rtol=1e-14, atol=1e-15)
    constant = lib.step.scan_batch(starts, u[:, 0].copy(), h, n=12)
    np.testing.assert_allclose(constant, scans(lib, starts, u[:, 0], h, 12), rtol=1e-14, atol=1e-15)
    out = np.empty((count, 13, 2))
    assert lib.step.scan_batch(starts, u, h, n=12, out=out) is out
    np.testing.assert_array_equal(out, got)
    one_start = lib.step.scan_batch(starts[0], u, h, n=12)
    np.testing.assert_array_equal(one_start, lib.step.scan_batch(np.tile(starts[0], (count, 1)), u, h, n=12))


def test_loops_at_once_on_threads_and_none(lib: Library) -> None:
    starts = np.random.default_rng(12).uniform(-1, 1, (3_001, 2))
    expected = lib.step.scan_batch(starts, 0.0, 0.05, n=3)
    np.testing.assert_array_equal(lib.step.scan_batch(starts, 0.0, 0.05, n=3, threads=2), expected)
    assert lib.step.scan_batch(starts[:0], 0.0, 0.05, n=3).shape == (0, 4, 2)
    np.testing.assert_array_equal(lib.step.scan_batch(starts, 0.0, 0.05, n=0)[:, 0], starts)


def test_interpreted_loops_at_once(lib: Library, oracle: Library) -> None:
    starts = np.random.default_rng(13).uniform(-1, 1, (5, 2))
    u = np.random.default_rng(13).uniform(-1, 1, (5, 4))
    expected = oracle.step.scan_batch(starts, u, 0.05, n=4, every=2)
    np.testing.assert_allclose(lib.step.scan_batch(starts, u, 0.05, n=4, every=2), expected, rtol=1e-14, atol=1e-15)


def test_wrong_loops_are_named(lib: Library) -> None:
    with pytest.raises(ShapeError, match="u has shape"):
        lib.step.scan_batch(np.zeros((4, 2)), np.zeros((4, 5)), 0.1, n=6)
    with pytest.raises(ShapeError, match="x has 4 trajectories, u has 5"):
        lib.step.scan_batch(np.zeros((4, 2)), np.zeros(5), 0.1, n=6)
    with pytest.raises(ShapeError, match="x has shape"):
        lib.step.scan_batch(np.zeros((4, 6, 2)), 0.0, 0.1, n=6)
    with pytest.raises(InputError, match="no input has an axis"):
        lib.step.scan_batch(np.zeros(2), 0.0, 0.1, n=6)
    with pytest.raises(InputError, match="scan_batch: n = 5 is no multiple"):
        lib.step.scan_batch(np.zeros((4, 2)), 0.0, 0.1, n=5, every=2)


def test_every_operation_of_the_table_has_a_lane_form() -> None:
    forms = (LANE_FORMS, MASK_FORMS, CHOICE_FORMS, SLOW_FORMS)
    assert {op for form in forms for op in form} == set(C99_FORMS)
    assert sum(len(form) for form in forms) == len(C99_FORMS)


def test_divisions_that_share_a_divisor_are_one() -> None:
    def body(ops: Any, x: Any) -> tuple[Any, ...]:
        square = x[0] * x[0] + 1
        return ([x[1] / square, x[2] / ops.sqrt(square), (x[1] + x[2]) / square, x[0] / x[1]],)

    kernel = Kernel("shares", "toy", (Port("x", (3,)),), (Port("y", (4,)),), body)
    before, after = tape_of(kernel), with_shared_reciprocals(tape_of(kernel))
    count = {op: sum(s.op == op for s in after.statements) for op in ("DIV", "INV")}
    assert sum(s.op == "DIV" for s in before.statements) == 4
    assert count == {"DIV": 1, "INV": 1}
    x = np.random.default_rng(0).normal(size=(100, 3))
    lib = build_kernels(lambda: (kernel,))
    np.testing.assert_allclose(lib.shares.batch(x), [lib.shares(row) for row in x], rtol=6e-16)


def _short_body(ops: Any, x: Any) -> tuple[Any, ...]:
    return [ops.sin(x), x, 2 * x, x * x, 1], [x * x * x, x + 1]


def _whole_rows(ops: Any, x: Any) -> tuple[Any, ...]:
    return [x + k for k in range(9)], [x * k for k in range(16)], [k - x for k in range(12)]


def _no_whole_rows(ops: Any, x: Any) -> tuple[Any, ...]:
    return [x + k for k in range(9)], [x * k for k in range(11)]


def _large_before_small(ops: Any, x: Any) -> tuple[Any, ...]:
    return [x + k for k in range(65)], [x * k for k in range(6)]


def _long_body(ops: Any, x: Any) -> tuple[Any, ...]:
    y = x
    for k in range(200):
        y = y * x + k % 3  # two statements each: too long for a twin
    return [y, x, 2 * x], [ops.sin(y)] * 8


@pytest.mark.parametrize("shift", [0, 1, 2])
@pytest.mark.parametrize("body", [_short_body, _whole_rows, _no_whole_rows, _large_before_small, _long_body])
def test_results_beyond_the_caches_are_the_same(body: Any, shift: int) -> None:
    """Streaming stores serve arrays of 16 MiB and more that begin at 16 bytes, as they are made from 64 on; the others do not use them."""

    def aligned(size: int) -> Any:
        room = np.full(count * size + shift + 9, np.nan)
        return room[-room.ctypes.data % 64 // 8 :][: count * size + shift + 1]  # from a multiple of 64 bytes

    sizes = [len(entries) for entries in body(np, 0.5)]
    ports = tuple(Port(f"y{k}", (size,)) for k, size in enumerate(sizes))
    stream = build_kernels(lambda: (Kernel("stream", "toy", (Port("x", ()),), ports, body),)).stream
    count = 2**21 // min(sizes) + 13
    x = np.random.default_rng(0).uniform(-1, 1, count)
    rooms = [aligned(size) for size in sizes]
    out = tuple(room[shift:-1].reshape(count, size) for room, size in zip(rooms, sizes, strict=True))
    stream.batch(x, out=out)
    assert all(np.isnan(room[-1]) and np.isnan(room[:shift]).all() for room in rooms)
    assert not any(np.isnan(each).any() for each in out)
    for start in (0, 1000, count - 50):
        some = slice(start, start + 50)
        for whole, part, entries in zip(out, stream.batch(x[some]), body(np, x[some]), strict=True):
            np.testing.assert_array_equal(whole[some], part)
            columns = [np.broadcast_to(entry, 50) for entry in entries]
            np.testing.assert_allclose(whole[some].T, columns, rtol=1e-14, atol=1e-14)


def test_records_that_are_moved_more_than_computed_are_calls_to_the_last_bit() -> None:
    """compose of SE_2(3) moves 75 numbers for 63 sums and products; exp computes, ad copies."""
    kernels = {kernel.name: kernel for kernel in lc.group_kernels("se_2_3")}
    light = {
        name: lane_body(tape_of(kernels[name]), [port.size for port in kernels[name].inputs]).light
        for name in ("compose", "inverse", "Ad", "exp", "ad")
    }
    assert light == {"compose": True, "inverse": True, "Ad": True, "exp": False, "ad": False}
    compose = build_kernels(lambda: [kernels["compose"]]).compose
    X, Y = np.random.default_rng(3).normal(size=(2, 37, 5, 5))
    np.testing.assert_array_equal(compose.batch(X, Y), [compose(x, y) for x, y in zip(X, Y, strict=True)])
    np.testing.assert_array_equal(compose.batch(X, Y[0]), [compose(x, Y[0]) for x in X])
    np.testing.assert_array_equal(compose.batch(X, Y, out=X.copy()), compose.batch(X, Y))


@pytest.fixture
def private_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(tmp_path / "cache"))


def test_the_build_log_names_what_runs_lane_by_lane(private_cache: None) -> None:
    kernel = Kernel("power", "toy", (Port("x", ()),), (Port("y", ()),), lambda ops, x: ((x * x + 1) ** 2.5,))
    for _ in range(2):  # built, and from the cache
        log = build_kernels(lambda: [kernel, toy_kernels.RATE], namespace="toy", definition="power").build_log
        assert "power: batches call libm lane by lane for CONSTPOW" in log
        assert not any("rate" in line for line in log)
        assert any("samples at a time" in line for line in log)
