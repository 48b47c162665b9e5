"""lc.jax_function: a compiled kernel as a JAX function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lie_codegen.errors import MissingDependencyError
from lie_codegen.groups.autodiff.differentiated import Differentiated, directions, kernel_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime.call import Compiled


def jax_function(function: Kernel | Compiled[Any]) -> Callable[..., Any]:
    """The kernel as a function of JAX arrays: under jit, vmap, jvp, grad, jacobian and hessian, to any order.

    The values come from the compiled C (`jax.pure_callback`, on the host), the derivatives from its derivative kernels, exact and
    compiled when first asked for; the products with tangents are JAX's own, so that forward and reverse mode are there.
    Arguments have the shapes of the ports, with any leading axes, which broadcast. Computed in double; JAX hands over
    float32 unless `jax_enable_x64` is set.

    Args:
        function: a Kernel, or a compiled function such as `lc.build("so3").exp`.

    Returns:
        a function of the inputs, in order or by name, that gives the output, or a named tuple of several.

    Raises:
        InputError: what is given is neither; an input is missing.
        ShapeError: an argument has other last axes than its port.
        MissingDependencyError: jax is not installed (extra "jax").
    """
    kernel = kernel_of(function, "jax_function")
    try:
        import jax.numpy as jnp
    except ImportError:
        raise MissingDependencyError('jax_function needs jax: pip install "lie_codegen[jax]"') from None
    made = Differentiated(kernel)
    call = _traceable(made)

    def called(*arguments: Any, **named: Any) -> Any:
        arrays = [
            jnp.asarray(value, dtype=_dtype(port))
            for value, port in zip(made.bound(arguments, named), made.inputs, strict=True)
        ]
        batch = made.leading([array.shape for array in arrays])
        whole = [jnp.broadcast_to(a, (*batch, *p.shape)) for a, p in zip(arrays, made.inputs, strict=True)]
        found = call(*whole)
        return found[0] if len(found) == 1 else made.compiled.result_type(*found)

    called.__name__ = called.__qualname__ = kernel.name
    called.__doc__ = made.compiled.__doc__
    return called


def _dtype(port: Port) -> Any:
    import jax

    return jax.dtypes.canonicalize_dtype(complex if port.is_complex else float)


def _traceable(made: Differentiated) -> Callable[..., tuple[Any, ...]]:
    """The same on arrays of equally many leading axes, as a tuple, with its rule of differentiation."""
    import jax

    derivatives: dict[int, Callable[..., tuple[Any, ...]]] = {}

    def host(*arrays: Any) -> tuple[Any, ...]:
        return tuple(value.astype(_dtype(port)) for value, port in zip(made(*arrays), made.outputs, strict=True))

    def values_of(*arrays: Any) -> tuple[Any, ...]:
        batch = made.leading([array.shape for array in arrays])
        shapes = tuple(jax.ShapeDtypeStruct((*batch, *port.shape), _dtype(port)) for port in made.outputs)
        # under vmap an input that is the same for all gets an axis of length 1, and `made` broadcasts it
        found: tuple[Any, ...] = jax.pure_callback(host, shapes, *arrays, vmap_method="expand_dims")
        return found

    call: Any = jax.custom_jvp(values_of)

    def rule(primals: tuple[Any, ...], tangents: tuple[Any, ...]) -> tuple[Any, Any]:
        values = call(*primals)
        moved = [0] * len(values)
        for place, tangent in enumerate(tangents):
            if isinstance(tangent, jax.custom_derivatives.SymbolicZero):
                continue
            if place not in derivatives:
                derivatives[place] = _traceable(made.by(place))
            slopes = derivatives[place](*primals)
            moved = [
                total + _product(slope, tangent, port, made.inputs[place])
                for total, slope, port in zip(moved, slopes, made.outputs, strict=True)
            ]
        zeros = [jax.numpy.zeros_like(value) for value in values]
        return values, tuple(total + zero for total, zero in zip(moved, zeros, strict=True))

    call.defjvp(rule, symbolic_zeros=True)
    traceable: Callable[..., tuple[Any, ...]] = call
    return traceable


def _product(slope: Any, tangent: Any, output: Port, source: Port) -> Any:
    """The Jacobian times the tangent, whose entries are numbered row by row, a complex one as re, then im."""
    import jax.numpy as jnp

    batch = tangent.shape[: tangent.ndim - len(source.shape)]
    parts = jnp.stack([tangent.real, tangent.imag], axis=-1) if source.is_complex else tangent
    flat = parts.reshape((*batch, directions(source)))
    moved = jnp.einsum("...rc,...c->...r" if output.shape else "...c,...c->...", slope, flat)
    return moved.reshape((*batch, *output.shape))
