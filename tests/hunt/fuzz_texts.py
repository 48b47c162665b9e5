"""A target of atheris: `python -m tests.hunt.fuzz_texts KIND [options of libFuzzer]`, KIND one of the texts of `tests.hunt.texts`."""

from __future__ import annotations

import sys

import atheris

with atheris.instrument_imports(include=["lie_codegen.exact", "lie_codegen.groups.group_file", "lie_codegen.signals"]):
    import lie_codegen.exact.expression
    import lie_codegen.exact.token_stream
    import lie_codegen.groups.group_file
    import lie_codegen.signals.periodic_input  # noqa: F401

from hypothesis import HealthCheck, given, settings

from tests.hunt import texts


def main() -> None:
    """Bytes become choices of the strategy, so that every input is a text near the grammar, and coverage chooses among them."""
    kind = sys.argv.pop(1)
    inputs, judge = texts.KINDS[kind]

    @settings(deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(inputs)
    def look(value: object) -> None:
        verdict = judge(value)
        if verdict is not None:
            raise AssertionError(f"{value!r:.300}: {verdict}")

    atheris.Setup(sys.argv, look.hypothesis.fuzz_one_input)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
