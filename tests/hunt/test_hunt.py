"""The hunt in small, on every run; `python -m tests.hunt` is the large one."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from tests.hunt import __main__ as whole
from tests.hunt import (
    faults,
    generated_c,
    growth,
    hostile,
    matrix,
    methods,
    off_manifold,
    rows,
    solver_arguments,
    texts,
    torn,
)


def test_only_errors_of_ours_leave_the_front_door() -> None:
    tried, found = hostile.hunt(0.01, seed=1)
    assert tried > 100
    assert not found, "\n".join(found)


def test_only_errors_of_ours_leave_the_methods_of_results() -> None:
    tried, found = methods.hunt(0.01, seed=1)
    assert tried > 70
    assert not found, "\n".join(found)


def test_the_guard_can_be_seen_to_work() -> None:
    """A judge that finds nothing would find nothing in anything."""
    assert "ZeroDivisionError" in str(hostile.judged(1.0, lambda: 1 / 0))
    assert "LateError" in str(hostile.judged(0.05, lambda: [None for _ in iter(int, 1)]))
    assert off_manifold.look_at_law(1e-3, off_manifold.np.eye(3) * 1.001, _wrong_law, ()) is not None


class _WrongLaw:
    name = "wrong"

    def __call__(self, X: object) -> tuple[object, ...]:
        return (float(X[0][0] == 1.0),)  # type: ignore[index]


_wrong_law = _WrongLaw()


@pytest.mark.parametrize("kind", texts.KINDS)
def test_texts_are_refused_or_read(kind: str) -> None:
    tried, found = texts.hunt(kind, 8 if kind == "command lines" else 25)
    assert tried >= len(texts.corpus(kind))
    assert not found, "\n".join(found)


def test_off_the_group_it_is_refused_projected_or_right() -> None:
    tried, found = off_manifold.hunt(4, methods=("optimal", "circle"))
    assert tried == 24
    assert not found, "\n".join(found)


def test_the_c_solver_refuses_what_is_no_number(tmp_path: Path) -> None:
    if solver_arguments.COMPILER is None:
        pytest.skip("no C compiler")
    tried, found = solver_arguments.hunt(tmp_path, sanitize=generated_c.has_sanitizers(tmp_path / "probe"))
    assert tried > 50
    assert not found, "\n".join(found)


@pytest.mark.parametrize("lanes", [False, True], ids=["one lane", "lanes"])
def test_generated_c_survives_any_number(lanes: bool, tmp_path: Path) -> None:
    if not generated_c.has_sanitizers(tmp_path / "probe"):
        pytest.skip("no sanitizers")
    tried, found = generated_c.hunt(tmp_path / "c", "so2" if lanes else "se2", 2, lanes=lanes)
    assert tried > 300
    assert not found, "\n".join(found)


@pytest.mark.skipif(solver_arguments.COMPILER is None, reason="no C compiler")
def test_after_a_fault_all_is_as_fast_as_ever() -> None:
    _, found = faults.hunt(2, seed=3)
    assert not found, "\n".join(found)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="faults are injected into forks")
def test_a_write_that_fails_leaves_the_old_or_the_new() -> None:
    tried, found = torn.hunt(("group.npz", "tree"))
    assert tried >= 30
    assert not found, "\n".join(found)


@pytest.mark.skipif(not matrix.compilers(), reason="neither gcc nor clang")
def test_generated_c_has_no_warning_to_give_and_meets_its_vectors(tmp_path: Path) -> None:
    compiler = matrix.compilers()[0]
    cells = 0
    for packages, only in ((("so3", "so3 float"), compiler), (("steering",), f"{compiler}, one lane")):
        tried, found = matrix.hunt(tmp_path, packages, only)
        cells += tried
        assert not found, "\n".join(found)
    assert cells == 7


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="nothing says what memory is taken")
def test_memory_does_not_grow() -> None:
    tried, found = growth.calls(100_000)
    assert tried > 100_000
    assert not found, "\n".join(found)


def test_the_page_has_the_figures_of_the_last_hunt() -> None:
    figures = rows.read(rows.PAGE)
    assert len(figures) >= 10
    assert all(row.tried > 0 and row.scale > 0 for row in figures)


def test_a_part_hunted_again_replaces_its_row_alone(tmp_path: Path) -> None:
    old = [rows.Row("a", 1, "0", 1000, 0, 3), rows.Row("gone", 1, "0", 5, 0, 1), rows.Row("b", 1, "0", 7, 1, 20)]
    assert rows.parsed(rows.table(old)) == old
    new = rows.Row("b", 10, "1", 9, 0, 2)
    page = tmp_path / "page.md"
    page.write_text(f"before\n{rows.BEGIN}{rows.END}\nafter\n")
    rows.write(page, rows.joined(old, [new], ["a", "b", "c"]))
    assert rows.read(page) == [old[0], new]
    assert page.read_text().startswith("before\n")
    assert page.read_text().endswith("\nafter\n")


def test_an_interrupted_hunt_keeps_its_rows_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    note, page = tmp_path / "hunted", tmp_path / "rows.md"
    stop = tmp_path / "stop"
    stop.touch()

    def first() -> tuple[int, list[str]]:
        note.write_text("first")
        return 3, []

    def second() -> tuple[int, list[str]]:
        if stop.exists():
            # One that meets the parent within the callbacks of its fork is swallowed there.
            for wait in (0.2, 10.0, 50.0):
                time.sleep(wait)
                os.kill(os.getppid(), signal.SIGINT)
        note.write_text(note.read_text() + ", second")
        raise ValueError("broken")

    def third() -> tuple[int, list[str]]:
        os.kill(os.getpid(), signal.SIGKILL)
        return 1, []

    monkeypatch.setattr(whole, "parts", lambda scale, home: {"first": first, "second": second, "third": third})
    monkeypatch.setattr("sys.argv", ["hunt", "--scale", "2", "--rows", str(page), "--resume", "--jobs", "1"])
    heard = signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background is born deaf to it
    try:
        with pytest.raises(KeyboardInterrupt):
            whole.main()
    finally:
        signal.signal(signal.SIGINT, heard)
    assert [row.hunted for row in rows.read(page)] == ["first"]
    stop.unlink()
    assert whole.main() == 1  # a part that breaks, or whose process dies, has found that
    assert note.read_text() == "first, second"
    assert [(row.hunted, row.tried, row.found) for row in rows.read(page)] == [
        ("first", 3, 0),
        ("second", 1, 1),
        ("third", 1, 1),
    ]


def test_parts_of_a_hunt_run_at_once(tmp_path: Path) -> None:
    def meets(mine: str, other: str) -> whole.Part:
        def part() -> tuple[int, list[str]]:
            (tmp_path / mine).touch()
            for _ in range(600):
                if (tmp_path / other).exists():
                    return 1, []
                time.sleep(0.05)
            return 1, [f"{other} did not run beside {mine}"]

        return part

    ended = list(whole.at_once({"a": meets("a", "b"), "b": meets("b", "a")}, 2))
    assert sorted((what, found) for what, _, found, _ in ended) == [("a", []), ("b", [])]
