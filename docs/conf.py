"""The site: `python -m pip install '.[docs]' && python -m sphinx -W -b html docs docs/_build`."""

from __future__ import annotations

import importlib.metadata
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import pages

project = "lie_codegen"
author = copyright = "lie_codegen developers"
release = importlib.metadata.version("lie_codegen")
extensions = ["myst_nb", "sphinx_design", "sphinx_copybutton"]
exclude_patterns = ["_build", "**/.ipynb_checkpoints", "jupyter_execute"]
html_theme = "furo"
html_title = "lie_codegen"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme_options = {"navigation_with_keys": True}
nb_execution_mode = "cache"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_output_stderr = "remove"  # progress lines
nb_ipywidgets_js: dict[str, Any] = {}  # no page fetches anything
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
suppress_warnings = ["myst.xref_missing", "myst.header", "mystnb.unknown_mime_type"]
highlight_language = "python"


def setup(app: Any) -> None:
    """The reference is written from what there is before the pages are read."""
    app.connect("builder-inited", lambda _: pages.write(Path(__file__).parent / "reference"))
