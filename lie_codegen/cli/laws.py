"""The command about control laws: law."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from lie_codegen.cli.groups import Json
from lie_codegen.cli.output import emit
from lie_codegen.errors import InputError

_SAVED = ".npz"


def law(
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="[LAW]",
            help="A TOML file of a law (lie_codegen/control/README.md), a file that law.save() wrote, or a kind such as tracking: what its "
            "file holds. The kinds if not given.",
        ),
    ] = None,
    group: Annotated[
        str | None, typer.Option(help="A catalogue name or a group file, for a law whose file names none.")
    ] = None,
    certify: Annotated[
        bool, typer.Option("--certify", help="A rate of decay by lc.certificate, of tracking laws.")
    ] = False,
    save: Annotated[Path | None, typer.Option(help="File to save the law in, for lc.load.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write the C package of the law to.")] = None,
    json: Json = False,
) -> None:
    """Show a control law: formula, inputs and outputs with units, what is compiled in; save it, or write its C."""
    from lie_codegen.control.law_file import law_kinds

    kinds = law_kinds()
    file_wanted = [name for name, value in (("--certify", certify), ("--save", save), ("--out", out)) if value]
    if what is None or what in kinds:
        if file_wanted:
            raise InputError(f"law: {', '.join(file_wanted)} is of one law; give its file")
        _show_kinds(json) if what is None else _show_kind(what, json)
        return
    kernel = _read(Path(what), group, list(kinds))
    data = _data(kernel)
    lines = _lines(data)
    if certify:
        data["certificate"], words = _certified(kernel)
        lines.append(words)
    if save is not None:
        kernel.save(save)
        data["saved"] = save
        lines.append(f"saved in {save}")
    if out is not None:
        from lie_codegen.groups.generate import generate

        data["folder"] = generate(kernel, out)
        lines.append(f"wrote {data['folder']}")
    emit("\n".join(lines), data, json)


def _read(path: Path, group: str | None, kinds: list[str]) -> Any:
    from lie_codegen.control.law_file import read_law
    from lie_codegen.kernel.kernel import Kernel
    from lie_codegen.kernel.saved import load

    if path.suffix != _SAVED:
        if not path.exists() and not path.suffix:
            raise InputError(f"law: {path} is neither a file nor a kind of law: {', '.join(kinds)}")
        return read_law(path, group)
    if group is not None:
        raise InputError(f"law: {path} knows its group; leave --group away")
    found = load(path)
    kernel = getattr(found, "kernel", found)
    if not isinstance(kernel, Kernel):
        raise InputError(f"law: {path} holds a {type(found).__name__}, no law")
    return kernel


def _certified(kernel: Any) -> tuple[dict[str, Any], str]:
    from lie_codegen.control.certificate import certificate
    from lie_codegen.kernel.plain_data import made_from

    given = _parameters(kernel).get("group")
    found = certificate(kernel.namespace if given is None else made_from(given), law=kernel)
    names = ("level", "L", "rate", "k", "theorem_rate_proved", "limit_rate")
    words = (
        f"certificate  W(t) <= {found.k:.6g} W(0) exp(-{found.rate:.6g} t) from W(0) <= {found.level:.6g}; "
        f"about the reference W decays by {found.limit_rate:.6g}"
    )
    return {**{name: getattr(found, name) for name in names}, "status": found.status}, words


def _data(kernel: Any) -> dict[str, Any]:
    def ports(which: Any) -> list[dict[str, Any]]:
        return [{"name": p.name, "shape": p.shape, "units": p.units, "about": p.description} for p in which]

    return {
        "name": kernel.name,
        "namespace": kernel.namespace,
        "symbol": kernel.symbol,
        "formula": kernel.formula,
        "source": kernel.source,
        "inputs": ports(kernel.inputs),
        "outputs": ports(kernel.outputs),
        "parameters": {
            name: value
            for name, value in _parameters(kernel).items()
            if name not in ("group", "name") and value is not None
        },
    }


def _parameters(kernel: Any) -> dict[str, Any]:
    """What the law was made of, as its definition says; nothing of one that was written by hand."""
    return dict((kernel.definition or {}).get("parameters", {}))


def _lines(data: dict[str, Any]) -> list[str]:
    lines = [f"{data['namespace']}.{data['name']}: {data['formula']}"]
    if data["source"]:
        lines.append(f"source     {data['source']}")
    for what in ("inputs", "outputs"):
        for number, port in enumerate(data[what]):
            shape = " x ".join(map(str, port["shape"])) or "scalar"
            words = ", ".join(text for text in (port["about"], f"[{port['units']}]" if port["units"] else "") if text)
            lines.append(f"{what if not number else '':9}  {port['name']} ({shape})" + (f": {words}" if words else ""))
    fixed = "; ".join(f"{name} = {_text(value)}" for name, value in data["parameters"].items())
    return [*lines, f"compiled in: {fixed}"] if fixed else lines


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {_text(each)}" for name, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "(" + ", ".join(map(_text, value)) + ")"
    return str(value)


def _show_kinds(json: bool) -> None:
    from lie_codegen.control.law_file import law_kinds

    about = {kind: _first_line(make) for kind, make in law_kinds().items()}
    text = "\n".join(f"{kind:18} {words}" for kind, words in about.items())
    emit(f"{text}\nlie-codegen law KIND says what a file of that kind holds.", {"kinds": about}, json)


def _show_kind(kind: str, json: bool) -> None:
    import inspect

    from lie_codegen.control.law_file import law_kinds

    make = law_kinds()[kind]
    names = list(inspect.signature(make).parameters)
    text = f'law = "{kind}"\n# and any of: {", ".join(names)}\n\n{inspect.getdoc(make)}'
    emit(text, {"kind": kind, "arguments": names, "about": inspect.getdoc(make)}, json)


def _first_line(make: Any) -> str:
    return (make.__doc__ or "").strip().split("\n")[0]


commands = (law,)
