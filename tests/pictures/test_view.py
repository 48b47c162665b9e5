"""The page that moves: its numbers are Python's, it holds nothing from elsewhere, and a browser shows it without an error."""

from __future__ import annotations

import base64
import importlib.util
import json
import re
import struct
from pathlib import Path
from typing import Any

import command_line
import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.pictures.scene import motion_of


def data_of(page: Path) -> Any:
    found = re.search(
        r'<script id="data" type="application/json">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL
    )
    assert found is not None
    return json.loads(found.group(1))


@pytest.fixture(scope="module")
def plan() -> lc.Plan:
    return lc.steer("so3", [0.5, -0.3, 0.9], ("w1", "w2"), 24.0)


def test_a_plan(plan: lc.Plan, tmp_path: Path) -> None:
    cone = lc.Cone((0, 0, 1), (1, 0, 1), 0.3)
    page = lc.view(plan, tmp_path / "p.html", body="satellite", obstacles=[cone], title="A <slew> & more", samples=51)
    data = data_of(page)
    t = np.linspace(0, 24, 51)
    assert np.array_equal(data["t"], t)
    assert np.array_equal(np.reshape(data["motions"][0]["R"], (51, 3, 3)), plan.X(t))
    assert np.array_equal(np.transpose(data["series"][0]["values"]), plan.inputs(t))
    assert data["cones"][0]["angle"] == 0.3
    text = page.read_text(encoding="utf-8")
    assert "<title>A &lt;slew&gt; &amp; more</title>" in text
    # nothing comes from elsewhere
    assert not re.search(r"(src|href)\s*=|https?://|@import|url\(", text)


def test_poses_planes_and_points(tmp_path: Path) -> None:
    for name in ("se2", "se3", "h3", "su2"):
        group = lc.group(name)
        u = [f"cos(t + {i})/2" for i in range(group.dim)]
        run = lc.simulate(name, u, t=np.linspace(0, 3, 31))
        data = data_of(lc.view(run, tmp_path / f"{name}.html"))
        motion = data["motions"][0]
        R = np.reshape(motion["R"], (31, 3, 3))
        assert np.max(np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3))) < 1e-12
        if name == "se3":
            assert np.array_equal(np.reshape(motion["p"], (31, 3)), run.X[:, :3, 3])
        if name == "se2":
            assert np.array_equal(np.reshape(motion["p"], (31, 3))[:, :2], run.X[:, :2, 2])


def test_a_closed_loop_and_its_reference(tmp_path: Path) -> None:
    reference = lc.reference("so3", ["t/4", "0", "sin(t)/5"])
    law = lc.tracking_law("so3", inertia=[1, 2, 3], error="so3_right", gains={"K_p": [4, 4, 4], "K_d": 3})
    run = lc.closed_loop("so3", inertia=[1, 2, 3], law=law, reference=reference, t=np.linspace(0, 5, 26), step=0.05)
    data = data_of(lc.view(run, tmp_path / "l.html", group="so3"))
    assert np.array_equal(np.reshape(data["motions"][1]["R"], (26, 3, 3)), run.X_d)


