"""The command line as a user runs it: exit status, stdout, stderr, files."""

from __future__ import annotations

import json
import math
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from command_line import Done

import lie_codegen as lc
from lie_codegen import __version__
from lie_codegen.cli.app import main
from lie_codegen.cli.steering_texts import obstacles_of
from lie_codegen.codegen.numerics import NUMERICS_VERSION


@pytest.fixture
def cli(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path):
    """The command line in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)

    def invoke(*arguments: str) -> Done:
        monkeypatch.setattr(sys, "argv", ["lie-codegen", *arguments])
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        out, err = capsys.readouterr()
        return Done(int(stop.value.code or 0), out, err)

    return invoke


def test_list_and_show_print_one_json_object(cli, tmp_path: Path) -> None:
    groups = json.loads(cli("list", "--json").stdout)["groups"]
    assert {"so3", "se2", "se3", "su2", "sl2", "h3"} <= {group["name"] for group in groups}
    shown = json.loads(cli("show", "so3", "--json").stdout)
    assert shown["determinant_of_inverse"] == "cos(g2)"
    assert shown["brackets"]["[w1, w2]"] == "w3"


def test_new_writes_a_file_that_check_proves_and_generate_takes(cli, tmp_path: Path) -> None:
    assert cli("new", "mine").returncode == 0
    assert "proved exactly" in cli("check", "mine.toml").stdout
    assert cli("new", "mine").returncode == 2, "an existing file is not overwritten"
    done = cli("generate", "mine.toml", "--out", "out", "--json")
    assert done.returncode == 0, done.stderr
    assert {"include/mine.h", "src/mine.c", "example.c", "manifest.json"} <= set(json.loads(done.stdout)["files"])


BAD_FILES = {
    "not_closed": ('labels = ["a", "b"]\n[matrices]\na = [[0, 1], [0, 0]]\nb = [[0, 0], [1, 0]]', "not closed"),
    "dependent": ('labels = ["a", "b"]\n[matrices]\na = [[0, 1], [0, 0]]\nb = [[0, 2], [0, 0]]', "linearly dependent"),
    "jacobi": ('labels = ["a", "b", "c"]\n[brackets]\n"a,b" = { c = 1 }\n"a,c" = { a = 1 }', "(a, b, c)"),
    "ragged": ('labels = ["a"]\n[matrices]\na = [[0, 1], [0]]', "row 2"),
    "unknown_key": ('labels = ["a"]\ncolour = "red"\n[matrices]\na = [[0]]', "'colour'"),
    "keyword": ('labels = ["int"]\n[matrices]\nint = [[1]]', "keyword"),
    "expression": ('labels = ["a"]\n[matrices]\na = [["__import__(1)"]]', "column 1"),
    "symbol": ('labels = ["a"]\n[matrices]\na = [["x + 1"]]', "column 1"),
    "nan": ('labels = ["a"]\n[matrices]\na = [[nan]]', "matrices.a[1][1]"),
    "both": ('labels = ["a"]\n[matrices]\na = [[1]]\n[brackets]\n', "exactly one"),
}  # fmt: skip


@pytest.mark.parametrize("case", sorted(BAD_FILES))
def test_a_bad_group_file_is_refused_with_status_2_and_one_line(cli, case: str, tmp_path: Path) -> None:
    body, expected = BAD_FILES[case]
    path = tmp_path / f"{case}.toml"
    path.write_text(f'name = "{case}"\n{body}\n')
    done = cli("check", path.name)
    assert done.returncode == 2
    assert expected in done.stderr
    assert path.name in done.stderr, "the message names the file"
    assert len(done.stderr.strip().splitlines()) == 1
    assert not done.stdout


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--target", "0.1,0.2,0.3", "--controls", "w1"), "growth vector (1)"),
        (("--target", "0.1,0.2", "--controls", "w1,w2"), "needs 3 real numbers"),
        (("--target", "0.1,0.2,nan", "--controls", "w1,w2"), "--target: column 1: no name 'nan'"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w9"), "'w9'"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--duration", "0"), "duration"),
        (("--target", "0.1,0,0.3", "--controls", "w1,w2,w3", "--method", "four_phase"), "exactly two controls"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--method", "magic"), "'magic'"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--method", "circle", "--bounds", "1"), "no option bounds"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--bounds", "1:2:3"), "'1:2:3'"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--bounds", "w1=1,2"), "label=either"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--bounds", "w9=1"), "'w9'"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--via", "0.5"), "FRACTION@COORDINATES"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--cone", "0,0,1@1,0@0.3"), "3 real numbers"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--ball", "0,0,1@0.3"), "Ball"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--box", "0,0,1@1,1,1"), "Box"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--box", "0,0,1"), "CENTER@HALF_SIZES"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--box", "0,0,1@1,1,1@1,2"), "nine numbers"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--cylinder", "0,0,1@1,1,1@1@flat"), "[@rounded]"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--weights", "1,-2"), "weights"),
        (("--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--starts", "0"), "starts"),
    ],
)
def test_a_bad_steering_task_is_refused_with_status_2(
    cli, arguments: tuple[str, ...], expected: str, tmp_path: Path
) -> None:
    done = cli("steer", "so3", *arguments)
    assert done.returncode == 2
    assert expected in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_obstacles_as_they_are_written() -> None:
    turned = "0,-1,0,1,0,0,0,0,1"
    found = obstacles_of(
        ["0,0,1@1,0,0@1/4"],
        ["1,0.5@0.2"],
        ["1,0.5@0.2,0.3@pi/2", f"0,0,1@1,2,3@{turned}", "1,0@1,1"],
        ["0,0@1,1@0.3", "0,0,0@0,0,2@1/4@rounded"],
    )
    expected = [
        lc.Cone((0, 0, 1), (1, 0, 0), 0.25),
        lc.Ball((1, 0.5), 0.2),
        lc.Box((1, 0.5), (0.2, 0.3), [[np.cos(np.pi / 2), -1], [1, np.cos(np.pi / 2)]]),
        lc.Box((0, 0, 1), (1, 2, 3), [[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
        lc.Box((1, 0), (1, 1)),
        lc.Cylinder((0, 0), (1, 1), 0.3),
        lc.Cylinder((0, 0, 0), (0, 0, 2), 0.25, rounded=True),
    ]
    for one, other in zip(found, expected, strict=True):
        assert type(one) is type(other)
        assert vars(one) == vars(other)


def test_a_car_goes_around_a_box(cli) -> None:
    done = cli(
        "steer",
        "se2",
        "--target=0,2,0.2",
        "--controls",
        "omega,vx",
        "--duration",
        "4",
        "--box",
        "1,0.3@0.2,0.25@0.3",
        "--json",
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["error"] < 1e-6


def test_an_output_folder_that_is_not_ours_is_left_alone(cli, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    precious = tmp_path / "mine" / "thesis.txt"
    precious.write_text("years of work")
    done = cli("generate", "h3", "--out", "mine")
    assert done.returncode == 2
    assert "mine is not empty" in done.stderr
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.txt"]
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert cli("generate", "h3", "--out", "file/inside").returncode == 2


def test_steer_and_simulate_print_json(cli, tmp_path: Path) -> None:
    steer = cli("steer", "h3", "--target", "0,0,1", "--controls", "x,y", "--json")
    plan = json.loads(steer.stdout)
    assert abs(plan["cost"] - 12.566370614359172) < 1e-4
    simulated = cli("simulate", "so3", "--u", "cos(t)", "--u", "sin(t)", "--u", "0", "--end", "2*0+1")
    assert simulated.returncode == 2, "numbers of options are plain numbers"
    simulated = cli("simulate", "so3", "--u", "0", "--u", "0", "--u", "pi/2", "--end", "1", "--json")
    X = json.loads(simulated.stdout)["X_final"]
    assert max(abs(X[0][1] + 1), abs(X[1][0] - 1), abs(X[0][0])) < 1e-12


@pytest.mark.parametrize(
    ("method", "energy"),
    [
        (("--method", "circle"), 0.8 * (4 * math.pi - 0.8)),
        (("--weights", "2,2"), 0.8 * (4 * math.pi - 0.8)),
        (("--bounds", "w1=-9:9,w2=9", "--rest", "--via", "0.5@0.1,0.1,0.4"), None),
    ],
)
def test_steer_takes_options_and_draws_a_picture(
    cli, method: tuple[str, ...], energy: float | None, tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    task = ("--target", "0,0,0.8", "--controls", "w1,w2", "--picture", "plans/plan.png", "--json")
    done = cli("steer", "so3", *task, *method)
    plan = json.loads(done.stdout)
    assert plan["error"] < 1e-7
    if energy is not None:
        assert plan["cost"] == pytest.approx(energy, rel=1e-6)
    else:
        assert plan["method"] == "transcription"
        assert max(abs(plan["u"][0][0]), abs(plan["u"][-1][1])) < 1e-6
    assert Path(plan["picture"]) == tmp_path / "plans" / "plan.png"
    assert Path(plan["picture"]).stat().st_size > 20_000


def test_average_prints_exact_coefficients_and_measures_its_order(cli, tmp_path: Path) -> None:
    u = ("--u", "cos(t)", "--u", "sin(t)", "--u", "0")
    done = cli("average", "so3", *u, "--order", "3", "--check", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["exact_F"] == [["0", "0", "0"], ["0", "0", "1/2"], ["1/2", "0", "0"]]
    assert result["check"]["passed"]
    assert cli("average", "so3", "--u", "cos(t)").returncode == 2


def test_a_usage_error_is_one_line_that_names_the_help(cli) -> None:
    for arguments, words in (
        (("steer", "so3"), "'--target'. See lie-codegen steer --help"),
        (("nope",), "'nope'. See lie-codegen --help"),
        (("list", "--out"), "--out"),
    ):
        done = cli(*arguments)
        assert done.returncode == 2
        assert done.stdout == ""
        assert done.stderr.count("\n") == 1
        assert words in done.stderr


def test_json_has_no_nan(cli) -> None:
    done = cli("average", "h3", "--u", "cos(t)", "--u", "sin(t)", "--u", "0", "--order", "3", "--check", "--json")
    json.loads(done.stdout, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


def test_manners_of_the_command_line(cli, tmp_path: Path) -> None:
    done = cli("--version")
    assert done.stdout.strip() == f"lie-codegen {__version__}, numerics {NUMERICS_VERSION}"
    assert "Usage" in cli("-h").stdout
    (tmp_path / "target.csv").write_text("1 0 0\n0, 0, -1\n0 1 0\n")
    by_file = cli("steer", "SO(3)", "--target", str(tmp_path / "target.csv"), "--controls", "w1,w2")
    assert "endpoint error" in by_file.stdout
    refused = cli("steer", "so3", "--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--picture", "plan.xyz")
    assert refused.returncode == 2
    assert len(refused.stderr.strip().splitlines()) == 1


def test_generate_takes_laws_a_plan_and_a_steering_solver(cli, tmp_path: Path) -> None:
    task = ("steer", "so3", "--target", "0.1,0.2,0.3", "--controls", "w1,w2", "--method", "optimal")
    assert cli(*task, "--save", "plan.npz").returncode == 0
    Path("pd.toml").write_text('law = "attitude"\nkind = "pd"\ninertia = [1, 2, 3]\nk_p = 4\nk_d = 6\n')
    done = cli(
        "generate", "so3", "--law", "pd.toml", "--plan", "plan.npz", "--steering", "w1,w2", "--out", "out", "--json"
    )
    assert done.returncode == 0, done.stderr
    files = set(json.loads(done.stdout)["files"])
    assert {"src/so3.c", "src/so3_plan.c", "so3_plan_replay.c", "steering/example.c"} <= files
    assert "so3_attitude_pd(" in Path("out/include/so3.h").read_text()
    for arguments, words in (
        (("se3", "--plan", "plan.npz"), "not on se3"),
        (("so3", "--plan", "none.npz"), "none.npz"),
        (("so3", "--law", "none.toml"), "cannot be read"),
        (("so3", "--steering", "w9,w1"), "w9"),
        ((*task[1:], "--save", "no/plan.npz"), "no/plan.npz"),
    ):
        done = cli(task[0] if arguments[-2] == "--save" else "generate", *arguments)
        assert done.returncode == 2, arguments
        assert words in done.stderr
        assert done.stderr.count("\n") == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_what_the_system_refuses_is_no_fault_of_the_input(cli) -> None:
    """Exit status 1 for a full disk, 2 for a place where nothing can be written."""
    motion = ("simulate", "so3", "--u", "cos(t)", "--u", "0", "--u", "0", "--end", "1", "--out")
    full, nowhere = cli(*motion, "/dev/full"), cli(*motion, "/dev/null/run.csv")
    assert full.returncode == 1
    assert "No space left" in full.stderr
    assert nowhere.returncode == 2
    assert "Not a directory" in nowhere.stderr
    assert all(len(done.stderr.splitlines()) == 1 for done in (full, nowhere))


def test_law_lists_kinds_shows_saves_and_writes(cli, tmp_path: Path) -> None:
    kinds = json.loads(cli("law", "--json").stdout)["kinds"]
    assert {"attitude", "tracking", "integral", "pointing"} <= set(kinds)
    assert "K_d" in cli("law", "tracking").stdout
    Path("t.toml").write_text(
        'law = "tracking"\ninertia = [1, 2, 3]\nerror = "so3_right"\nfeedforward = "levi_civita"\n'
        "gains = { K_p = [4, 5, 6], K_d = 6 }\n"
    )
    done = cli("law", "t.toml", "--group", "so3", "--certify", "--save", "t.npz", "--out", "pkg", "--json")
    assert done.returncode == 0, done.stderr
    data = json.loads(done.stdout)
    assert data["symbol"] == "so3_tracking_law"
    assert [each["name"] for each in data["inputs"]] == ["X", "xi", "X_d", "xi_d", "xi_d_dot"]
    assert data["parameters"]["inertia"] == [1, 2, 3]
    assert data["certificate"]["rate"] > 0
    assert Path("pkg/include").is_dir()
    # what was saved is the same law: by its values at one state
    state = (np.eye(3), [0.1, 0.2, 0.3], np.eye(3)[[1, 2, 0]], [0, 0, 0.1], [0, 0, 0])
    given = dict(zip(("X", "xi", "X_d", "xi_d", "xi_d_dot"), state, strict=True))
    again, fresh = (
        lc.build([law]).tracking_law(**given) for law in (lc.load("t.npz"), lc.read_law("t.toml", group="so3"))
    )
    np.testing.assert_array_equal(again.force, fresh.force)
    assert cli("law", "t.npz").stdout.startswith("so3.tracking_law: f = ")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("none.toml",), "cannot be read"),
        (("nothing",), "neither a file nor a kind of law"),
        (("none.npz",), "no file that save() wrote"),
        (("tracking", "--out", "pkg"), "--out is of one law"),
        (("list.toml",), "law = [1] is not known"),
        (("plan.npz",), "no law"),
    ],
)
def test_what_is_no_law_is_refused(cli, arguments: tuple[str, ...], words: str, tmp_path: Path) -> None:
    Path("list.toml").write_text("law = [1]\n")
    lc.group("so3").save("plan.npz")
    done = cli("law", *arguments)
    assert done.returncode == 2, done.stderr
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


def test_docs_tells_of_public_names_and_offers_near_ones(cli) -> None:
    subjects = json.loads(cli("docs", "--json").stdout)["subjects"]
    told = {name for names in subjects.values() for name in names} | set(subjects)
    assert set(lc.__all__) - told <= {"__version__"}
    assert cli("docs", "lc.steer").stdout.startswith("lc.steer(group, target, controls, duration")
    assert "npz file" in cli("docs", "Plan.save").stdout
    assert "cost: int_0^duration" in cli("docs", "Plan.cost").stdout
    for name, near in (("steeer", "steer"), ("Plan.sav", "save"), ("..", "no public name")):
        done = cli("docs", name)
        assert done.returncode == 2
        assert near in done.stderr
