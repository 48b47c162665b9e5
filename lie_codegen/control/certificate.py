"""lc.certificate: what is known of a tracking loop, with a status: the level, the rate, the overshoot.

    W = phi + |xi_e|_I^2/2 <= level < L at the start  =>  W(t) <= k W(0) exp(-rate t)

for the loop as Theorem 4.2 has it: the force of the law itself, all the time, on a body of that inertia. Bullo and Murray, CIT-CDS 97-003.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.certificate_constants import Metric, hessian_bound, quadratic_bounds
from lie_codegen.control.certificate_proofs import UNPROVED, proved_constants, status_of
from lie_codegen.control.certificate_rates import PointwiseRate, Rate, TheoremNumbers, largest_epsilon, overshoot_of
from lie_codegen.control.certificate_record import Certificate, loop_state
from lie_codegen.control.claims import check_constant, is_claimed
from lie_codegen.control.compatibility import check_compatibility
from lie_codegen.control.critical_points import CriticalPoints, found_points
from lie_codegen.control.error_catalogue import as_error, gain
from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.control.error_samples import error_samples
from lie_codegen.control.force_limits import read_limits
from lie_codegen.control.invariance import invariance
from lie_codegen.control.level_search import LevelSearch
from lie_codegen.control.tracking_law import FEEDFORWARDS
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.counts import seeded
from lie_codegen.exact.positive_matrix import as_floats, positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.plain_data import made_from
from lie_codegen.on_demand import scipy

_LAW = "lie_codegen.control.tracking_law:tracking_law"


def certificate(
    group: GroupLike,
    *,
    inertia: Any = None,
    error: Any = None,
    gains: Mapping[str, Any] | None = None,
    feedforward: str = "levi_civita",
    damping_limits: Any = None,
    law: Kernel | None = None,
    level: float | None = None,
    state: tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike] | None = None,
    speed: float = 0.0,
    overshoot: float | None = None,
    epsilon: float | None = None,
    reach: float | None = None,
    prove: bool = True,
    limits: Any = None,
    sample: float | None = None,
    delay: Any = None,
    seed: int = 0,
) -> Certificate:
    """The certificate of a tracking loop on a level of W.

    Args:
        group, inertia, error, gains, feedforward, damping_limits: as `tracking_law`; or `law` alone, which has them in its definition.
        level: of W, below L; half of L if not given. b_1 grows without bound as it nears L.
        state: (X, xi, X_d, xi_d) instead of a level: the level is W there.
        speed: the largest |nu|_I of the reference velocity, transported.
        overshoot: the largest k that is allowed: the rate is the best under it. Without it the best rate comes with a k of 5 to 8.
        epsilon: of the cross term, instead of the best; below sqrt(2 b_2), or where k is `overshoot`.
        reach: the largest entry of X_d and its inverse, where phi is not left-invariant and the group not compact; 2 if not given.
        prove: whether b_1, b_2, h and t are also bounded by interval arithmetic where that is known how: phi = tr(K (1 - R_d^T R))/2 on SO(3).
        limits, sample, delay: of a loop that clips, samples or delays its force: refused, as the proof is void there.
        seed: of the search.

    Raises:
        InputError: as `tracking_law`; phi is negative, not proper, or its constant false; the level is not below L; a loop that no
            certificate covers.
    """
    group = as_group(group, "certificate")
    _refuse_other_loops(limits=limits, sample=sample, delay=delay)
    if law is not None:
        told = {"inertia": inertia, "error": error, "gains": gains, "damping_limits": damping_limits}
        told["feedforward"] = None if feedforward == "levi_civita" else feedforward
        inertia, error, gains, feedforward, damping_limits = _of_law_alone(law, group, told)
    if inertia is None or error is None or gains is None:
        raise InputError("certificate needs inertia, error and gains, or a law made by lc.tracking_law")
    _check_options(feedforward, speed, overshoot)
    pair, n = as_error(group, error, gains), group.dim
    body = as_floats(positive_matrix(inertia, n, "inertia"))
    K_d = as_floats(positive_matrix(gain(gains, "K_d", "a tracking law"), n, "K_d"))
    stiffness = np.array(check_compatibility(pair).hessian)
    stiffness = (stiffness + stiffness.T) / 2
    points = check_constant(pair) if is_claimed(pair) else found_points(pair)
    L, L_component = _least_levels(points, pair)
    metric, samples = Metric(group, body), error_samples(pair)
    if state is not None:
        if len(state) != 4:
            raise ShapeError(f"certificate: state is (X, xi, X_d, xi_d), given {len(state)} entries")
        now = loop_state(pair, body, *state)
        level, speed = now.W, max(speed, now.speed)
    level = _level(level, L, pair)
    moving, bound = not invariance(pair).left, float("inf")
    if moving:
        bound = 2.0 if reach is None else float(reach)
    # b_1, b_2 and h belong to phi and to the level alone; how fast the reference turns enters the pointwise rate, so that speed is 0 here.
    search = LevelSearch(samples, body, level, 0.0, seeded(seed, "certificate"), moving=moving, reach=bound)
    b_1, b_2 = quadratic_bounds(search, metric, stiffness)
    h, t = hessian_bound(search, metric), metric.turning()
    damping = scipy.linalg.eigh(K_d, body, eigvals_only=True)
    share = _least_share(damping_limits, K_d, metric, level)
    theorem = TheoremNumbers(b_1, b_2, h, t, share * float(damping[0]), float(damping[-1]), float(speed))
    if speed:
        search = LevelSearch(
            samples, body, level, float(speed), seeded(seed, "certificate"), moving=moving, reach=bound
        )
    pointwise = PointwiseRate(search, metric, K_d, feedforward, b_2, share)
    if epsilon is None:
        best = pointwise.best(overshoot)
    else:
        _check_epsilon(float(epsilon), b_2, overshoot)
        best = Rate(float(epsilon), pointwise.at(float(epsilon), starts=6), overshoot_of(float(epsilon), b_2))
    proved = proved_constants(pair, gains, metric, level, (b_1, b_2, h, t)) if prove else UNPROVED
    stated, sure = _rates_of_theorem(theorem, feedforward, proved, overshoot)
    return Certificate(
        pair, body, K_d, feedforward, L, L_component, level,
        float(speed), bound, b_1, b_2, proved[0], proved[1], h, proved[2], t, proved[3], best.epsilon, best.rate, best.k, stated.epsilon,
        stated.rate, sure, stated.k, theorem.P(stated.epsilon), theorem.P(stated.epsilon, -1.0), theorem.Q(stated.epsilon),
        share, _largest_slopes(search), _rate_near_rest(metric, stiffness, K_d), points,
        status_of(pair, points, proved, len(search.places.X)),
    )  # fmt: skip


def _check_epsilon(epsilon: float, b_2: float, overshoot: float | None) -> None:
    """Refuse a cross term with which W_total + eps d phi . xi_e is no Lyapunov function, or overshoots by more than was allowed."""
    high = largest_epsilon(b_2, overshoot)
    if not 0 < epsilon < high:
        why = "sqrt(2 b_2), where W_total + eps d phi . xi_e stops being positive"
        if overshoot is not None:
            why = f"which has the overshoot {overshoot:g}"
        raise InputError(f"certificate: epsilon = {epsilon:g} must lie between 0 and {high:.6g}, {why}")


def _refuse_other_loops(**given: Any) -> None:
    """Refuse options of a loop whose force is not the law's own all the time."""
    for name, value in given.items():
        if value is not None and value is not False:
            raise InputError(
                f"certificate: {name} = {value!r}: a force that is clipped, held or delayed voids the proof, and no certificate covers such a "
                "loop; lc.loop_margins gives its margins, gains whose force stays below the limits need no clipping, and damping_limits= of "
                "lc.tracking_law shortens the damping alone, which a certificate covers"
            )