def test_a_body_of_ones_own(plan: lc.Plan, tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]], dtype="<f4")
    order = np.array([0, 1, 2, 0, 1, 3, 0, 2, 3], dtype="<u2")
    raw = points.tobytes() + order.tobytes()
    record: dict[str, Any] = {
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "scale": [1, 1, 3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 9, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 18}],
        "buffers": [{"byteLength": len(raw), "uri": "data:application/octet-stream;base64," + base64.b64encode(raw).decode()}],
    }  # fmt: skip
    (tmp_path / "b.gltf").write_text(json.dumps(record))
    faces = np.array(data_of(lc.view(plan, tmp_path / "g.html", body=tmp_path / "b.gltf"))["faces"])
    assert faces.shape == (3, 3, 3)
    assert np.allclose(faces[1, 2], [0, 0, 1])
    # the same as one binary file
    del record["buffers"][0]["uri"]
    text = json.dumps(record).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(raw), 0x004E4942) + raw
    (tmp_path / "b.glb").write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body)
    assert np.array_equal(
        np.array(data_of(lc.view(plan, tmp_path / "h.html", body=tmp_path / "b.glb"))["faces"]), faces
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"path": "p.png"}, "html"),
        ({"body": "cube"}, "body is one of"),
        ({"body": "none.glb"}, "cannot be read"),
        ({"samples": 1}, "samples"),
        ({"what": 3}, "a page shows"),
    ],
)
def test_what_is_refused(plan: lc.Plan, tmp_path: Path, change: dict[str, Any], said: str) -> None:
    what = change.pop("what", plan)
    path = tmp_path / change.pop("path", "p.html")
    with pytest.raises(lc.errors.InputError, match=said):
        lc.view(what, path, **change)
    assert not path.exists()


