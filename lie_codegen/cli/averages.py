"""The command about averages: average."""

from __future__ import annotations

import time
from typing import Annotated, Any

import typer

from lie_codegen.cli.groups import GroupName, Json
from lie_codegen.cli.output import emit


def average(
    group: GroupName,
    u: Annotated[
        list[str], typer.Option("--u", help='Formula of t, one for each basis element: --u "cos(t)" --u 0 ...')
    ],
    period: Annotated[str, typer.Option(help="Period of u; pi and sqrt allowed.")] = "2*pi",
    order: Annotated[int, typer.Option(help="Order of the average.")] = 2,
    form: Annotated[str, typer.Option(help="floquet (any order, any mean), product or single.")] = "floquet",
    check: Annotated[bool, typer.Option("--check", help="Measure the order by simulation.")] = False,
    json: Json = False,
) -> None:
    """Average X' = eps X hat(u(t)), exactly: F_1 .. F_p, areas and moments."""
    from lie_codegen.averaging.averaged import average as make_average
    from lie_codegen.averaging.order_check import order_check
    from lie_codegen.groups.catalogue_load import group as load
    from lie_codegen.signals.periodic_input import PeriodicInput

    g = load(group)
    started = time.perf_counter()
    signal = PeriodicInput(u, period=period)
    averaged = make_average(g, signal, order=order, form=form)
    seconds = time.perf_counter() - started
    exact = [[str(value) for value in row] for row in averaged.exact_F]
    data: dict[str, Any] = {
        "group": g.name,
        "order": order,
        "form": form,
        "F": averaged.F,
        "exact_F": exact,
        "seconds": seconds,
    }
    lines = [f"{g.name}, {form} form of order {order}, {seconds:.3f} s; basis {', '.join(g.labels)}"]
    lines += [f"  F_{q} = ({', '.join(row)})" for q, row in enumerate(exact, start=1)]
    if check:
        measured = order_check(g, signal, order, form)
        data["check"] = {"errors": measured.errors, "slopes": measured.slopes, "passed": measured.passed}
        slopes = ", ".join(f"{slope:.3f}" for slope in measured.slopes)
        lines.append(f"  measured order: slopes {slopes}: {'passed' if measured.passed else 'FAILED'}")
    emit("\n".join(lines), data, json)


commands = (average,)
