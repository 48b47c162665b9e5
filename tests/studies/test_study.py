"""lc.study: what is kept, what survives, what is refused."""

from __future__ import annotations

import errno
import functools
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.studies.store import Store

sys.path.insert(0, str(Path(__file__).parent))
import study_cases as cases

pytest.importorskip("zarr")
QUIET: dict[str, Any] = {"n": 2000, "seed": 5, "progress": False}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> lc.Study:
    return lc.study(cases.plain, cases.SPACE, chunk=100, store=tmp_path_factory.mktemp("study") / "a.zarr", **QUIET)


def test_outputs_are_those_of_the_inputs(undisturbed: lc.Study) -> None:
    a, v = undisturbed["a"], undisturbed["v"]
    assert np.array_equal(undisturbed["sum"], a + v.sum(axis=1))
    assert np.array_equal(undisturbed["square"], v * v)
    assert undisturbed.status == {
        "not_run": 0, "done": 2000, "not_finite": 0, "raised": 0, "not_solved": 0, "failed_chunks": 0,
    }  # fmt: skip
    low, middle, high = undisturbed.quantiles()["sum"]
    assert low < middle < high
    assert middle == np.median(undisturbed["sum"])


def test_the_store_opens_in_xarray(undisturbed: lc.Study) -> None:
    xarray = pytest.importorskip("xarray")
    data = xarray.open_zarr(undisturbed.place, consolidated=False)
    assert np.array_equal(data["sum"].values, undisturbed["sum"])
    assert data["square"].dims == ("sample", "square_0")
    assert float(undisturbed.dataset["sum"].mean()) == pytest.approx(np.mean(undisturbed["sum"]))


@pytest.mark.parametrize("chunk", [1999, 7])
def test_the_same_bits_whatever_the_chunks(undisturbed: lc.Study, chunk: int) -> None:
    assert lc.study(cases.plain, cases.SPACE, chunk=chunk, store=None, **QUIET).digest() == undisturbed.digest()


def test_a_pool_of_which_a_worker_is_killed(undisturbed: lc.Study, tmp_path: Path) -> None:
    run = cases.killing(str(tmp_path))
    study = lc.study(run, cases.SPACE, chunk=100, store=tmp_path / "b.zarr", on=2, **QUIET)
    assert (tmp_path / "killed").exists()
    assert study.digest() == undisturbed.digest()


def test_a_driver_that_is_killed(undisturbed: lc.Study, tmp_path: Path, repository: Path) -> None:
    store = tmp_path / "c.zarr"
    code = [sys.executable, str(Path(cases.__file__)), str(store)]
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    with subprocess.Popen(code, stdout=subprocess.PIPE, text=True, env=environment) as driver:
        assert driver.stdout is not None
        for line in driver.stdout:
            if int(line) >= 400:
                break
        opened = lc.open_study(store)  # while it is being filled
        assert 0 < opened.status["done"] < 2000
        with pytest.raises(lc.errors.InputError, match="another process"):
            lc.study(cases.slow, cases.SPACE, store=store, **QUIET)
        driver.send_signal(signal.SIGKILL)
    before = lc.open_study(store).status["done"]
    assert 400 <= before < 2000
    counted = []
    study = lc.study(
        cases.slow, cases.SPACE, store=store, **{**QUIET, "progress": lambda done, total: counted.append(done)}
    )
    assert counted[0] == before  # nothing twice
    assert study.complete
    assert study.digest() == undisturbed.digest()


