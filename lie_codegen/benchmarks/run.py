"""Ours against the peers that are installed: calls, batches, trajectories, Monte Carlo, cold starts; and the limits.

Every section runs in a process of its own, on one core, its competitors in turn; a peer that crashes takes its own
section with it and no other.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from lie_codegen.benchmarks import laws as laws
from lie_codegen.benchmarks import peers as peers
from lie_codegen.benchmarks.cold import cold_row
from lie_codegen.benchmarks.group_loops import group_row
from lie_codegen.benchmarks.kernels import kernel_rows
from lie_codegen.benchmarks.limits import Limits, keep_to_one_core, limits, machine
from lie_codegen.benchmarks.loops import monte_carlo_row, trajectory_row
from lie_codegen.benchmarks.rows import Row
from lie_codegen.benchmarks.study_row import study_row
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.kernel.kernel import Kernel

#: Title -> the kernel whose calls and batches are compared.
KERNELS: Mapping[str, Callable[[], Kernel]] = {
    **{f"{g} {k}": partial(lambda g, k: group_kernel(load(g), k), g, k) for g, k in (
        ("so3", "wei_norman_rate"), ("se3", "wei_norman_rate"), ("su3", "wei_norman_rate"), ("se_2_3", "wei_norman_rate"),
        ("se3", "exp"), ("se3", "log"), ("se3", "ljac_inv"),
    )},
    "se3 tracker with a log": laws.log_tracker,
    "se3 tracking_law": laws.package_tracker,
    "so3 attitude_law": laws.package_attitude,
}  # fmt: skip
#: The other sections.
LOOPS = ("trajectory in coordinates", "trajectory on the group", "Monte Carlo", "study", "cold start")
SECTIONS = (*KERNELS, *LOOPS)
Report = Callable[[str], None]


@dataclass(frozen=True)
class Bench:
    """Everything that was measured.

    Attributes:
        machine: its class and load.
        limits: of one core.
        rows: the comparisons.
        failed: section -> the last line of what went wrong.
    """

    machine: str
    limits: Limits
    rows: tuple[Row, ...]
    failed: dict[str, str]


def bench(rounds: int = 15, report: Report = lambda line: None, only: str = "") -> Bench:
    """Run the sections, each in a fresh process.

    Args:
        rounds: of each comparison.
        report: is told what is going on.
        only: runs the sections with this text in their titles.

    Raises:
        InputError: no section has it.
    """
    chosen = [title for title in SECTIONS if only.lower() in title.lower()]
    if not chosen:
        raise InputError(f"bench: no section has {only!r} in its title; they are {', '.join(SECTIONS)}")
    rows: list[Row] = []
    failed: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="lie_codegen-bench-") as name:
        bounds = limits(peers.hand_written(Path(name)))
    for title in chosen:
        report(title)
        try:
            rows += _in_a_process(title, rounds)
        except ComputationError as error:
            failed[title] = str(error)
    return Bench(machine(), bounds, tuple(rows), failed)


_MARK = b"lie_codegen rows\n"


def _in_a_process(title: str, rounds: int) -> list[Row]:
    """The rows of one section.

    Raises:
        ComputationError: with the last line of what went wrong.
    """
    command = [sys.executable, "-m", "lie_codegen.benchmarks.run", title, str(rounds)]
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode:
        text = done.stderr.decode(errors="replace").strip().splitlines()
        raise ComputationError(text[-1][:300] if text else f"ended with status {done.returncode}")
    rows: list[Row] = pickle.loads(done.stdout[done.stdout.index(_MARK) + len(_MARK) :])
    return rows


def section(title: str, rounds: int) -> list[Row]:
    """The rows of one section, here and now."""
    with tempfile.TemporaryDirectory(prefix="lie_codegen-bench-") as name:
        folder = Path(name)
        if title == "cold start":
            return [cold_row(folder, max(3, rounds // 3))]
        if title == "trajectory on the group":
            return [group_row(folder, rounds)]
        if title == "study":
            return [study_row(folder, rounds)]
        hand = peers.hand_written(folder)
        if title == "trajectory in coordinates":
            return [trajectory_row(folder, hand, rounds)]
        if title == "Monte Carlo":
            return [monte_carlo_row(folder, hand, rounds)]
        return kernel_rows(KERNELS[title](), folder, rounds, hand)


def main(title: str, rounds: int) -> None:
    """One section, its rows pickled on stdout: for `bench` alone, which started this process."""
    keep_to_one_core()
    rows = section(title, rounds)
    sys.stdout.buffer.write(_MARK + pickle.dumps(rows))
    sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
