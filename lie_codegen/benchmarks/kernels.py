"""Calls and batches of one kernel: ours, and the same kernel through its peers."""

from __future__ import annotations

import ctypes
import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks import peers as peers
from lie_codegen.benchmarks.limits import arithmetic_work, memory_work
from lie_codegen.benchmarks.rows import AbsentError, Entrant, Row, Work, compete
from lie_codegen.benchmarks.symforce_peer import SymForce
from lie_codegen.kernel.casadi_arithmetic import flatten, function_of
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.runtime.build import build_kernels

SMALL, LARGE = 4_096, 1_000_000
#: Above these many instructions jax and numba compile for minutes; they are left out.
JAX_LIMIT, NUMBA_LIMIT = 600, 1500
#: (v, w) in the order (w, v) of our se3, for the peers.
_SWAP = [3, 4, 5, 0, 1, 2]


def kernel_rows(kernel: Kernel, folder: Path, rounds: int, hand: ctypes.CDLL) -> list[Row]:
    """One row of calls, one of batches of 4,096, one of a million; those say how near their limit they are."""
    contest = _Contest(kernel, folder)
    rows = [compete("call", kernel.symbol, "ns a call", 1, rounds, list(contest.calls()))]
    read, written = (sum(port.size for port in ports) for ports in (kernel.inputs, kernel.outputs))
    for count in (SMALL, LARGE):
        some = rounds if count == SMALL else max(3, rounds // 4)
        entrants = [*contest.batches(count), *(contest.maps(count) if count == SMALL else ())]
        if count == LARGE:
            entrants.append(Entrant(_MOVED, lambda: memory_work(hand, read * LARGE, written * LARGE), compared=False))
        operations = peers.instructions(kernel) * count
        entrants.append(Entrant(_COMPUTED, partial(arithmetic_work, hand, operations), compared=False))
        row = compete("batch", f"{kernel.symbol}, {count}", "ns a sample", count, some, entrants, SMALL)
        limits = {name: row.timings[name].ratio.middle for name in (_MOVED, _COMPUTED) if name in row.timings}
        nearest = max(limits, key=lambda name: limits[name])
        rows.append(replace(row, note=f"{limits[nearest]:.0%} of the roof, {nearest.removeprefix('limit: ')}"))
    return rows


_OURS = "lie_codegen, out="
#: What bounds a batch of many samples, and one that stays in the caches; the time of one multiply-add is that of any operation.
_MOVED = "limit: as many bytes moved"
_COMPUTED = "limit: as many operations"


class _Contest:
    """One kernel with what several of its rows need, made once."""

    def __init__(self, kernel: Kernel, folder: Path) -> None:
        self.kernel, self.folder = kernel, folder
        self.function = build_kernels(lambda: [kernel])[kernel.name]

    @cached_property
    def casadi_c(self) -> tuple[ctypes.CDLL, Any]:
        return peers.as_casadi_c(self.kernel, self.folder)

    @cached_property
    def symforce(self) -> SymForce:
        return SymForce(self.kernel, self.folder)

    @cached_property
    def numba(self) -> Any:
        self._short("numba", NUMBA_LIMIT)
        peers.need("numba")
        return peers.as_python(self.kernel, self.folder, "math", scalars=True)

    @cached_property
    def jax(self) -> Any:
        self._short("jax", JAX_LIMIT)
        peers.jax_modules()
        return peers.as_python(self.kernel, self.folder, "jax.numpy", scalars=False)

    def _short(self, name: str, limit: int) -> None:
        if peers.instructions(self.kernel) > limit:
            raise AbsentError(
                f"{peers.instructions(self.kernel)} instructions, above {limit} {name} compiles for minutes"
            )

    def outputs(self, *lead: int) -> list[Array]:
        """Room for the results."""
        return [np.empty((*lead, port.size)) for port in self.kernel.outputs]

    def calls(self) -> Iterator[Entrant]:
        kernel, function = self.kernel, self.function
        flat = [array[0].copy() for array in samples(kernel, 1)]
        given = [array[0].copy() for array in shaped(kernel, samples(kernel, 1))]
        columns = [array.reshape(-1, 1) for array in flat]

        def by_numba() -> Work:
            point = self.numba.point

            def work() -> Any:
                made = self.outputs()
                point(*flat, *made)
                return made

            return work

        def by_jax() -> Work:
            jax, jnp = peers.jax_modules()
            jitted = jax.jit(self.jax.point)
            arrays = [jnp.asarray(array) for array in flat]
            return lambda: jax.block_until_ready(jitted(*arrays))

        def by_symforce() -> Work:
            point = self.symforce.call()
            return lambda: point(*flat)

        yield Entrant("lie_codegen", lambda: lambda: function(*given))
        yield Entrant("CasADi f(numpy), external", lambda: lambda: _dense(self.casadi_c[1](*columns)))
        yield Entrant("CasADi f(numpy), interpreted", _of_casadi(lambda: function_of(kernel), columns))
        yield Entrant("CasADi external, buffer() preset", lambda: Preset(self.casadi_c[1], flat, self.outputs()))
        yield Entrant("numba", by_numba)
        yield Entrant("SymForce C++, pybind11", by_symforce)
        yield Entrant("jax jit, jax arrays", by_jax)
        if kernel.symbol == "se3_exp":
            moved = flat[0][_SWAP].reshape(-1, 1)
            yield Entrant("liecasadi f(numpy)", _of_casadi(_liecasadi_exp, [moved]), tolerance=1e-7)
            yield Entrant("cyecca f(numpy)", _of_casadi(_cyecca_exp, [moved]))

    def batches(self, count: int) -> Iterator[Entrant]:
        kernel, function = self.kernel, self.function
        flat = samples(kernel, count)
        given = shaped(kernel, flat)
        made = function.batch(*given)
        several = isinstance(made, tuple)
        target = tuple(made) if several else made
        results = self.outputs(count)  # for all that write to arrays of ours: a million samples fill memory

        def loop(library: Callable[[], ctypes.CDLL]) -> Callable[[], Work]:
            def make() -> Work:
                run = library().bench_batch
                arguments = peers.pointers(flat), peers.sizes([p.size for p in kernel.inputs]), peers.pointers(results)

                def work() -> Any:
                    run(ctypes.c_ssize_t(count), *arguments)
                    return results

                return work

            return make

        def by_numpy() -> Work:
            point = peers.as_python(kernel, self.folder, "numpy", scalars=False).point
            return lambda: point(*flat)

        def by_numba() -> Work:
            batch = self.numba.batch

            def work() -> Any:
                batch(*flat, *results)
                return results

            return work

        def by_jax() -> Work:
            jax, jnp = peers.jax_modules()
            jitted = jax.jit(jax.vmap(self.jax.point))
            arrays = [jnp.asarray(array) for array in flat]
            return lambda: jax.block_until_ready(jitted(*arrays))

        def by_jaxlie() -> Work:
            jax, jnp = peers.jax_modules()
            jaxlie = peers.need("jaxlie")
            theirs = jax.jit(jax.vmap(lambda x: jaxlie.SE3.exp(x).as_matrix()))
            moved = jnp.asarray(np.ascontiguousarray(flat[0][:, _SWAP]))
            return lambda: jax.block_until_ready(theirs(moved))

        yield Entrant(_OURS, lambda: lambda: function.batch(*given, out=target))
        yield Entrant("lie_codegen, new arrays", lambda: lambda: function.batch(*given))
        yield Entrant("CasADi's C in a loop", loop(lambda: self.casadi_c[0]))
        yield Entrant("SymForce C++ in a loop", loop(lambda: self.symforce.batch()))
        yield Entrant("numpy", by_numpy)
        yield Entrant("numba", by_numba)
        yield Entrant("jax vmap + jit", by_jax)
        if kernel.symbol == "se3_exp":
            yield Entrant("jaxlie vmap + jit", by_jaxlie, tolerance=1e-7)

    def maps(self, count: int) -> Iterator[Entrant]:
        """CasADi's interpreter over a batch, through preset buffers (its samples are columns)."""

        def by_map() -> Work:
            return Preset(function_of(self.kernel).map(count), samples(self.kernel, count), self.outputs(count))

        yield Entrant("CasADi map(), buffer()", by_map)


class Preset:
    """A CasADi function with its arguments set once; calling it evaluates, and gives the results."""

    def __init__(self, function: Any, flat: list[Array], made: list[Array]) -> None:
        self._buffer, self._trigger = function.buffer()
        self._made, self._given = made, flat  # CasADi keeps addresses, not arrays
        for number, array in enumerate(flat):
            self._buffer.set_arg(number, array.reshape(-1).data)
        for number, array in enumerate(made):
            self._buffer.set_res(number, array.reshape(-1).data)

    def __call__(self) -> list[Array]:
        self._trigger()
        return self._made


def _of_casadi(make: Callable[[], Any], columns: list[Array]) -> Callable[[], Work]:
    def prepare() -> Work:
        function = make()
        return lambda: _dense(function(*columns))

    return prepare


def _dense(result: Any) -> Any:
    """Row-major numbers: our functions give flat columns, theirs a matrix."""
    return [part.full() for part in result] if isinstance(result, tuple | list) else result.full()


def _liecasadi_exp() -> Any:
    import casadi as ca

    tangent = ca.SX.sym("x", 6)
    return ca.Function("f", [tangent], [peers.need("liecasadi").SE3Tangent(tangent).exp().as_matrix()])


def _cyecca_exp() -> Any:
    import casadi as ca

    lie, tangent = peers.need("cyecca.lie"), ca.SX.sym("x", 6)
    return ca.Function("f", [tangent], [lie.se3.elem(tangent).exp(lie.SE3Quat).to_Matrix()])


def samples(kernel: Kernel, count: int) -> list[Array]:
    """Admissible inputs, (count, size) each; a few, repeated."""
    rng = random.Random(0)
    few = [kernel.sample(rng) for _ in range(64)]
    arrays = []
    for number, port in enumerate(kernel.inputs):
        rows = np.array([[float(x) for x in flatten(port, sample[number])] for sample in few])
        arrays.append(np.ascontiguousarray(np.tile(rows, (-(-count // len(rows)), 1))[:count]))
    return arrays


def shaped(kernel: Kernel, flat: list[Array]) -> list[Array]:
    """The same in the shapes of the ports."""
    found = []
    for port, array in zip(kernel.inputs, flat, strict=True):
        entries = array.view(np.complex128) if port.is_complex else array
        found.append(entries.reshape(len(array), *port.shape))
    return found
