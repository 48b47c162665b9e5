"""lc.closed_loop: a body, a velocity or a mechanism under a law, in compiled loops."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Never, overload

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.control.disturbance import ForceBody
from lie_codegen.control.loop_prepared import prepared
from lie_codegen.control.loop_result import ClosedLoop
from lie_codegen.control.loop_simulation import loop_by, refuse
from lie_codegen.errors import InputError
from lie_codegen.flow.events import Event
from lie_codegen.identifiers import unknown_keywords
from lie_codegen.runtime.patience import shows_progress


@overload
def closed_loop(
    group: Any = None,
    *,
    law: Any = None,
    inertia: Any = None,
    gains: Mapping[str, ArrayLike] | None = None,
    reference: Any = None,
    X0: ArrayLike | None = None,
    xi0: ArrayLike | None = None,
    t: ArrayLike,
    rtol: float | None = None,
    step: float | None = None,
    sample: float | None = None,
    delay: float | None = None,
    noise: Mapping[str, ArrayLike] | None = None,
    limits: ArrayLike | None = None,
    disturbance: Any = None,
    observer: Any = None,
    states: Mapping[str, ArrayLike] | None = None,
    seed: int | None = None,
    runs: int | None = None,
    first: int = 0,
    threads: int = 1,
    external: ForceBody | None = None,
    tolerance: float | None = None,
    order: int | None = None,
    events: Sequence[Event] = (),
    method: Literal["auto", "gauss"] = "auto",
) -> ClosedLoop: ...


@overload
def closed_loop(
    *,
    mpc: Any,
    X0: ArrayLike | None = None,
    t: ArrayLike,
    values: Mapping[str, Any] | None = None,
    plant: Any = None,
    plant_values: Mapping[str, Any] | None = None,
    noise: Any = None,
    delay: int | None = None,
    compensate: bool | None = None,
    substeps: int | None = None,
    seed: int | None = None,
    runs: int | None = None,
) -> Any: ...


@shows_progress
def closed_loop(
    group: Any = None,
    *,
    law: Any = None,
    inertia: Any = None,
    gains: Mapping[str, ArrayLike] | None = None,
    reference: Any = None,
    X0: ArrayLike | None = None,
    xi0: ArrayLike | None = None,
    t: ArrayLike,
    rtol: float | None = None,
    step: float | None = None,
    sample: float | None = None,
    delay: float | None = None,
    noise: Any = None,
    limits: ArrayLike | None = None,
    disturbance: Any = None,
    observer: Any = None,
    states: Mapping[str, ArrayLike] | None = None,
    seed: int | None = None,
    runs: int | None = None,
    first: int = 0,
    threads: int = 1,
    external: ForceBody | None = None,
    tolerance: float | None = None,
    order: int | None = None,
    events: Sequence[Event] = (),
    method: Literal["auto", "gauss"] = "auto",
    mpc: Any = None,
    values: Mapping[str, Any] | None = None,
    plant: Any = None,
    plant_values: Mapping[str, Any] | None = None,
    compensate: bool | None = None,
    substeps: int | None = None,
    **unknown: Never,
) -> Any:
    """Simulates a loop, compiled; the law itself is the one that `generate` writes for flight.

    A law that gives a force moves a body, X' = X hat(xi), I xi' = ad*_xi I xi + f; one that gives a velocity moves X' = X hat(u).
    Without `sample` the law acts continuously. With it the law is called every `sample` seconds, its command is held between,
    and its own states take one step a call (z + sample z_dot).

    N loops at once: where X0, xi0, inertia, gains, limits, disturbance or noise have an axis of length N in front, or by `runs`.

    Args:
        group: any matrix group, its name or its file; that of the law if not given.
        law: a Kernel whose inputs are among X (or q), xi (or omega, q_dot), X_d, xi_d, xi_d_dot (or r, r_dot, r_ddot), y, t, h,
            states of its own (z with an output z_dot, q with an output q_next, X_hat with an output u_hat) and numbers; or
            something with such a kernel as `.kernel`. None for an uncontrolled body.
        inertia: of the body, symmetric positive definite: a number, a diagonal or a matrix, which is compiled in; or (N, n, n),
            one a loop: then it is an input of one compiled step. Left away, it is the inertia that the law was made with. A law that
            commands the velocity needs none.
        gains: values of the law's numbers that are inputs (`k_p="input"`): name -> a number, or one a loop, (N, *shape). A
            law's `inertia` is that of the body unless it is given here.
        reference: what `lc.reference` makes or takes: a reference, a plan, formulas of t; or one element, to rest at. An attitude law follows it by its
            `tracking` form; any other law that gives a velocity and reads no reference is given X_d^-1 X, and the reference's
            velocity is added to its command.
        X0: (d, d) or (N, d, d) initial configurations, the identity if not given.
        xi0: (n,) or (N, n) initial body velocities, zero if not given.
        t: (k,) equally spaced times.
        rtol: on the entries of the state at the times t, absolute; 1e-10 if neither it nor `step` is given. A law that acts
            continuously on a group goes by the pair 8(5,3), whose local errors are made smaller until two runs agree; of many
            loops the local tolerance is found by 16 to 128 of them, and each holds it. Otherwise steps are halved until two
            runs agree; of more than 64 sampled loops 64 are watched.
        step: integration step [s].
        sample: [s] from one call of the law to the next; the times t must fall on calls.
        delay: from the measurement to when its command acts: an int counts samples, a float is in seconds, a multiple of
            `sample`. Until the first command arrives, zero acts. Without `sample`, `step` is the sample, as for noise.
        noise: standard deviations, Gaussian: {"X": of a turn X exp(hat(.)) of the measured configuration, "xi": of the
            measured velocity, "u": of the command as it acts, behind the limits, "y": of what a sensor sees}, each a number,
            one a component, or (N, components); "bias" is a constant offset of the measured velocity.
        limits: largest magnitude of the command: a number, (m,) or (N, m).
        disturbance: beside the command: formulas of t, X[i][j], xi[i] (or X11, xi1 ...), one a component; constants, (m,) or (N, m);
            a Kernel of some of t, X, xi.
        observer: what estimates X and xi from y and the measured velocity u: an object with `kernel`, (X_hat, bias, u, y, h) ->
            (X_hat_next, bias_next), and `directions`, the c of y = X^-1 c. The law is then given X_hat and u - bias.
        states: start of the law's and the observer's own states, by name; else what the law says, else zero or the identity.
        seed: of the noise, 0 if not given. The numbers of loop i at sample j are those of Philox4x32 with the key `seed` at
            the counter (j, i): they do not depend on what else is run.
        runs: so many loops, alike but for their noise. With `mpc`: so many runs, of seeds in turn.
        first: index of the first loop among all, for batches in several calls.
        threads: over which many loops are shared out.
        external: further body forces (ops, t, X, xi) -> (n,) over any arithmetic, as those of `underwater_forces`.
        tolerance: the old name of rtol.
        order: 1 where the law commands a velocity, 2 where a force; for laws of one's own, whose names do not say it.
        events: `lc.Event`s in t, X[i][j] and xi[i], found along one loop on a group that goes by rtol; `run.events`.
        method: "gauss" takes steps of the length `step` by Gauss collocation of order 6, for conservative motions over very many
            steps: the energy and the momentum of a free body stay to rounding (1e5 steps: 2e-15, where the default has 3e-5).
        mpc: a controller of `lc.mpc`, instead of group, inertia and law: its loop from t[0] to t[-1], a sample an interval;
            returns its LoopRun, or a tuple of them.
        values: with `mpc` alone, as what follows: states and parameters of the problem, by name.
        plant, plant_values: another problem (or Plant) that is really there, and its parameters; the controller's own if not given.
        compensate: whether the controller looks ahead over the delay, True if not given.
        substeps: integration steps of the plant a sample, 4 if not given.

    Raises:
        InputError: an inertia that is not positive definite, a reference that jumps, a law without its reference or without a
            number that is an input of it; any other argument that does not fit, named.
        ShapeError: arrays of different numbers of loops.
        NotOnGroupError: X0 is off the group.
        ComputationError: the tolerance is not met with two million steps, or the state is no longer finite.
    """
    if unknown:
        known = set(inspect.signature(closed_loop).parameters) - {"unknown"}
        raise InputError(unknown_keywords("closed_loop", unknown, known))
    if mpc is not None:
        given = {
            "group": group, "law": law, "inertia": inertia, "gains": gains, "reference": reference, "xi0": xi0, "rtol": rtol,
            "step": step, "sample": sample, "limits": limits, "disturbance": disturbance, "observer": observer, "states": states,
            "external": external, "tolerance": tolerance, "order": order, "first": first or None, "events": events or None,
            "threads": None if threads == 1 else threads, "method": None if method == "auto" else method,
        }  # fmt: skip
        refuse(
            given,
            "beside mpc=; the controller brings its group, sample and limits, and the body is its problem or plant=",
        )
        options = {
            "values": values, "plant": plant, "plant_values": plant_values, "noise": noise, "delay": delay,
            "compensate": compensate, "substeps": substeps, "seed": seed, "runs": runs,
        }  # fmt: skip
        times = np.asarray(t, dtype=float)
        # the controller brings its own loop: it lives on a floor above this one
        chosen = {name: value for name, value in options.items() if value is not None}
        return mpc.simulate(X0, duration=float(times[-1] - times[0]), **chosen)
    if not (values is None and plant is None and plant_values is None and compensate is None and substeps is None):
        of_mpc = {
            "values": values, "plant": plant, "plant_values": plant_values, "compensate": compensate, "substeps": substeps,
        }  # fmt: skip
        refuse(of_mpc, "without mpc=; these options are those of a controller of lc.mpc")
    if order is not None and law is None:
        raise InputError(
            "closed_loop: order says what a law commands, and there is none: give law=, or leave order away"
        )
    if method not in ("auto", "gauss"):
        raise InputError(f'closed_loop: method is "auto" or "gauss", given {method!r}')
    told = (  # as `TOLD` names them
        group, law, inertia, reference, t, rtol, tolerance, step, sample, delay, noise, limits, disturbance, external, observer, gains, order
    )  # fmt: skip
    return loop_by(method, prepared(method, told), X0, xi0, states or {}, seed, runs, first, threads, events)