def test_a_chunk_that_was_cut_off_is_not_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed at the n-th array of a chunk: whatever was written of it, its samples have not been run, and are run again."""
    whole = lc.study(cases.plain, cases.SPACE, chunk=100, store=tmp_path / "whole.zarr", **QUIET)
    chosen = Store._array
    for cut in range(1, 12):
        store = tmp_path / f"{cut}.zarr"
        lc.study(cases.plain, cases.SPACE, chunk=100, store=store, **QUIET)
        again = Store(store)
        again._array("study_done")[7] = 0
        again._array("status")[700:800] = -1
        columns = {name: np.zeros_like(whole[name][:100]) for name in (*whole.outputs, "status")}
        asked = [0]

        def killed(self: Store, name: str, asked: list[int] = asked, cut: int = cut) -> Any:
            asked[0] += 1
            if asked[0] == cut:
                raise KeyboardInterrupt
            return chosen(self, name)

        monkeypatch.setattr(Store, "_array", killed)
        try:
            again.write(7, columns)
            monkeypatch.setattr(Store, "_array", chosen)
            break
        except KeyboardInterrupt:
            monkeypatch.setattr(Store, "_array", chosen)
        study = lc.open_study(store)
        assert study.status["done"] == 1900
        assert study.status["not_run"] == 100
        assert set(np.flatnonzero(study["status"] == -1)) == set(range(700, 800))
        lc.study(cases.plain, cases.SPACE, store=store, **QUIET)
        assert np.array_equal(lc.open_study(store)["sum"], whole["sum"])
    assert cut > len(columns)


def test_a_full_disk_loses_nothing(undisturbed: lc.Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real, written = Store.write, []

    def full(self: Store, k: int, columns: Any) -> None:
        if len(written) == 7:
            self._array("sum")[0:3] = 0.0  # cut off in the middle of a chunk
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written.append(k)
        real(self, k, columns)

    monkeypatch.setattr(Store, "write", full)
    store = tmp_path / "d.zarr"
    with pytest.raises(lc.errors.ComputationError, match="No space left"):
        lc.study(cases.plain, cases.SPACE, chunk=100, store=store, **QUIET)
    monkeypatch.setattr(Store, "write", real)
    opened = lc.open_study(store)
    assert opened.status["done"] == 700
    # the chunk that was cut off is not the first one: what stands there is written again all the same
    monkeypatch.undo()
    Store(store)._array("study_done")[0] = 0
    assert lc.study(cases.plain, cases.SPACE, store=store, **QUIET).digest() == undisturbed.digest()


@pytest.mark.slow
def test_a_cluster_of_which_a_worker_is_killed(undisturbed: lc.Study, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        run = cases.killing(str(tmp_path))
        study = lc.study(run, cases.SPACE, chunk=100, store=tmp_path / "e.zarr", on=client, **QUIET)
        assert (tmp_path / "killed").exists()
        assert study.digest() == undisturbed.digest()


def test_a_cluster(undisturbed: lc.Study, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        study = lc.study(cases.plain, cases.SPACE, chunk=500, store=tmp_path / "e.zarr", on=client, **QUIET)
        assert study.digest() == undisturbed.digest()


def test_one_bad_sample_is_a_status(tmp_path: Path) -> None:
    def run(x: float) -> dict[str, float]:
        if x > 0.9:
            raise lc.errors.ComputationError("too far")
        return {"y": float("nan") if x > 0.8 else x}

    study = lc.study(lc.each(run), {"x": lc.Uniform(0, 1)}, n=300, chunk=50, store=None, progress=False)
    x = study["x"]
    assert study.status["raised"] == np.sum(x > 0.9)
    assert study.status["not_finite"] == np.sum((x > 0.8) & (x <= 0.9))
    assert np.array_equal(study["y"][x <= 0.8], x[x <= 0.8])
    assert np.all(np.isnan(study["y"][x > 0.8]))


def test_a_chunk_that_fails_is_tried_again(tmp_path: Path) -> None:
    state = {"broken": True}

    def run(x: np.ndarray) -> dict[str, np.ndarray]:
        if state["broken"] and np.any(x == 57):
            raise RuntimeError("no such device")
        return {"y": 2 * x}

    call = functools.partial(lc.study, run, {"x": np.arange(100)}, chunk=10, store=tmp_path / "f.zarr", progress=False)
    with pytest.warns(UserWarning, match="chunk 5: RuntimeError: no such device"):
        study = call()
    assert study.status["failed_chunks"] == 1
    assert study.status["not_run"] == 10
    assert "no such device" in study.errors[5]
    state["broken"] = False
    study = call()
    assert study.complete
    assert np.array_equal(study["y"], 2 * np.arange(100))


def test_a_study_grows_and_is_one_with_a_longer_one(undisturbed: lc.Study, tmp_path: Path) -> None:
    call = functools.partial(lc.study, cases.plain, cases.SPACE, seed=5, progress=False, store=tmp_path / "g.zarr")
    call(n=750, chunk=100)
    assert call(n=2000).digest() == undisturbed.digest()
    with pytest.raises(lc.errors.InputError, match="only grows"):
        call(n=10)
    with pytest.raises(lc.errors.InputError, match="seed differ"):
        lc.study(cases.plain, cases.SPACE, n=2000, seed=6, store=tmp_path / "g.zarr", progress=False)
    with pytest.raises(lc.errors.InputError, match="what differ"):
        lc.study(cases.slow, cases.SPACE, n=2000, seed=5, store=tmp_path / "g.zarr", progress=False)
    with pytest.raises(lc.errors.InputError, match="space differ"):
        lc.study(
            cases.plain,
            {**cases.SPACE, "a": lc.Normal(2, 0.6)},
            n=2000,
            seed=5,
            store=tmp_path / "g.zarr",
            progress=False,
        )
    with pytest.raises(lc.errors.InputError, match="is there already"):
        call(resume=False)


def test_until_stops_at_the_same_sample_for_all(tmp_path: Path) -> None:
    until = lc.Quantile("sum", 0.9, 0.25)
    runs = [
        lc.study(
            cases.plain,
            cases.SPACE,
            n=20_000,
            seed=5,
            chunk=100,
            store=tmp_path / name,
            until=until,
            on=on,
            progress=False,
        )
        for name, on in (("h.zarr", None), ("i.zarr", 2))
    ]
    assert runs[0].n == runs[1].n < 20_000
    assert runs[0].digest() == runs[1].digest()
    low, high = until.interval(runs[0]["sum"])
    assert high - low <= 0.25
    assert low <= np.quantile(runs[0]["sum"], 0.9) <= high


def test_the_interval_of_a_quantile_covers_as_often_as_it_says() -> None:
    """By simulation: 2,000 sets of 200 exponential numbers."""
    rng = np.random.default_rng(0)
    until = lc.Quantile("x", 0.8, 1.0, confidence=0.9)
    true = -np.log(0.2)
    inside = 0
    for _ in range(2000):
        low, high = until.interval(rng.exponential(size=200))
        inside += low <= true <= high
    assert 0.9 <= inside / 2000 < 0.95


def test_in_the_background(undisturbed: lc.Study, tmp_path: Path) -> None:
    study = lc.study(cases.slow, cases.SPACE, chunk=100, store=tmp_path / "j.zarr", wait=False, **QUIET)
    assert study.wait().complete
    assert study.digest() == undisturbed.digest()


def test_a_study_pickles(undisturbed: lc.Study) -> None:
    again = pickle.loads(pickle.dumps(undisturbed))
    assert again.digest() == undisturbed.digest()
    assert "2000 done" in repr(again)


def test_interrupted_work_is_kept(tmp_path: Path, undisturbed: lc.Study) -> None:
    def stop(done: int, total: int) -> None:
        if done >= 600:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lc.study(cases.plain, cases.SPACE, chunk=100, store=tmp_path / "k.zarr", **{**QUIET, "progress": stop})
    assert lc.open_study(tmp_path / "k.zarr").status["done"] == 600
    assert lc.study(cases.plain, cases.SPACE, store=tmp_path / "k.zarr", **QUIET).digest() == undisturbed.digest()


def test_tables_and_pictures(undisturbed: lc.Study, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(undisturbed.to_parquet(tmp_path / "t.parquet"))
    assert table.num_rows == 2000
    assert np.array_equal(table["square_2"].to_numpy(), undisturbed["square"][:, 2])
    pytest.importorskip("matplotlib")
    for name, options in (("a", {}), ("b", {"output": "sum", "inputs": ("a",)}), ("c", {"output": "square"})):
        assert undisturbed.plot(tmp_path / f"{name}.png", **options).stat().st_size > 5000  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"n": 0}, "number of samples"),
        ({"n": None}, "n is missing"),
        ({"seed": -1}, "seed"),
        ({"chunk": 0}, "chunk"),
        ({"on": 3.5}, "on is None"),
        ({"until": "soon"}, "Quantile"),
        ({"reduce": 3}, "reduce"),
    ],
)
def test_what_is_refused(change: dict[str, Any], said: str, tmp_path: Path) -> None:
    named: dict[str, Any] = {"n": 10, "store": tmp_path / "no.zarr", "progress": False, **change}
    with pytest.raises(lc.errors.InputError, match=said):
        lc.study(cases.plain, cases.SPACE, **named)
    assert not (tmp_path / "no.zarr").exists()


def test_one_name_for_an_input_and_an_output(tmp_path: Path) -> None:
    with pytest.raises(lc.errors.InputError, match="rename"):
        lc.study(lambda x: {"x": x}, {"x": lc.Uniform(0, 1)}, n=3, store=tmp_path / "no.zarr")
    (tmp_path / "other").mkdir()
    with pytest.raises(lc.errors.InputError, match="no store"):
        lc.open_study(tmp_path / "other")


def test_time_of_a_draw_far_out() -> None:
    """A sample far out costs no walk through those before it."""
    from lie_codegen.studies.draws import uniforms

    uniforms(0, "x", 0, 10, 16)
    started = time.process_time()
    uniforms(0, "x", 10**12, 100_000, 16)
    assert time.process_time() - started < 1
