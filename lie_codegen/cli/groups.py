"""Commands about groups: list, show, new, check."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from lie_codegen.cli.output import emit
from lie_codegen.errors import OutputFolderError, write_refusal
from lie_codegen.identifiers import check_identifier

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
#: Dimension up to which M(g) is printed unasked.
_SHOWN = 6
GroupName = Annotated[
    str,
    typer.Argument(help="A catalogue name, the path of a group file (.toml), or - for a group file on standard input."),
]


def list_groups(
    table: Annotated[bool, typer.Option("--table", help="The README's Markdown table, with times to derive.")] = False,
    json: Json = False,
) -> None:
    """List the catalogue."""
    if table:
        from lie_codegen.cli.catalogue_table import catalogue_table

        text = catalogue_table(with_times=True)
        emit(text, {"table": text}, json)
        return
    from lie_codegen.groups.catalogue_load import group
    from lie_codegen.groups.catalogue_names import group_names

    found = [group(name) for name in group_names()]
    rows = [
        f"{g.name:8} dim {g.dim:2}  {g.degree} x {g.degree}  ({', '.join(g.labels)})  {g.description}" for g in found
    ]
    data = [
        {"name": g.name, "dim": g.dim, "degree": g.degree, "labels": g.labels, "about": g.description} for g in found
    ]
    emit("\n".join(rows), {"groups": data}, json)


def show(
    group: GroupName,
    matrix: Annotated[
        bool | None, typer.Option("--matrix/--no-matrix", help="Print M(g); by default up to dimension 6.")
    ] = None,
    json: Json = False,
) -> None:
    """Show a group: basis, brackets, structure, Wei-Norman matrix, chart and a better order, all exact."""
    from lie_codegen.groups.catalogue_load import group as load
    from lie_codegen.groups.structure import structure
    from lie_codegen.groups.wei_norman.chart_domain import chart_domain
    from lie_codegen.groups.wei_norman.matrix import wei_norman
    from lie_codegen.groups.wei_norman.order import wei_norman_order

    g = load(group)
    domain, order = chart_domain(g), wei_norman_order(g)
    rows = wei_norman(g).M.tolist() if (g.dim <= _SHOWN if matrix is None else matrix) else []
    data = {
        "name": g.name,
        "description": g.description,
        "dim": g.dim,
        "degree": g.degree,
        "complex": g.is_complex,
        "labels": g.labels,
        "units": g.units,
        "brackets": _brackets(g),
        "structure": structure(g).kind,
        "wei_norman_matrix": [[str(entry) for entry in row] for row in rows],
        "determinant_of_inverse": str(domain.determinant),
        "chart": domain.text,
        "recommended_order": order.labels,
        "recommended_because": order.reason,
    }
    lines = [
        f"{g.name}: {g.description or 'no description'}",
        f"dimension {g.dim}, {g.degree} x {g.degree} {'complex' if g.is_complex else 'real'} matrices, {data['structure']}",
        "basis     " + ", ".join(f"{a} [{b}]" if b else a for a, b in zip(g.labels, g.units, strict=True)),
        "brackets  " + ("; ".join(f"{pair} = {value}" for pair, value in _brackets(g).items()) or "none"),
        "g' = M(g) u for X = " + " ".join(f"exp(g{i} {a})" for i, a in enumerate(g.labels, start=1)),
        *(f"  M[{i}] = [{', '.join(map(str, row))}]" for i, row in enumerate(rows, start=1)),
        f"  det M^-1 = {domain.determinant}",
        f"chart     {domain.text}",
        f"order     {', '.join(order.labels)}: {order.reason}",
    ]
    emit("\n".join(lines), data, json)


def _brackets(g: Any) -> dict[str, str]:
    names = g.labels
    return {
        f"[{names[i]}, {names[j]}]": " + ".join(
            f"({value}) {names[k]}" if value != 1 else names[k] for k, value in row.items()
        )
        for (i, j), row in g.algebra.table.items()
    }


def new(
    name: Annotated[str, typer.Argument(help="Name of the group: a C identifier.")],
    out: Annotated[Path | None, typer.Option(help="File to write; NAME.toml by default.")] = None,
    json: Json = False,
) -> None:
    """Write a commented group file to start from."""
    from lie_codegen.codegen.templates import render

    check_identifier(name, "group name")
    path = out or Path(f"{name}.toml")
    text = render("group.toml.jinja", name=name)
    try:
        with path.open("x", encoding="utf-8") as stream:
            stream.write(text)
    except FileExistsError:
        raise OutputFolderError(f"{path} exists already; choose another --out") from None
    except OSError as error:
        raise write_refusal(f"{path} cannot be written", error) from None
    emit(f"wrote {path}; edit it, then: lie-codegen check {path}", {"file": path}, json)


def check(
    file: Annotated[Path, typer.Argument(help="The group file.")],
    json: Json = False,
) -> None:
    """Prove a group file: closure, independence, Jacobi identity, names."""
    from lie_codegen.groups.catalogue_load import group as load

    started = time.perf_counter()
    g = load(file)
    seconds = time.perf_counter() - started
    text = (
        f"{file}: {g.name} is a Lie algebra of dimension {g.dim} ({', '.join(g.labels)}) with {g.degree} x {g.degree} "
        f"{'complex' if g.is_complex else 'real'} matrices; proved exactly in {seconds:.2f} s"
    )
    data = {"file": file, "name": g.name, "dim": g.dim, "degree": g.degree, "labels": g.labels, "seconds": seconds}
    emit(text, data, json)


list_groups.__name__ = "list"
commands = (list_groups, show, new, check)
