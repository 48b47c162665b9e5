"""The command line: lie-codegen list | show | new | check | generate | build | law | simulate | steer | average | study | page | docs | ..."""

from __future__ import annotations

import sys
import warnings
from typing import Annotated, Any, cast

import typer

from lie_codegen import __version__
from lie_codegen.cli import averages, bench, code, groups, laws, manual, motion, pages, studies
from lie_codegen.cli.output import complain, emit
from lie_codegen.codegen.numerics import NUMERICS_VERSION
from lie_codegen.errors import InputError, LieCodegenError

app = typer.Typer(
    name="lie-codegen",
    help="From a Lie algebra to fast C: exact Wei-Norman equations, generated C, simulation and steering.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        told = {"version": __version__, "numerics": NUMERICS_VERSION}
        emit(f"lie-codegen {__version__}, numerics {NUMERICS_VERSION}", told, False)
        raise typer.Exit


@app.callback()
def _before(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """From a Lie algebra to fast C: exact Wei-Norman equations, generated C, simulation and steering."""


for _room in (groups, code, laws, motion, averages, pages, manual, bench):
    for _command in _room.commands:
        app.command()(_command)
app.add_typer(studies.app)


#: click's error of usage, or that of the copy of click that typer brings from version 0.26 on.
_UsageError: type[Exception] = typer.BadParameter.__bases__[0]


def _one_line(error: Any) -> str:
    """A usage error in one line that names the command whose --help says more; the help itself as it is."""
    path = error.ctx.command_path if error.ctx is not None else ""
    words = " ".join(["lie-codegen", *path.split("lie_codegen")[-1].split("lie-codegen")[-1].split(), "--help"])
    message = str(error.format_message())
    return message if "\n" in message.strip() else f"lie-codegen: {message} See {words}."


def _show_warning(message: Any, *rest: Any, **named: Any) -> None:
    complain(f"lie-codegen: warning: {message}")


def main() -> None:
    """Entry point: exit status 2 for bad input with one line, 1 for a computation that failed or a system that refuses."""
    warnings.showwarning = cast(Any, _show_warning)
    try:
        sys.exit(app(standalone_mode=False))
    except _UsageError as error:
        complain(_one_line(error))
        sys.exit(2)
    except typer.Abort:
        sys.exit(1)
    except InputError as error:
        complain(f"lie-codegen: {error}")
        sys.exit(2)
    except LieCodegenError as error:
        complain(f"lie-codegen: {error}")
        sys.exit(1)
    except (OSError, MemoryError) as error:
        complain(f"lie-codegen: the system refuses: {error or type(error).__name__}")
        sys.exit(1)
    except RecursionError:
        complain("lie-codegen: what was given is nested too deep")
        sys.exit(2)