def _of_law_alone(law: Kernel, group: MatrixGroup, told: Mapping[str, Any]) -> tuple[Any, Any, Any, str, Any]:
    """As `_of_law`, where nothing that the law has is told beside it."""
    twice = [name for name, value in told.items() if value is not None]
    if twice:
        raise InputError(
            f"certificate: {twice[0]} beside law: the law has its own, and with another the loop is not the one that is certified; "
            "give the law alone, or everything but the law"
        )
    return _of_law(law, group)


def _check_options(feedforward: str, speed: float, overshoot: float | None) -> None:
    if feedforward not in FEEDFORWARDS:
        raise InputError(f"feedforward {feedforward!r} is not known; choose one of {', '.join(FEEDFORWARDS)}")
    if not (np.isfinite(speed) and speed >= 0):
        raise InputError(f"certificate: speed = {speed} must be a bound, 0 or more")
    if overshoot is not None and not overshoot > 1:
        raise InputError(f"certificate: overshoot = {overshoot} must be above 1: at t = 0 W itself is W(0)")


def _least_levels(points: CriticalPoints, pair: ErrorFunction) -> tuple[float, float]:
    """(L, L of the reference's component): below L no other critical point lies, and no error function with a log ends.

    A claimed `constant` of the pair may be below what was found: then it is the bound, for so far the claim goes.
    """
    if points.L is None or points.L_component is None:
        raise InputError(
            f"certificate: phi of {pair.name} on {pair.group.name} stays bounded on the way to infinity: no level of W keeps the state near the "
            "reference"
        )
    L = points.L if pair.constant is None else min(points.L, pair.constant)
    return float(L), float(min(points.L_component, L) if pair.uses_log else points.L_component)


