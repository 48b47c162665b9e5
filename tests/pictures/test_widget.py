"""The page in a notebook's cell: what the widget holds, and, in a browser, that its place in time goes both ways."""

from __future__ import annotations

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import lie_codegen as lc
from lie_codegen.codegen.templates import template_folder
from lie_codegen.pictures.view import page_text


@pytest.fixture(scope="module")
def plan() -> lc.Plan:
    return lc.steer("so3", [0.5, -0.3, 0.9], ("w1", "w2"), 24.0)


def test_without_anywidget_the_error_says_how_to_install(plan: lc.Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "anywidget", None)
    widget_class = import_module("lie_codegen.pictures.widget")._widget_class
    widget_class.cache_clear()
    with pytest.raises(lc.errors.MissingDependencyError, match=r"lie_codegen\[widget\]"):
        lc.widget(plan)
    widget_class.cache_clear()


@pytest.mark.parametrize("height", [0, 200.5, True, 10_000])
def test_a_height_that_is_none(plan: lc.Plan, height: Any) -> None:
    with pytest.raises(lc.errors.InputError, match="height"):
        lc.widget(plan, height=height)


def test_four_kinds(plan: lc.Plan) -> None:
    pytest.importorskip("anywidget")
    law = lc.attitude_law("pd", inertia=[1, 2, 3], k_p=4, k_d=6)
    loop = lc.closed_loop("so3", law=law, inertia=[1, 2, 3], X0=lc.build("so3").exp([0.2, 0, 0.3]), t=[0.0, 1.0, 2.0])
    run = lc.simulate("se2", ["1", "cos(t)", "0"], t=[0, 1, 2])
    average = lc.average("so3", lc.PeriodicInput(["cos(t)", "sin(t)", "0"]), order=2)
    for what, more in ((plan, {}), (run, {}), (loop, {"group": "so3"}), (average, {})):
        shown = lc.widget(what, title="One & two", samples=51, **more)
        assert shown.page == page_text(what, title="One & two", samples=51, **more)
        assert "<title>One &amp; two</title>" in shown.page
        state = shown.get_state()
        assert {"page", "height", "place", "_esm"} <= set(state)
        assert json.dumps(state["page"])
        shown.place = 7
        assert shown.get_state("place") == {"place": 7}


def test_place_goes_both_ways_in_a_browser(plan: lc.Plan, tmp_path: Path, tab: Any) -> None:
    """The module that a notebook loads, with a model as notebooks give one."""
    module = (template_folder() / "page_widget.js").read_text(encoding="utf-8")
    model = {"page": page_text(plan, samples=51), "height": 500, "place": 20}
    page = f"""<!doctype html><div id="cell"></div><script type="module">
      {module.replace("export default", "const made =")}
      const values = {json.dumps(model).replace("</", "<" + chr(92) + "/")}, heard = {{}};
      window.model = {{ get: k => values[k], set: (k, v) => {{ values[k] = v; (heard["change:" + k] || []).forEach(f => f()); }},
        save_changes: () => {{ window.saved = (window.saved || 0) + 1; }},
        on: (e, f) => {{ (heard[e] = heard[e] || []).push(f); }}, off: (e, f) => {{ heard[e] = heard[e].filter(g => g !== f); }} }};
      window.left = made.render({{ model: window.model, el: document.getElementById("cell") }});
    </script>"""
    (tmp_path / "cell.html").write_text(page, encoding="utf-8")
    tab.goto((tmp_path / "cell.html").as_uri())
    inside = "document.querySelector('iframe').contentWindow.lieView"
    tab.wait_for_function("document.querySelector('iframe').contentWindow.lieView?.heard !== undefined")
    assert tab.evaluate(f"{inside}.place") == 20
    tab.evaluate("model.set('place', 33)")
    assert tab.evaluate(f"{inside}.place") == 33
    tab.frame_locator("iframe").locator("#time").fill("12")
    assert tab.evaluate("[model.get('place'), saved]") == [12, 1]
    assert tab.evaluate("document.querySelector('iframe').clientHeight") == 500
    # without a height the cell is as tall as the page, beside the view or below it, and nothing of it is cut
    tab.evaluate("model.set('height', null)")
    tall = {}
    for width in (1200, 500):
        tab.set_viewport_size({"width": width, "height": 700})
        tab.wait_for_timeout(300)
        tall[width], needed = tab.evaluate(
            "(f => [f.clientHeight, f.contentDocument.documentElement.scrollHeight])(document.querySelector('iframe'))"
        )
        assert tall[width] >= needed > 300
    assert tall[500] > tall[1200] + 100
