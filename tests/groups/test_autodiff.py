"""Compiled kernels under JAX and PyTorch, against these frameworks' own exponentials and against differences."""

from __future__ import annotations

import importlib.util
import sys
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InputError, MissingDependencyError, ShapeError


def installed(name: str) -> bool:
    return importlib.util.find_spec(name) is not None


needs_jax = pytest.mark.skipif(not installed("jax"), reason="jax is not installed")
needs_torch = pytest.mark.skipif(not installed("torch"), reason="torch is not installed")


def start(name: str) -> np.ndarray:
    return np.linspace(-0.4, 0.5, lc.group(name).dim)


def law() -> lc.Kernel:
    return lc.tracking_law("so3", inertia=(1, 2, 3), error="so3_right", gains={"K_p": (4, 5, 6), "K_d": 6})


def law_arguments() -> list[np.ndarray]:
    exp = lc.build("so3").exp
    R, R_d = (np.array(exp(x)) for x in ([0.3, -0.2, 0.5], [-0.1, 0.4, 0.2]))
    return [R, np.array([0.2, 0.1, -0.4]), R_d, np.array([0.5, -0.3, 0.1]), np.array([0.1, 0.2, 0.3])]


@pytest.fixture
def jax() -> Any:
    import jax

    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield jax
    jax.config.update("jax_enable_x64", before)


@needs_jax
@pytest.mark.parametrize("name", ["so3", "su2", "se3"])
def test_jax_derivatives_of_exp(jax: Any, name: str) -> None:
    basis, x = jax.numpy.array(lc.group(name).basis), jax.numpy.array(start(name))
    exp = lc.jax_function(lc.build(name).exp)

    def ours(x: Any) -> Any:
        return jax.numpy.sum(jax.numpy.abs(exp(x) - 2.0) ** 2)

    def theirs(x: Any) -> Any:
        return jax.numpy.sum(jax.numpy.abs(jax.scipy.linalg.expm(jax.numpy.tensordot(x, basis, 1)) - 2.0) ** 2)

    np.testing.assert_allclose(exp(x), lc.build(name).exp(np.array(x)), rtol=0, atol=1e-15)
    np.testing.assert_allclose(jax.grad(ours)(x), jax.grad(theirs)(x), rtol=0, atol=1e-12)
    np.testing.assert_allclose(jax.hessian(ours)(x), jax.hessian(theirs)(x), rtol=0, atol=1e-11)
    many = jax.jit(jax.vmap(jax.grad(ours)))(jax.numpy.stack([x, -2 * x]))
    np.testing.assert_allclose(many[1], jax.grad(theirs)(-2 * x), rtol=0, atol=1e-12)
    np.testing.assert_allclose(exp(jax.numpy.stack([x, -2 * x]))[1], exp(-2 * x), rtol=0, atol=1e-15)


@needs_jax
def test_jax_of_several_inputs_and_outputs(jax: Any) -> None:
    """The product with one input's tangent is that of lc.jacobian; an input under vmap beside one that is not."""
    made, values = lc.jax_function(law()), law_arguments()
    derivative = lc.build(lc.jacobian(law(), "xi", output="force"))
    by_xi = jax.jacobian(lambda xi: made(values[0], xi, *values[2:]).force)(values[1])
    np.testing.assert_allclose(by_xi, derivative.tracking_law_force_by_xi(*values), rtol=0, atol=1e-13)
    both = jax.vmap(lambda X, xi: made(X, xi, *values[2:]).W, in_axes=(None, 0))(
        values[0], np.stack([values[1], -values[1]])
    )
    np.testing.assert_allclose(both[1], made(values[0], -values[1], *values[2:]).W, rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        made(**dict(zip(["X", "xi", "X_d", "xi_d", "xi_d_dot"], values, strict=True))).W, both[0]
    )


