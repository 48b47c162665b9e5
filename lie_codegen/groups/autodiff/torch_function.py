"""lc.torch_function: a compiled kernel as a PyTorch function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lie_codegen.errors import MissingDependencyError
from lie_codegen.groups.autodiff.differentiated import Differentiated, directions, kernel_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime.call import Compiled


def torch_function(function: Kernel | Compiled[Any]) -> Callable[..., Any]:
    """The kernel as a function of tensors: a `torch.autograd.Function` with backward, jvp and vmap, to any order.

    What `jax_function` is for JAX; computed in double on the host. The result has the type of the arguments and the device of the
    first. Gradients of complex tensors are PyTorch's: d/dRe + i d/dIm.

    Args:
        function: as there, and so is what is returned.

    Raises:
        InputError, ShapeError: as there.
        MissingDependencyError: torch is not installed (extra "torch").
    """
    kernel = kernel_of(function, "torch_function")
    try:
        import torch
    except ImportError:
        raise MissingDependencyError('torch_function needs torch: pip install "lie_codegen[torch]"') from None
    made = Differentiated(kernel)
    call = _traceable(made)

    def called(*arguments: Any, **named: Any) -> Any:
        given = [torch.as_tensor(value) for value in made.bound(arguments, named)]
        batch = made.leading([tuple(each.shape) for each in given])
        single = all(each.dtype in (torch.float32, torch.complex64) for each in given)
        tensors = [
            each.to(device="cpu", dtype=torch.complex128 if port.is_complex else torch.float64).expand(
                *batch, *port.shape
            )
            for each, port in zip(given, made.inputs, strict=True)
        ]
        found = [
            each.to(device=given[0].device, dtype=_dtype(port, single))
            for each, port in zip(call(*tensors), made.outputs, strict=True)
        ]
        return found[0] if len(found) == 1 else made.compiled.result_type(*found)

    called.__name__ = called.__qualname__ = kernel.name
    called.__doc__ = made.compiled.__doc__
    return called


def _dtype(port: Port, single: bool) -> Any:
    import torch

    if port.is_complex:
        return torch.complex64 if single else torch.complex128
    return torch.float32 if single else torch.float64


def _traceable(made: Differentiated) -> Callable[..., tuple[Any, ...]]:
    """The same on double tensors of the same leading axes, as a tuple, with its rules of differentiation."""
    import torch

    derivatives: dict[int, Callable[..., tuple[Any, ...]]] = {}

    def slopes(place: int, tensors: tuple[Any, ...]) -> tuple[Any, ...]:
        if place not in derivatives:
            derivatives[place] = _traceable(made.by(place))
        return derivatives[place](*tensors)

    def forward(*tensors: Any) -> tuple[Any, ...]:
        return tuple(torch.from_numpy(value) for value in made(*(each.detach().numpy() for each in tensors)))

    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        ctx.save_for_backward(*inputs)
        ctx.save_for_forward(*inputs)

    def backward(ctx: Any, *given: Any) -> tuple[Any, ...]:
        return tuple(
            _pulled(made, slopes(place, ctx.saved_tensors), given, place) if needed else None
            for place, needed in enumerate(ctx.needs_input_grad)
        )

    def jvp(ctx: Any, *tangents: Any) -> tuple[Any, ...]:
        moved: list[Any] = [0] * len(made.outputs)
        for place, tangent in enumerate(tangents):
            if tangent is not None:
                parts = slopes(place, ctx.saved_tensors)
                moved = [
                    total + _pushed(slope, tangent, port, made.inputs[place])
                    for total, slope, port in zip(moved, parts, made.outputs, strict=True)
                ]
        return tuple(moved)

    def vmap(info: Any, in_dims: tuple[Any, ...], *tensors: Any) -> tuple[Any, tuple[int, ...]]:
        moved = [
            each.unsqueeze(0).expand(info.batch_size, *each.shape) if dim is None else each.movedim(dim, 0)
            for each, dim in zip(tensors, in_dims, strict=True)
        ]
        return rule.apply(*moved), (0,) * len(made.outputs)

    methods = {each.__name__: staticmethod(each) for each in (forward, setup_context, backward, jvp, vmap)}
    rule: Any = type(f"{made.kernel.name}_function", (torch.autograd.Function,), methods)
    apply: Callable[..., tuple[Any, ...]] = rule.apply
    return apply


def _pulled(made: Differentiated, slopes: tuple[Any, ...], given: tuple[Any, ...], place: int) -> Any:
    """sum over outputs of Re(conj(gradient)^T Jacobian), put back in the shape of the input."""
    import torch

    source, total = made.inputs[place], torch.zeros(())
    batch: tuple[int, ...] = ()
    for slope, gradient, port in zip(slopes, given, made.outputs, strict=True):
        if gradient is None:
            continue
        batch = tuple(gradient.shape[: gradient.ndim - len(port.shape)])
        flat = gradient.reshape((*batch, -1)) if port.shape else gradient.unsqueeze(-1)
        rows = slope if port.shape else slope.unsqueeze(-2)
        moved = torch.einsum("...r,...rc->...c", flat.conj(), rows.to(flat.dtype))
        total = total + (moved.real if moved.is_complex() else moved)
    total = total.reshape((*batch, *source.shape, 2)) if source.is_complex else total.reshape((*batch, *source.shape))
    return torch.complex(total[..., 0], total[..., 1]) if source.is_complex else total


def _pushed(slope: Any, tangent: Any, output: Port, source: Port) -> Any:
    """The Jacobian times the tangent."""
    import torch

    batch = tuple(tangent.shape[: tangent.ndim - len(source.shape)])
    parts = torch.view_as_real(tangent.resolve_conj()) if source.is_complex else tangent
    flat = parts.reshape((*batch, directions(source)))
    rows = slope if output.shape else slope.unsqueeze(-2)
    return torch.einsum("...rc,...c->...r", rows, flat.to(rows.dtype)).reshape((*batch, *output.shape))
