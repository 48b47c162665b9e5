"""Compiled: a kernel that can be called with numbers, on one point, on a batch, or as a loop."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from lie_codegen.arrays import Array
from lie_codegen.codegen.signature import Signature, python_field
from lie_codegen.door import guard_methods
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.identifiers import shown
from lie_codegen.kernel.plain_data import Definition, makes_records
from lie_codegen.runtime.arguments import (
    DTYPES,
    bind,
    checked,
    named_results,
    outputs_for,
    sequences,
    unshared,
)
from lie_codegen.runtime.backend import Backend
from lie_codegen.runtime.documentation import documentation, prototype, python_signature
from lie_codegen.runtime.patience import progress
from lie_codegen.runtime.scans import scan, scan_batch, scan_reduced
from lie_codegen.runtime.threads import CALLS, in_parts

if TYPE_CHECKING:
    import inspect

    from lie_codegen.kernel.kernel import Kernel
    from lie_codegen.runtime.varying import Varying


#: What compiles the entries that vary, and what compiles in floats: they stand on what builds libraries, and so above this file; loaded
#: when first asked for.
VARYING, SINGLE = "lie_codegen.runtime.varying_build", "lie_codegen.runtime.single_build"
#: What a call gives: an array, a number, or a named tuple.
Result = TypeVar("Result")


@guard_methods
class Compiled(Generic[Result]):
    """A callable kernel.

    Attributes:
        name: attribute of the library.
        inputs, outputs: the ports.
        compiled: False where CasADi's interpreter stands in for C.
        result_type: named tuple of several outputs, or None.
        signature, backend: what it computes, and what runs it.
    """

    def __init__(self, signature: Signature, backend: Backend, *, compiled: bool) -> None:
        self._library: Any = None
        self.name = self.__name__ = signature.name
        self.inputs = signature.inputs
        self.outputs = signature.outputs
        self.compiled = compiled
        self.__doc__ = documentation(signature)
        self.signature = signature
        self.backend = backend
        fields = tuple(python_field(port.name) for port in signature.outputs)
        self.result_type: Any = named_results(f"{signature.name}_result", fields) if len(fields) > 1 else None
        self._scalar = not signature.outputs[0].shape

    @property
    def __signature__(self) -> inspect.Signature:
        """The ports as parameters: what `inspect.signature`, completion and `help` show."""
        return python_signature(self.signature)

    def __call__(self, *args: Any, out: Any = None, **named: Any) -> Result:
        """Evaluate once.

        Args:
            *args: the inputs in order: arrays, lists or numbers of exactly the ports' shapes.
            out: an array (a tuple of arrays for several outputs) to write to: exact shape, float64 or
                complex128, C-contiguous, writable. It may be an input.
            **named: inputs by name.

        Returns:
            The output; a Python number if it is a scalar; a named tuple if there are several. An array that the caller has let
            go is written to by a later call (so `ndarray.resize` of a result wants `refcheck=False`).

        Raises:
            ShapeError: naming the argument, what was expected and what was given.
        """
        values = bind(self.signature, args, named) if named or len(args) != len(self.inputs) else args
        real = self.signature.real
        arrays = [checked(self.name, port, value, real) for port, value in zip(self.inputs, values, strict=True)]
        outputs = outputs_for(self.signature, out, ())
        self.backend.call(arrays, outputs)
        result: Result = self._wrap(outputs, out, scalars=True)
        return result

    def batch(
        self,
        *args: Any,
        out: Any = None,
        threads: int = 1,
        layout: str = "whole",
        real: str = "double",
        **named: Any,
    ) -> Any:
        """Evaluate N times: an input has a leading axis of length N, or is the same for all.

        Args:
            *args, out, **named: as for a call, with the leading axis.
            threads: over which the samples are shared out.
            layout: "varying" for (N, m): the entries that are not the same for all inputs alone, in C order, as the twelve of a
                rigid motion; less is written, which is what large batches wait for. `varying` and `whole` say where they belong.
            real: "float" for screening: computes, takes and gives float32 (complex64), on twice as many lanes; errors of some 1e-7,
                with the series and thresholds of packages in floats.

        Returns:
            (N, *shape), or a named tuple of such arrays. Each sample as a call, to the accuracy of the lane mathematics:
            sin, cos, exp, log, ... differ by at most 3 units in the last place, everything else is equal (a zero may
            have the other sign); whatever N, the place in the batch, or the number of threads.

        Raises:
            ShapeError: as for a call; or no input has the leading axis, or two lengths differ.
            InputError: another layout or real; a number that no float is.
            CodegenError: a constant of the kernel is no float.
        """
        self._check_real("batch", real)
        if isinstance(layout, str) and layout == "varying":
            return self._varying.function.batch(*args, out=out, threads=threads, real=real, **named)
        if not isinstance(layout, str) or layout != "whole":
            raise InputError(f'{self.name}.batch: layout is "whole" or "varying", given {shown(layout)}')
        if real != self.signature.real:
            return self._single.batch(*args, out=out, threads=threads, real=real, **named)
        values = bind(self.signature, args, named)
        arrays, strides, count = sequences(self.signature, values, "samples", self.inputs)
        if count is None:
            raise ShapeError(f"{self.name}.batch: no input has a leading axis of samples; call {self.name} itself")
        outputs = outputs_for(self.signature, out, (count,))
        if out is not None:
            arrays = unshared(arrays, outputs)

        def some(start: int, stop: int) -> None:
            mine = [array[start:stop] if stride else array for array, stride in zip(arrays, strides, strict=True)]
            self.backend.batch(stop - start, mine, strides, [array[start:stop] for array in outputs])

        with progress("batch") if count > CALLS else nullcontext():
            in_parts(some, count, threads)
        return self._wrap(outputs, out, scalars=False)

    @cached_property
    def _single(self) -> Compiled[Any]:
        made: Compiled[Any] = import_module(SINGLE).single_of(self.kernel)
        return made

    def _check_real(self, form: str, real: str) -> None:
        known = [self.signature.real] if self.signature.real != "double" else list(DTYPES)
        if not isinstance(real, str) or real not in known:
            raise InputError(f"{self.name}.{form}: real is one of {', '.join(known)}, given {shown(real)}")

    @cached_property
    def _varying(self) -> Varying:
        made: Varying = import_module(VARYING).varying_of(self.kernel)
        return made

    @property
    def varying(self) -> Any:
        """Where the entries of the layout "varying" belong, as `numpy.nonzero` gives places: X[(..., *f.varying)]."""
        found = self._varying.index
        return found[0] if self.result_type is None else self.result_type(*found)

    def whole(self, values: Any) -> Any:
        """Results of the layout "varying", (..., m), with the entries that never vary put in: (..., *shape).

        Raises:
            ShapeError: the last axis does not hold m entries.
        """
        found = self._varying.whole([values] if self.result_type is None else list(values))
        return found[0] if self.result_type is None else self.result_type(*found)

    def scan(self, *args: Any, n: int, every: int = 1, out: Any = None, **named: Any) -> Array:
        """The loop state <- f(state, ...), n times, in C; the state is the first input and the first output.

        Args:
            *args: the start, then the other inputs: with a leading axis of length n, one entry a step, or the
                same for all steps.
            n: number of steps, a multiple of `every`.
            every: steps from one stored state to the next.
            out: as for a call, of the shape returned.
            **named: inputs by name.

        Returns:
            (n // every + 1, *shape): the start, then every `every`-th state.

        Raises:
            InputError: the kernel is no step, or n is no multiple of `every`.
            ShapeError: as for a batch.
        """
        return scan(self, args, named, n, every, out)

    def scan_batch(
        self,
        *args: Any,
        n: int,
        every: int = 1,
        out: Any = None,
        threads: int = 1,
        reduce: Mapping[str, str] | None = None,
        real: str = "double",
        **named: Any,
    ) -> Any:
        """T such loops at once, on lanes: the loop of `scan` from every start.

        Args:
            *args: the starts (T, *shape), then the other inputs: `shape` (the same always), (T, *shape) (one a
                trajectory), or (T, n, *shape) (one a step too), where T may be 1 for all trajectories. The starts may
                be one `shape` if another input has T.
            n, every, out: as for `scan`.
            threads: over which the trajectories are shared out.
            reduce: {output: "sum" | "max" | "min" | "last"} of the outputs behind the state, as a step's cost or error: no
                trajectory is stored, neither states nor these. {} for the last states alone.
            real: "float" for screening, as for a batch.
            **named: inputs by name.

        Returns:
            (T, n // every + 1, *shape); as `scan` from each start to the accuracy of a batch. With `reduce` a named tuple: the
            last states (T, *shape), then (T, *its shape) of each output named, over all n steps (a NaN stays; of no step: 0,
            -inf, inf, NaN).

        Raises:
            InputError: as for `scan`; `reduce` names no output behind the state, or no such reduction.
            ShapeError: as for `scan`.
        """
        self._check_real("scan_batch", real)
        if real != self.signature.real:
            return self._single.scan_batch(
                *args, n=n, every=every, out=out, threads=threads, reduce=reduce, real=real, **named
            )
        if reduce is None:
            return scan_batch(self, args, named, n, every, out, threads)
        if out is not None or every != 1:
            raise InputError(f"{self.name}.scan_batch: reduce= stores no trajectory; leave every= and out= out")
        return scan_reduced(self, args, named, n, reduce, threads)

    def drive(
        self,
        start: Any,
        u: Any,
        *,
        n: int,
        h: float,
        t0: float = 0.0,
        every: int = 1,
        at: Mapping[str, float] | None = None,
        threads: int = 1,
        **named: Any,
    ) -> Array:
        """The loop of `scan` under u(t), evaluated in the loop: for long runs, no memory a step.

        Args:
            start: the state, or (T, *shape) for T trajectories.
            u: a PeriodicInput of sines and cosines or of straight pieces, a SampledInput, or a FormulaInput (which may
                have T trajectories). The jumps of an input in pieces must fall on steps: each step reads one piece.
            n: number of steps, a multiple of `every`.
            h: length of a step, also given to a scalar input `h`; a scalar input `t` gets the time of a step.
            t0: when the first step begins; step k begins at t0 + k h, known to more than double precision.
            every: steps from one stored state to the next.
            at: input -> where in a step it reads u, from 0 to 1; u0 at 0, um at 1/2, u1 at 1 by default.
            threads: over which trajectories are shared out.
            **named: the other inputs, as for `scan_batch`.

        Returns:
            (n // every + 1, *shape), with a leading axis T if start or u has one.

        Raises:
            InputError: u is no formula of time (sample it, and use `scan`), n, every or h does not fit.
            ShapeError: as for `scan_batch`.
        """
        from lie_codegen.runtime.drive import driven

        return driven(self, start, u, n=n, h=h, t0=t0, every=every, at=at, threads=threads, others=named)

    def _wrap(self, outputs: list[Array], out: Any, *, scalars: bool) -> Any:
        if out is not None:
            return out if self.result_type in (None, type(out)) else self.result_type(*outputs)
        values = [array.item() if scalars and array.ndim == 0 else array for array in outputs]
        return values[0] if self.result_type is None else self.result_type(*values)

    def belongs_to(self, library: Any) -> None:
        """The library of which it is a kernel: it pickles as that kernel of that library."""
        self._library = library

    @property
    def kernel(self) -> Kernel:
        """The Kernel that it was compiled from.

        Raises:
            InputError: it belongs to no library made by lc.build.
        """
        if self._library is None:
            raise InputError(f"the function {self.name} belongs to no library made by lc.build; give the Kernel")
        made: Kernel = self._library.kernel_of(self.name)
        return made

    def reduced(self) -> tuple[Any, ...]:
        """How it is made again, for pickle."""
        if self._library is None:
            raise TypeError(f"the kernel {self.name} belongs to no library made by lc.build and cannot be pickled")
        return kernel_of_library, (self._library, self.name)

    @property
    def definition(self) -> Definition | None:
        """What makes it again, as plain data; None where its library has none."""
        whole = None if self._library is None else self._library.definition
        if whole is None:
            return None
        kind = f"{__name__}:{kernel_of_library.__name__}"
        return Definition({"kind": kind, "parameters": Definition({"library": whole, "name": self.name})})

    def save(self, path: str | Path) -> Path:
        """Write what makes it again as an npz file: `lc.load` builds its library, or finds it in the cache; returns the path.

        Raises:
            InputError: its library has no definition.
            OutputFolderError, SystemRefusalError: the file cannot be written; what was there is untouched.
        """
        from lie_codegen.kernel.saved import save_definition

        return save_definition(self, path, f"the compiled kernel {self.name}")

    def __reduce__(self) -> tuple[Any, ...]:
        return self.reduced()

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        alike = isinstance(other, Compiled) and self.signature == other.signature and self._library is not None
        return alike and self._library == getattr(other, "_library", None)

    def __hash__(self) -> int:
        return hash(self.signature.symbol)

    def __repr__(self) -> str:
        how = "compiled" if self.compiled else "interpreted"
        return f"<{how} kernel {prototype(self.signature)}>"


@makes_records
def kernel_of_library(library: Any, name: str) -> Any:
    """A compiled kernel as pickles and files name it."""
    return library[name]
