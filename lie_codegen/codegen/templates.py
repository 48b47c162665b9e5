"""The Jinja environment: strict, without escaping, without a clock."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lie_codegen.errors import MissingDependencyError

if TYPE_CHECKING:
    import jinja2


@cache
def template_folder() -> Path:
    """Where the templates are: inside the installed package, or beside it in a checkout.

    Raises:
        MissingDependencyError: neither is there.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / "templates", package.parent / "templates"):
        if (folder / "header.h.jinja").is_file():
            return folder
    raise MissingDependencyError("the templates of lie_codegen are not installed: install the package again")


@cache
def environment() -> jinja2.Environment:
    """The one environment."""
    import jinja2

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(template_folder()),
        undefined=jinja2.StrictUndefined,
        autoescape=False,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def render(template: str, **views: Any) -> str:
    """One template as text, ending in one newline."""
    return environment().get_template(template).render(**views).rstrip("\n") + "\n"