def _rates_of_theorem(
    theorem: TheoremNumbers, feedforward: str, proved: tuple[float, ...], overshoot: float | None
) -> tuple[Rate, float]:
    """(the theorem's rate with the numbers found, its rate with proved ones); NaN for other feedforwards, of which it says nothing."""
    if feedforward != "levi_civita":
        return Rate(float("nan"), float("nan"), float("nan")), float("nan")
    stated = theorem.best(overshoot)
    if not np.all(np.isfinite(proved)):
        return stated, float("nan")
    sure = replace(theorem, b_1=proved[0], b_2=proved[1], h=proved[2], t=proved[3])
    return stated, sure.best(overshoot).rate


def _rate_near_rest(metric: Metric, stiffness: Array, K_d: Array) -> float:
    """What no rate can exceed: near rest the loop is theta'' = -I^-1 (H theta + K_d theta'), and W, quadratic there, falls at twice the decay
    of its slowest mode.
    """
    n = len(K_d)
    modes = np.block([[np.zeros((n, n)), np.eye(n)], [-metric.inverse @ stiffness, -metric.inverse @ K_d]])
    return float(-2 * np.max(np.linalg.eigvals(modes).real))


def _least_share(limits: Any, K_d: Array, metric: Metric, level: float) -> float:
    """The least s of f_D = -s K_d xi_e: |xi_e|_I^2/2 <= W <= level bounds each component of K_d xi_e by Cauchy-Schwarz."""
    if limits is None:
        return 1.0
    bounds = np.array([float(x) for x in read_limits(limits, len(K_d), "damping_limits")])
    wanted = np.sqrt(2 * level * np.diag(K_d @ metric.inverse @ K_d))
    return float(min(1.0, np.min(bounds / wanted)))


def _largest_slopes(search: LevelSearch) -> Array:
    """(n,) largest |d phi_a| on the level."""

    def component(a: int) -> float:
        return search.extreme(
            lambda places: np.abs(search.samples.first(places.X, places.X_d)[1][:, a]), starts=2, largest=True
        )

    return np.array([component(a) for a in range(search.n)])


def _of_law(law: Kernel, group: MatrixGroup) -> tuple[Any, Any, Any, str, Any]:
    """What a tracking law was made from.

    Raises:
        InputError: another law, which no certificate covers; or one with numbers that are inputs.
    """
    definition = getattr(law, "definition", None)
    if definition is None or definition["kind"] != _LAW:
        kind = "a law of your own" if definition is None else str(definition["kind"]).partition(":")[2]
        raise InputError(
            f"certificate: {getattr(law, 'name', law)!r} is made by {kind}; a certificate covers lc.tracking_law alone: clipping, integral "
            "action, adaptation and jumps are other loops"
        )
    given = {name: made_from(value) for name, value in definition["parameters"].items()}
    if given["group"] != group:
        raise InputError(f"certificate: the law is one of {given['group'].name}, not of {group.name}")
    numbers = (given["inertia"], given["damping_limits"], *given["gains"].values())
    if given["tunable"] or "input" in [number for number in numbers if isinstance(number, str)]:
        raise InputError("certificate: the law's numbers are inputs: give inertia, error and gains instead")
    return given["inertia"], given["error"], given["gains"], given["feedforward"], given["damping_limits"]


def _level(level: float | None, L: float, pair: ErrorFunction) -> float:
    if level is None:
        if not np.isfinite(L):
            raise InputError(
                f"certificate: phi of {pair.name} has no other critical point, so L is infinite: give level="
            )
        return L / 2
    value = float(level)
    if not 0 < value < L:
        raise InputError(f"certificate: level = {value:g} must lie between 0 and L = {L:g}: at L b_1 is infinite")
    return value