def test_the_command(tmp_path: Path) -> None:
    done = command_line.run(
        "page", "se2", "--controls", "omega,vx", "--still", "--out", "q.html", "--json", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert data_of(tmp_path / "q.html")["motions"][0]["kind"] == "plane"


TURNED = [[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]
FLAT = [
    lc.Box((1.0, 0.8), (0.2, 0.4), [[0.8, -0.6], [0.6, 0.8]]),
    lc.Cylinder((1.2, -0.9), (1.9, -0.3), 0.1),
    lc.Cylinder((0.1, -0.9), (0.6, -0.5), 0.1, rounded=True),
]
IN_SPACE = [
    lc.Box((1.0, 0.8, 0.0), (0.2, 0.4, 0.3), TURNED),
    lc.Cylinder((1.2, -0.9, 0.3), (1.9, -0.3, 0.8), 0.1),
    lc.Cylinder((0.1, -0.9, 0.0), (0.6, -0.5, 0.7), 0.1, rounded=True),
]


@pytest.mark.parametrize(("name", "solids"), [("se2", FLAT), ("se3", IN_SPACE)])
def test_boxes_and_cylinders_are_drawn_on_their_surfaces(
    tmp_path: Path, tab: Any, name: str, solids: list[lc.Box | lc.Cylinder]
) -> None:
    """The lines lie on the surfaces (those over the flat ends alone go through nothing else), close, and are seen in a browser."""
    run = lc.simulate(
        name, ["0"] * 2 + ["1/2"] if name == "se2" else ["0"] * 3 + ["1/2", "0", "0"], t=np.linspace(0, 4, 11)
    )
    page = lc.view(run, tmp_path / "p.html", obstacles=solids)
    data = data_of(page)
    for solid, lines in zip(solids, data["solids"], strict=True):
        q = len(solid.solid().centers[0])
        X = np.tile(np.eye(q + 1), (sum(map(len, lines)), 1, 1))
        X[:, :-1, -1] = np.concatenate(lines)[:, :q]
        assert np.max(np.abs(solid.clearance(X))) < 1e-12
        for line in lines:
            middles = (np.array(line[1:]) + np.array(line[:-1])) / 2
            between = np.tile(np.eye(q + 1), (len(middles), 1, 1))
            between[:, :-1, -1] = middles[:, :q]
            assert np.max(np.abs(solid.clearance(between))) < 0.01 * 0.4  # chords of circles
        assert np.allclose(lines[0][0], lines[0][-1], atol=1e-14)
    low, high = np.min(np.concatenate(data["solids"][0]), axis=0), np.max(np.concatenate(data["solids"][0]), axis=0)
    assert np.all(np.abs((low + high) / 2 - data["middle"]) < 2 * data["reach"])
    tab.set_viewport_size({"width": 320, "height": 800})
    tab.goto(page.as_uri())
    assert tab.evaluate("document.documentElement.scrollWidth") <= 320
    seen = tab.locator("#space").screenshot()
    tab.goto(lc.view(run, tmp_path / "bare.html").as_uri())
    assert tab.locator("#space").screenshot() != seen


def test_a_long_wall_does_not_make_the_way_small(tmp_path: Path) -> None:
    run = lc.simulate("se2", ["0", "1/2", "0"], t=np.linspace(0, 4, 11))
    reach = data_of(lc.view(run, tmp_path / "p.html"))["reach"]
    wall = data_of(lc.view(run, tmp_path / "w.html", obstacles=[lc.Box((0.0, 60.0), (500.0, 0.1))]))["reach"]
    assert wall < 2.5 * reach


def test_in_a_browser(plan: lc.Plan, tmp_path: Path, tab: Any) -> None:
    tab.goto(lc.view(plan, tmp_path / "p.html", body="satellite", samples=51).as_uri())
    t = np.linspace(0, 24, 51)
    for i in (0, 20, 50):
        pose = tab.evaluate(f"lieView.pose({i})")
        assert pose["t"] == t[i]
        assert np.array_equal(np.reshape(pose["R"], (3, 3)), plan.X(t)[i])
    before = tab.locator("#space").screenshot()
    tab.locator("#time").fill("30")
    assert tab.evaluate("lieView.place") == 30
    tab.locator("#space").focus()
    tab.keyboard.press("ArrowLeft")
    assert tab.locator("#space").screenshot() != before
    tab.locator("#plots").tap(position={"x": 200, "y": 60})
    assert 0 < tab.evaluate("lieView.place") < 30
    tab.locator("#play").click()
    tab.wait_for_function("lieView.place > 0 && document.getElementById('play').textContent === 'Pause'")
    for width in (320, 1200):
        tab.set_viewport_size({"width": width, "height": 800})
        assert tab.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("name", ["so3", "se2", "se3", "su2"])
def test_the_page_of_an_average_integrates_as_python_does(tmp_path: Path, tab: Any, name: str) -> None:
    texts = ["cos(t)", "sin(t)/2", "cos(2*t)/3 + 1/5", "sin(t)/4", "0", "cos(t)/5"][: lc.group(name).dim]
    u = lc.PeriodicInput(texts)
    average = lc.average(name, u, order=3)
    tab.goto(lc.view(average, tmp_path / "a.html").as_uri())
    eps, group = 0.1, lc.group(name)
    for phase in (0, 17):
        call = f"(() => {{ const s = lieAverage.states({eps}, {phase}); return [s.actual.at(-1), s.mean.at(-1)]; }})()"
        found = tab.evaluate(call)
        first, last = 2 * np.pi * phase / 64, 2 * np.pi * phase / 64 + 12 * 2 * np.pi
        # from the identity at the phase: Phi(first)^-1 Phi(last) of the flow Phi from 0
        flow = lc.simulate(name, u, t=[0, first, last] if phase else [0, last], eps=eps, rtol=1e-12).X
        actual = np.linalg.solve(flow[-2], flow[-1])
        mean = np.linalg.solve(*average.state(eps, np.array([first, last])))
        if name == "su2":
            actual, mean = (
                np.stack([group.vee(X @ b @ np.linalg.inv(X)) for b in group.basis], axis=1) for X in (actual, mean)
            )
        assert np.max(np.abs(np.array(found[0]) - actual)) < 1e-7  # 64 steps a period of a method of order 4
        assert np.max(np.abs(np.array(found[1]) - mean)) < 1e-12
    tab.locator("#phase").fill("16")
    assert tab.locator("#phase_now").inner_text() == "90\u00b0"
    tab.locator("#eps").fill("0.4")
    assert tab.locator("#eps_now").inner_text() == "0.40"


@pytest.fixture(scope="module", params=["so3", "se2", "su2"])
def solved(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """A group and its page with the solver, which compiles for seconds: once for all the tests of it."""
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip("no ziglang")
    name = str(request.param)
    plan = lc.steer(name, [0.5, -0.3, 0.9], lc.group(name).labels[:2], 8.0, "optimal")
    return name, lc.view(plan, tmp_path_factory.mktemp("solved") / f"{name}.html", solve=True)


@pytest.mark.slow
def test_the_solver_in_the_page_gives_the_digits_of_python(solved: tuple[str, Path], tab: Any) -> None:
    name, page = solved
    group = lc.group(name)
    tab.goto(page.as_uri())
    log = lc.build(name).log
    for target in ([0.5, -0.3, 0.9], [0.2, 0.4, -0.6], [-0.8, 0.1, 0.3]):
        other = lc.steer(name, target, group.labels[:2], 8.0, "optimal")
        x = np.asarray(log(np.asarray(other.target))).tolist()
        found = tab.evaluate(f"(() => {{ const r = lieSolver.solve({x}); return [r.status, r.cost, r.X]; }})()")
        assert found[0] == 1
        assert found[1] == pytest.approx(other.cost, rel=1e-12)
        last = np.array(found[2]).view(group.basis.dtype).reshape(201, group.degree, group.degree)[-1]
        assert np.max(np.abs(last - other.target)) < 1e-10
    tab.evaluate(f"lieSolver.moveTo({x})")
    R = np.reshape(tab.evaluate("lieView.pose(200).R"), (3, 3))
    assert np.max(np.abs(R - motion_of(group, other.target[None]).R[0])) < 1e-10


def ring_of(tab: Any, k: int) -> Any:
    return np.array(tab.evaluate(f"lieSolver.ring({k})"))


def goal_of(tab: Any, name: str) -> Any:
    """The target as Python has it; the page has complex entries a + ib as [[a, -b], [b, a]]."""
    shown = np.array(tab.evaluate("lieSolver.goal"))
    return shown[::2, ::2] + 1j * shown[1::2, ::2] if lc.group(name).is_complex else shown


def goal_in_step(tab: Any, name: str) -> Any:
    """The target that the page shows, of which the cost, the sliders and their texts are held to be."""
    goal = goal_of(tab, name)
    x = np.asarray(lc.build(name).log(goal))
    assert np.max(np.abs(np.array(tab.evaluate("lieSolver.x")) - x)) < 1e-12
    for i, value in enumerate(x):
        assert float(tab.locator(f"#target_{i}").input_value()) == pytest.approx(value, abs=0.00501)
        assert float(tab.locator("#knobs output").nth(i).inner_text().split()[0]) == pytest.approx(value, abs=0.00501)
    plan = lc.steer(name, goal, lc.group(name).labels[:2], 8.0, "optimal")
    cost = float(tab.locator("#facts td").first.inner_text())
    assert cost == pytest.approx(plan.cost, rel=1e-11)  # twelve digits are shown
    return goal


@pytest.mark.slow
def test_the_target_is_dragged_by_mouse_and_finger(solved: tuple[str, Path], tab: Any) -> None:
    name, page = solved
    tab.goto(page.as_uri())
    assert "drag the ring" in tab.locator("#legend").inner_text()
    eye = tab.evaluate("[yaw, pitch]")
    before = goal_in_step(tab, name)

    def mouse(start: Any, way: tuple[float, float]) -> None:
        tab.mouse.move(*start)
        tab.mouse.down()
        tab.mouse.move(*(start + np.array(way)), steps=5)
        tab.mouse.up()

    # by the tip of its first axis: the tip follows the mouse (which has pixels in single precision), in the plane its direction does
    start = ring_of(tab, 0)
    mouse(start, (-14.0, 11.0))
    tip, goes = ring_of(tab, 0), start + np.array([-14, 11])
    if name != "se2":
        assert np.max(np.abs(tip - goes)) < 1e-3
    else:
        (a, b), (c, d) = tip - ring_of(tab, -1), goes - ring_of(tab, -1)
        assert a * c + b * d > 0
        assert abs(a * d - b * c) < 0.05
    turned = goal_in_step(tab, name)
    assert np.max(np.abs(turned - before)) > 0.05
    if name == "se2":
        assert np.allclose(turned[:2, 2], before[:2, 2], atol=1e-12)
        start = ring_of(tab, -1)
        mouse(start, (30.0, -20.0))
        assert np.max(np.abs(ring_of(tab, -1) - start - (30, -20))) < 1e-3
        moved = goal_in_step(tab, name)
        assert np.allclose(moved[:2, :2], turned[:2, :2], atol=1e-12)
        assert np.all((moved - turned)[:2, 2] > 0.05)
    assert tab.evaluate("[yaw, pitch]") == eye

    # elsewhere the same hand turns the view, and the target stays
    goal = tab.evaluate("lieSolver.goal")
    box = tab.locator("#space").bounding_box()
    mouse(np.array([box["x"] + 12, box["y"] + 12]), (40.0, 10.0))
    assert tab.evaluate("lieSolver.goal") == goal
    assert tab.evaluate("yaw") == pytest.approx(eye[0] - 0.32)

    # by a finger, which is broader
    touch = tab.context.new_cdp_session(tab)
    x, y = ring_of(tab, 1) + np.array([9, -8])
    for kind, points in (
        ("touchStart", [{"x": x, "y": y}]),
        ("touchMove", [{"x": x + 12, "y": y + 9}]),
        ("touchEnd", []),
    ):
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    tab.wait_for_function(f"JSON.stringify(lieSolver.goal) !== '{json.dumps(goal, separators=(',', ':'))}'")
    goal_in_step(tab, name)

    # by a slider, and the rings go with it
    tip = ring_of(tab, 0)
    tab.locator("#target_2").fill("-0.5")
    assert tab.evaluate("lieSolver.x")[2] == -0.5
    assert np.max(np.abs(ring_of(tab, 0) - tip)) > 1
    goal_in_step(tab, name)


@pytest.mark.slow
def test_a_dragged_target_far_round_and_past_the_rim(solved: tuple[str, Path], tab: Any) -> None:
    """Long random drags from ring to ring: logarithms at every angle, beyond the first range of the sliders too."""
    name, page = solved
    tab.goto(page.as_uri())
    box = tab.locator("#space").bounding_box()
    random = np.random.default_rng(23)
    largest, corner = 0.0, np.array([box["x"], box["y"]])
    for _ in range(12):
        tab.mouse.move(*ring_of(tab, int(random.integers(0, 2))))
        tab.mouse.down()
        tab.mouse.move(*(corner + random.uniform(0, 1, 2) * (box["width"], box["height"])), steps=3)
        tab.mouse.up()
        goal, x = goal_of(tab, name), np.array(tab.evaluate("lieSolver.x"))
        R = goal[:2, :2] if name == "se2" else goal
        assert np.max(np.abs(np.conj(R.T) @ R - np.eye(len(R)))) < 1e-12
        assert np.max(np.abs(x - lc.build(name).log(goal))) < 1e-9
        largest = max(largest, float(np.max(np.abs(x))))
        for i in range(3):
            assert float(tab.locator(f"#target_{i}").input_value()) == pytest.approx(x[i], abs=0.00501)
    assert largest > 1.5


def test_the_target_of_a_plan_is_drawn_where_it_is(tmp_path: Path) -> None:
    """The page's numbers: axes and place of the target, and the words that say what is dashed."""
    goal = np.array([[0.0, -1.0, 2.0], [1.0, 0.0, 0.5], [0.0, 0.0, 1.0]])
    data = data_of(lc.view(lc.steer("se2", goal, ("omega", "vx"), 4.0), tmp_path / "p.html", samples=11))
    target = data["target"]
    np.testing.assert_allclose(np.reshape(target["R"], (3, 3))[:2, :2], goal[:2, :2], atol=1e-15)
    np.testing.assert_allclose(target["p"], [2.0, 0.5, 0.0], atol=1e-15)
    assert "Dashed: the target." in data["legend"]