@needs_jax
def test_jax_without_x64() -> None:
    import jax

    exp = lc.jax_function(lc.build("so3").exp)
    if jax.config.jax_enable_x64:
        pytest.skip("x64 is on for the whole process")
    assert exp(start("so3")).dtype == np.float32
    np.testing.assert_allclose(jax.grad(lambda x: exp(x)[0, 0])(start("so3").astype(np.float32)).shape, (3,))


@needs_torch
@pytest.mark.filterwarnings("ignore::FutureWarning")
@pytest.mark.parametrize("name", ["so3", "su2", "se3"])
def test_torch_derivatives_of_exp(name: str) -> None:
    import torch

    basis, x = torch.tensor(lc.group(name).basis), torch.tensor(start(name), requires_grad=True)
    exp = lc.torch_function(lc.build(name).exp)

    def ours(x: Any) -> Any:
        return (exp(x) - 2).abs().pow(2).sum()

    def theirs(x: Any) -> Any:
        return (torch.linalg.matrix_exp(torch.tensordot(x.to(basis.dtype), basis, 1)) - 2).abs().pow(2).sum()

    for f, g in ((torch.autograd.grad(ours(x), x), torch.autograd.grad(theirs(x), x)),):
        np.testing.assert_allclose(f[0], g[0], rtol=0, atol=1e-12)
    assert torch.autograd.gradcheck(exp, (x,))
    assert torch.autograd.gradgradcheck(exp, (x,))
    second = torch.autograd.functional.hessian(ours, x)
    np.testing.assert_allclose(second, torch.autograd.functional.hessian(theirs, x), rtol=0, atol=1e-11)
    forward = torch.func.jvp(ours, (x.detach(),), (torch.ones_like(x),))[1]
    np.testing.assert_allclose(forward, torch.autograd.grad(ours(x), x)[0].sum(), rtol=0, atol=1e-12)
    pair = torch.stack([x.detach(), -2 * x.detach()])
    np.testing.assert_allclose(torch.func.vmap(exp)(pair), exp(pair), rtol=0, atol=1e-15)


@needs_torch
@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_torch_through_complex_matrices_and_several_outputs() -> None:
    import torch

    lib = lc.build("su2")
    exp, log = lc.torch_function(lib.exp), lc.torch_function(lib.log)
    x = torch.tensor(start("su2"), requires_grad=True)
    weights = torch.tensor([1.0, -2.0, 0.5])
    (slope,) = torch.autograd.grad((weights * log(exp(x))).sum(), x)
    np.testing.assert_allclose(slope, weights, rtol=0, atol=1e-12)
    made, values = lc.torch_function(law()), [torch.tensor(each) for each in law_arguments()]
    values[1].requires_grad_()
    found = made(*values)
    rows = [torch.autograd.grad(part, values[1], retain_graph=True)[0].numpy() for part in found.force]
    derivative = lc.build(lc.jacobian(law(), "xi", output="force"))
    np.testing.assert_allclose(rows, derivative.tracking_law_force_by_xi(*law_arguments()), rtol=0, atol=1e-13)
    assert made(*[each.detach().float() for each in values]).W.dtype == torch.float32


@pytest.mark.parametrize("module", ["jax", "torch"])
def test_what_is_refused(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    door = {"jax": lc.jax_function, "torch": lc.torch_function}[module]
    with pytest.raises(InputError, match="takes a Kernel or a compiled function"):
        door("so3")  # type: ignore[arg-type]
    if installed(module):
        made = door(lc.build("so3").exp)
        with pytest.raises(ShapeError, match=r"x has shape \(4,\)"):
            made(np.zeros(4))
        with pytest.raises(InputError, match="takes x, each once"):
            made(np.zeros(3), x=np.zeros(3))
    else:
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(MissingDependencyError, match="pip install"):
            door(lc.build("so3").exp)


def test_a_compiled_function_knows_its_kernel() -> None:
    """Of a group by name and by object, and of a list of kernels."""
    exp = next(kernel for kernel in lc.group_kernels("so3") if kernel.name == "exp")
    for function in (lc.build("so3").exp, lc.build(lc.group("so3")).exp, lc.build([exp]).exp):
        assert function.kernel == exp
