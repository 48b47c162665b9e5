"""Gains of an error function that are inputs of the law: symbols in phi, ports of the kernel, numbers of its own at each call.

gains={"K_p": "input", "K_d": 6}     a port `K_p` behind the others: one library for every gain
"""

from __future__ import annotations

from dataclasses import replace

from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.errors import InputError
from lie_codegen.kernel.parameter import Parameter, check_numbers


def input_parameters(pair: ErrorFunction) -> tuple[Parameter, ...]:
    """Of the gains that are inputs, in the order of `pair.inputs`."""
    return tuple(Parameter(port, None) for port in pair.inputs)


def at_numbers(pair: ErrorFunction) -> ErrorFunction:
    """The pair with positive fractions in place of its inputs, for the checks of (A2) and of phi >= 0."""
    if not pair.inputs:
        return pair
    values = check_numbers(pair.inputs)
    tau, P = (None if value is None else value.xreplace(values) for value in (pair.tau, pair.P))
    return replace(pair, inputs=(), phi=pair.phi.xreplace(values), tau=tau, P=P)


def refuse_inputs(pair: ErrorFunction) -> ErrorFunction:
    """The pair, whose numbers are all known.

    Raises:
        InputError: some are inputs.
    """
    if pair.inputs:
        names = ", ".join(port.name for port in pair.inputs)
        raise InputError(
            f'{names} of the error function {pair.name} cannot be "input" here: what is asked for depends on the number; give it'
        )
    return pair
