"""What the hunt found and was mended: over-budget requests end with a named error in little time of the processor."""

from __future__ import annotations

import itertools
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import LieCodegenError
from tests.hunt import hostile, methods, plausible

HUGE = 2**63
PATHS = (3, 1.5, ["a"], "/no/such/place/at all", "/")
CALLS: dict[str, Callable[[], Any]] = {
    "levels of brackets": lambda: lc.accessibility_rank("so3", ["1", "2", "3"], [[1, 0, 0]], depth=HUGE),
    "degree of products": lambda: lc.second_order_controllability("so3", ["1", "2", "3"], [[1, 0, 0]], degree=10**5000),
    "derivatives": lambda: lc.direction_observability([1, 2, 3], [0, 0, 1], [1, 2, 3], derivatives=HUGE),
    "a text as a basis": lambda: lc.adaptive_law(
        "so3", error="so3_right", gains={"K_p": [4, 5, 6], "K_d": 4}, basis="9" * 20_000
    ),
    "a period": lambda: lc.floquet(["v", "-x + 0.5*(1 - x^2)*v"], ("x", "v"), (2, 0), period=1e300),
    "steps of a gait": lambda: lc.gait(plausible.BY_NAME["gait"]["connection"](), steps=True),
    "two steps of a gait": lambda: lc.gait(plausible.BY_NAME["gait"]["connection"](), steps=2),
    "coordinates": lambda: lc.manifold(10**5000),
    "a spin": lambda: lc.solve_actual(plausible.PLAUSIBLE["flow"](), HUGE, [0.0, 0.5, 1.0], 0.1),
}


@pytest.mark.parametrize("name", CALLS)
def test_it_is_refused_soon(name: str) -> None:
    with pytest.raises(LieCodegenError):
        hostile.alarmed(4.0, CALLS[name])


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("method", ["save", "to_csv", "to_json"])
def test_a_plan_is_not_written_to_no_path(method: str, path: Any) -> None:
    with pytest.raises(LieCodegenError):
        getattr(plausible._plan(), method)(path)


def test_methods_of_results_refuse_what_is_no_number() -> None:
    body = plausible.PLAUSIBLE["body"]()
    for call in (
        lambda: plausible._plan().u("no time"),
        lambda: plausible._plan().X({}),
        lambda: plausible._loop().at({}),
        lambda: lc.group("so3").hat({}),
        lambda: lc.Uniform(0, 1).draw({}),
        lambda: body.motion(10**5000, 1.0),
        lambda: lc.build("so3").exp.batch(np.ones((2, 3)), layout=np.ones(3)),
    ):
        with pytest.raises(LieCodegenError):
            call()


def test_what_a_function_of_the_user_raises_passes() -> None:
    """The guard is for what goes wrong inside; the user's own error is the user's."""

    class OwnError(Exception):
        pass

    def broken(t: Any) -> Any:
        raise OwnError

    plan = plausible._plan()
    with pytest.raises(OwnError):
        lc.simulate("so3", broken, t=[0.0, 1.0])
    with pytest.raises(TypeError, match="missing"):
        plan.X()


def test_samples_at_no_time_are_no_numbers() -> None:
    held = lc.SampledInput([0.0, 0.5, 1.0], np.ones((2, 3)))
    assert np.isnan(held(np.nan)).all()
    assert np.isnan(held([0.2, np.nan])).all(axis=1).tolist() == [False, True]


def test_an_estimate_flows_long_without_long_work() -> None:
    """Pieces are put together two by two; a turn by 1e12 is the last that is one."""
    Q = np.diag([1e-6, 2e-6, 3e-6])
    estimate = lc.Uncertain("so3", np.eye(3), np.eye(3) * 1e-4)
    for u, duration in (([1e300] * 3, 1.0), ([0.1, 0.2, 0.3], HUGE), ([0.1, 0.2, 0.3], 1e300), ([1e300] * 3, 1e300)):
        with pytest.raises(LieCodegenError):
            hostile.alarmed(4.0, lambda u=u, duration=duration: estimate.flow(u, duration))
    whole, rate = estimate, [0.1, 0.2, 0.3]
    for _ in range(40):
        whole = whole.flow(rate, 2.5, Q)
    at_once = estimate.flow(rate, 100.0, Q)
    np.testing.assert_allclose(at_once.covariance, whole.covariance, rtol=1e-11, atol=1e-16)
    long = hostile.alarmed(4.0, lambda: estimate.flow(rate, 1e10, 1e-6 * Q).covariance)
    assert np.trace(long) == pytest.approx(3e-4 + 6e-12 * 1e10, rel=1e-4)


