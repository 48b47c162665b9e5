"""What `lie-codegen bench propagate` integrates: matrices and stored values, nothing of this package.

Every case is X' = X A(t), A(t) = A_0 + s sum_k cos(w_k t) A_k, from the identity; of one qubit the first row alone, which says all. The
stored first rows were integrated in 45 digits by Taylor series of degree 44.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array

_ONE, _X, _Z = np.eye(2), np.array([[0.0, 1.0], [1.0, 0.0]]), np.diag([1.0, -1.0])

#: The first row of X(50), real and imaginary parts in turn.
_ROWS = {
    1: (
        "-0.68965734117501237630751628011952", "0.65229431411332748926013786247679",
        "0.026767460408399615753360869171449", "0.31331834067306208069100532484158",
    ),
    2: (
        "-0.70273346908561101053886672969507", "-0.15939910075841976271052007276181",
        "0.35795600943459023140728588886927", "0.090924908952285183296569556119359",
        "-0.42540261535688398964866655431596", "-0.22150199687012218301759137053723",
        "0.24852237331241956240479793021873", "-0.22926810624076280102019062935602",
    ),
    3: (
        "0.69937539105491070466375082453804", "0.28638980591762059305413210732685",
        "-0.24699036232912206434191166139469", "0.27058020225647443572361711736919",
        "0.23637159187396622863051000734771", "-0.046097167744683360470517772232358",
        "-0.16290052498256163451646762353288", "-0.0077442944246464354473501837629132",
        "-0.39283143590538203279730240368539", "-0.16311281536888144910833302494799",
        "-0.086186013776525919113511578604502", "-0.082082093022282823119152254754013",
        "0.046599988738767040086742594019549", "0.090318074473186559413816831861316",
        "-0.041411019536883821910876469525593", "-0.053966753256554578929830695923844",
    ),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Case:
    """One linear system.

    Attributes:
        name: as it is printed.
        qubits: of the chain.
        constant: (d, d) A_0.
        rates: (k,) w_k.
        driven: (k, d, d) A_k.
        scales: (N,) s of N members; (1,) of one.
        duration: T.
        row: the stored first row of X(T) of the member with s = 1.
    """

    name: str
    qubits: int
    constant: NDArray[np.complex128]
    rates: Array
    driven: NDArray[np.complex128]
    scales: Array
    duration: float
    row: NDArray[np.complex128]

    @property
    def command(self) -> tuple[str, ...]:
        """Module and arguments of the process that runs it."""
        return "lie_codegen.benchmarks.propagate_peers", str(self.qubits), str(len(self.scales))

    def error(self, found: Array, ours: Array) -> float:
        """Of the member whose row is stored; and how far the others are from ours."""
        if found.shape != ours.shape:
            return float("inf")
        return max(float(np.max(np.abs(found[self.stored][0] - self.row))), float(np.max(np.abs(found - ours))))

    @property
    def rows(self) -> int:
        """How many rows of X a tool has to integrate: one of a qubit, for the other follows, else all."""
        return 1 if self.qubits == 1 else len(self.constant)

    @property
    def stored(self) -> int:
        """The member whose row is stored."""
        return int(np.flatnonzero(self.scales == 1.0)[0])


def chain_case(qubits: int, members: int = 1) -> Case:
    """Qubits in a row: each with sigma_z/2 and a drive cos(w t) sigma_x/2, neighbours with 3/10 sigma_z sigma_z; X' = X iH."""

    def at(*places: tuple[int, NDArray[np.float64]]) -> NDArray[np.float64]:
        factors = dict(places)
        product: Array = np.eye(1)
        for k in range(qubits):
            product = np.kron(product, factors.get(k, _ONE))
        return np.asarray(product)

    H = sum((at((k, _Z)) / 2 for k in range(qubits)), np.zeros((2**qubits, 2**qubits)))
    H = H + sum((0.3 * at((k, _Z), (k + 1, _Z)) for k in range(qubits - 1)), np.zeros_like(H))
    drives = np.array([at((k, _X)) / 2 for k in range(qubits)])
    scales = np.ones(1)
    if members > 1:
        scales = np.linspace(0.2, 2.0, members)
        scales[np.argmin(np.abs(scales - 1))] = 1.0
    parts = np.array([float(text) for text in _ROWS[qubits]])
    names = {1: "qubit", 2: "two qubits", 3: "three qubits"}
    return Case(
        names[qubits] if members == 1 else f"{members} qubits", qubits, np.asarray(1j * H, dtype=complex), np.array([1.1, 1.3, 1.5][:qubits]), 1j * drives,
        scales, 50.0, parts[::2] + 1j * parts[1::2],
    )  # fmt: skip