def test_counts_without_end_are_refused() -> None:
    controller = methods._controller()
    for count in (HUGE, 10**5000, True, 2.0):
        with pytest.raises(LieCodegenError):
            hostile.alarmed(4.0, lambda count=count: controller.problem.solve(Xd=np.eye(3), starts=count))
        for name in ("steps", "runs", "substeps", "delay"):
            given = {"steps": 1, "values": {"Xd": np.eye(3)}, name: count}
            with pytest.raises(LieCodegenError):
                hostile.alarmed(4.0, lambda given=given: controller.simulate(**given))


@pytest.mark.slow
@pytest.mark.parametrize("name", plausible.BY_NAME)
def test_the_arguments_from_which_the_hunt_departs_are_answered(name: str) -> None:
    """One hostile argument beside another that is refused first would try nothing."""
    function = getattr(lc, name, None) or getattr(lc.studies, name)
    arguments = {each: make() for each, make in plausible.plausible_arguments(function).items()}
    if str(arguments.get("path", "")).startswith("/proc/none"):
        with pytest.raises(LieCodegenError, match="cannot be written"):
            function(**arguments)
    else:
        try:
            function(**arguments)
        except lc.errors.MissingDependencyError as error:
            pytest.skip(str(error))


MASKED = np.ma.masked_array([0.1, 0.2, 0.3], [True, False, False])
COMPLEX = np.array([0.1 + 1.0j, 0.2, 0.3])


def _takers() -> dict[str, Callable[[Any], Any]]:
    """What asks for real numbers: three, or so many rows of three, or times."""
    library, plan, held = lc.build("so3"), plausible._plan(), lc.SampledInput([0.0, 1.0, 2.0], np.ones((2, 3)))
    still = lc.reference("so3", ["0", "0", "0"])
    return {
        "steer": lambda x: lc.steer("so3", x, ("w1", "w2"), 2.0),
        "simulate": lambda x: lc.simulate("so3", ["cos(t)", "0", "0"], t=x),
        "SampledInput": lambda x: lc.SampledInput([0.0, 1.0, 2.0], [x, x]),
        "tracking_law": lambda x: lc.tracking_law(
            "so3", inertia=[1, 2, 2], error="so3_right", gains={"K_p": x, "K_d": 1}
        ),
        "exp": library.exp,
        "exp.batch": lambda x: library.exp.batch([x, x]),
        "Plan.u": plan.u,
        "Plan.X": plan.X,
        "an input": held,
        "closed_loop": lambda x: lc.closed_loop("so3", law=plausible._law(), reference=still, xi0=x, t=[0.0, 0.1]),
        "hat": lc.group("so3").hat,
    }


@pytest.mark.parametrize("form", ["itself", "in a list", "in a list of lists", "in an array of objects"])
def test_masked_entries_are_no_numbers(form: str) -> None:
    """numpy drops the mask without a word: what lay below would be steered to."""
    given: Any = {
        "itself": MASKED,
        "in a list": [MASKED[0], 0.2, 0.3],
        "in a list of lists": [[MASKED], (MASKED,)],
        "in an array of objects": np.array([MASKED[0], None, MASKED], dtype=object),
    }[form]
    for taker in _takers().values():
        with pytest.raises(lc.errors.InputError, match=r"masked entries|takes numbers"):
            taker(given)
    whole = np.ma.masked_array([0.1, 0.2, 0.3], False)
    np.testing.assert_array_equal(lc.build("so3").exp(whole), lc.build("so3").exp([0.1, 0.2, 0.3]))


def test_masks_are_found_in_what_holds_itself() -> None:
    endless: list[Any] = [1.0]
    endless.append({"a": endless})
    with pytest.raises(lc.errors.InputError):
        hostile.alarmed(2.0, lambda: lc.SampledInput([0.0, 1.0], endless))
    endless[1]["b"] = (MASKED,)
    with pytest.raises(lc.errors.InputError, match="masked entries"):
        hostile.alarmed(2.0, lambda: lc.SampledInput([0.0, 1.0], endless))


@pytest.mark.parametrize("told", ["default", "ignore"])
@pytest.mark.parametrize("form", ["an array", "a list of numpy's numbers"])
def test_complex_numbers_are_not_taken_for_their_real_part(form: str, told: Any) -> None:
    """numpy warns and drops the imaginary part, and says nothing where warnings are ignored."""
    given = COMPLEX if form == "an array" else list(COMPLEX)
    with warnings.catch_warnings():
        warnings.simplefilter(told)
        for taker in _takers().values():
            with pytest.raises(lc.errors.InputError, match=r"complex|must be real"):
                taker(given)
        with pytest.raises(lc.errors.InputError, match="complex numbers where real ones"):
            lc.simulate("so3", lambda t: COMPLEX, t=[0.0, 1.0])
        with pytest.raises(lc.errors.InputError, match="complex numbers where real ones"):
            lc.steer("so3", [0.1, 0.2, 0.3], ("w1", "w2"), np.complex128(2 + 1j))
    # Where complex numbers are right they are taken, and the lines of others warn as they did.
    assert lc.steer("su2", expm(0.1j * np.array([[0, 1], [1, 0]])), ("sx", "sy"), 2.0).cost >= 0
    with pytest.warns(np.exceptions.ComplexWarning):
        np.asarray(COMPLEX, dtype=float)


def test_what_is_missing_is_named_with_what_it_may_be() -> None:
    with pytest.raises(lc.errors.InputError, match=r"tracking_law: error= missing .*so3_right"):
        lc.tracking_law("so3", inertia=[1, 2, 3], gains={"K_p": [1, 1, 1], "K_d": 1})
    with pytest.raises(lc.errors.InputError, match=r"tracking_law: no option errr; did you mean error\?"):
        lc.tracking_law("so3", inertia=[1, 2, 3], errr="so3_right")
    with pytest.raises(lc.errors.InputError, match=r"steer: target=, controls=, duration= missing .*seconds"):
        lc.steer("so3")
    with pytest.raises(lc.errors.InputError, match="rkmk4_step: too many positional"):
        lc.rkmk4_step("so3", "so3", "so3", "so3", "so3", "so3", "so3")
    with pytest.raises(lc.errors.InputError, match=r"Plan\.X: t= missing"):
        plausible._plan().X()


def test_costs_and_conditions_without_end_are_refused_at_once() -> None:
    for option in ("cost", "constraints"):
        began = time.process_time()
        with pytest.raises(lc.errors.InputError, match="limit of terms is 1000"):
            lc.steer("so3", [0.1, 0.2, 0.3], ("w1", "w2"), 2.0, **{option: itertools.repeat("w1")})
        assert time.process_time() - began < 5.0


def test_magnitudes_of_the_open_layer_are_those_of_steering() -> None:
    def problem(duration: float) -> object:
        return lc.ocp("so3", controls=("w1", "w2", "w3"), duration=duration, intervals=4, stage_cost=("u",))

    for duration in (5e-324, 1e-200, 1e300, np.longdouble("1e400")):
        with pytest.raises(lc.errors.InputError, match="between 1e-100 and 1e"):
            problem(duration)
    for option in ("penalty", "sample"):
        with pytest.raises(lc.errors.InputError, match=option):
            lc.mpc(problem(1.0), **{option: np.longdouble("1e400")})


@pytest.mark.parametrize("seed", ["a list that holds itself", "a list of None", "a ragged list"])
def test_seeds_are_whole_numbers(seed: str) -> None:
    """NumPy reads a list that holds itself until the stack ends, which ended the process."""
    bad = hostile.HOSTILE[seed]()
    certified = {each: make() for each, make in plausible.plausible_arguments(lc.certificate).items()}
    estimate = lc.Uncertain("so3", np.eye(3), np.eye(3) * 1e-4)
    problem = lc.ocp("so2", duration=1.0, intervals=3, controls=["omega"], stage_cost=["u"], bounds=1.0)
    for call in (
        lambda: lc.certificate(**certified, seed=bad),
        lambda: estimate.samples(3, seed=bad),
        lambda: problem.solve(seed=bad),
        lambda: lc.mpc(problem).simulate(steps=2, seed=bad),
    ):
        with pytest.raises(LieCodegenError, match="seed is an integer from 0"):
            call()


def test_inputs_too_large_for_any_step_are_refused_at_once() -> None:
    with pytest.raises(lc.errors.ComputationError, match="make eps or u smaller"):
        hostile.alarmed(5.0, lambda: lc.order_check("so3", [1e300, 1e300, 1e300]))


@pytest.mark.parametrize("text", ["9" * 20_000, ["9" * 20_000], "12"])
def test_a_text_is_no_row_of_coefficients(text: Any) -> None:
    with pytest.raises(lc.errors.ShapeError, match="rows of n coefficients"):
        hostile.alarmed(5.0, lambda: lc.PeriodicInput.from_fourier(cosines=text))
    with pytest.raises(lc.errors.ShapeError, match="rows of n coefficients"):
        hostile.alarmed(5.0, lambda: lc.PeriodicInput.from_fourier(sines=text))


def test_a_group_file_comes_from_a_stream_of_text_too() -> None:
    text = 'name = "plane"\nlabels = ["x", "y"]\nbrackets = []\n'
    code = f"""
import io, sys
import lie_codegen as lc
sys.stdin = io.StringIO({text!r})
try:
    print(lc.group("-"))
except lc.errors.LieCodegenError as error:
    print("ours", type(error).__name__)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "ours GroupFileError" in done.stdout, done.stderr  # read, and found to lack its brackets
    absent = code.replace(f"io.StringIO({text!r})", "None")
    done = subprocess.run([sys.executable, "-c", absent], capture_output=True, text=True, check=False)
    assert "ours GroupFileError" in done.stdout, done.stderr
