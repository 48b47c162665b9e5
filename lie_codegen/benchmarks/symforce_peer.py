"""The peer SymForce: our kernels, or its own SE(3), through its C++ generator, compiled with Eigen; called by pybind11."""

from __future__ import annotations

import contextlib
import ctypes
import io
import shutil
import subprocess
import sysconfig
from fractions import Fraction
from pathlib import Path
from typing import Any

from lie_codegen.benchmarks.peers import need
from lie_codegen.benchmarks.rows import AbsentError
from lie_codegen.codegen.tape import tape_of
from lie_codegen.codegen.templates import render
from lie_codegen.codegen.views import kernel_view
from lie_codegen.kernel.kernel import Kernel, Port

_FLAGS = ("-std=c++17", "-O3", "-march=native", "-fno-math-errno", "-fPIC", "-shared")
#: Above this many instructions its simplifications and Eigen's templates take minutes.
_LARGEST = 800


class _Arithmetic:
    """Kernel bodies over SymForce's scalars; it has no conditionals."""

    def __init__(self, sf: Any) -> None:
        self._sf = sf
        for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "sinh", "cosh", "tanh", "acos", "asin", "atan2"):
            setattr(self, name, getattr(sf, name))

    def constant(self, value: Any) -> Any:
        if isinstance(value, Fraction):
            return self._sf.Rational(value.numerator, value.denominator)
        return int(value) if value == int(value) else self._sf.S(float(value))

    def __getattr__(self, name: str) -> Any:
        raise AbsentError(f"SymForce has no {name}")


class SymForce:
    """One kernel of one output through SymForce.

    Raises:
        AbsentError: it is not installed, has no such function, or no C++ compiler or Eigen is there.
    """

    def __init__(self, kernel: Kernel, folder: Path) -> None:
        if len(kernel.outputs) != 1 or any(port.is_complex for port in (*kernel.inputs, *kernel.outputs)):
            raise AbsentError("complex, or several outputs")
        if len(tape_of(kernel).statements) > _LARGEST:
            raise AbsentError(f"more than {_LARGEST} instructions")
        need("symforce").set_epsilon_to_number()
        self._kernel, self._folder = kernel, folder
        self._function = "".join(part.capitalize() for part in kernel.symbol.split("_"))
        with contextlib.redirect_stdout(io.StringIO()):
            self._header = _generated(kernel, folder)

    def batch(self) -> ctypes.CDLL:
        """Its C++ in a loop."""
        return ctypes.CDLL(str(self._compiled("", [])))

    def call(self) -> Any:
        """Its C++ behind pybind11, with Eigen's converters: arrays (n,) -> array (m,)."""
        pybind11 = need("pybind11")
        name = f"{self._kernel.symbol}_symforce"
        path = self._compiled(name, [f"-I{pybind11.get_include()}", f"-I{sysconfig.get_path('include')}"])
        import importlib.util

        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None or spec.loader is None:
            raise AbsentError(f"cannot load {path}")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.point

    def _compiled(self, module: str, more: list[str]) -> Path:
        compiler, eigen = shutil.which("g++") or shutil.which("clang++"), _eigen()
        if compiler is None:
            raise AbsentError("no C++ compiler")
        stem = module or f"{self._kernel.symbol}_symforce_loop"
        source, library = self._folder / f"{stem}.cpp", self._folder / f"{stem}.so"
        view = kernel_view(self._kernel, tape_of(self._kernel, routines=False))
        text = render(
            "bench_symforce.cpp.jinja", kernel=view, header=self._header, function=self._function, module=module
        )
        source.write_text(text, encoding="utf-8")
        command = [compiler, *_FLAGS, f"-I{eigen}", *more, str(source), "-o", str(library)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise AbsentError(f"its C++ does not compile: {done.stderr[:160]}")
        return library


def _eigen() -> Path:
    """Where Eigen's headers are: of the wheel cmeel-eigen, or of the system."""
    wheel = Path(sysconfig.get_path("purelib")) / "cmeel.prefix" / "include" / "eigen3"
    for folder in (wheel, Path("/usr/include/eigen3"), Path("/usr/local/include/eigen3")):
        if (folder / "Eigen" / "Core").is_file():
            return folder
    raise AbsentError("Eigen's headers are not installed (the wheel cmeel-eigen has them)")


def _generated(kernel: Kernel, folder: Path) -> Path:
    """The header of the kernel, from flat vectors to a flat vector."""
    codegen, sf, values = need("symforce.codegen"), need("symforce.symbolic"), need("symforce.values")
    inputs = {port.name: sf.Matrix(port.size, 1).symbolic(port.name) for port in kernel.inputs}
    outputs = _own(kernel, sf, inputs) or _ours(kernel, sf, inputs)
    [port] = kernel.outputs
    made = codegen.Codegen(
        inputs=values.Values(**inputs),
        outputs=values.Values(**{port.name: sf.Matrix(port.size, 1, outputs)}),
        config=codegen.CppConfig(),
        name=kernel.symbol,
        return_key=port.name,
    ).generate_function(output_dir=folder / "symforce", skip_directory_nesting=True)
    return Path(made.generated_files[0])


def _own(kernel: Kernel, sf: Any, inputs: dict[str, Any]) -> list[Any] | None:
    """SymForce's own exp of SE(3), where the small angle is guarded by its epsilon."""
    if kernel.symbol != "se3_exp":
        return None
    pose = need("symforce.geo.unsupported.pose3_se3").Pose3_SE3
    return list(pose.from_tangent(list(inputs["x"])).to_homogenous_matrix().to_flat_list())


def _ours(kernel: Kernel, sf: Any, inputs: dict[str, Any]) -> list[Any]:
    arguments = [_shaped(list(inputs[port.name]), port) for port in kernel.inputs]
    [result] = kernel.evaluate(_Arithmetic(sf), *arguments)
    rows = result if kernel.outputs[0].shape else [result]
    return [entry for row in rows for entry in (row if isinstance(row, list) else [row])]


def _shaped(entries: list[Any], port: Port) -> Any:
    if len(port.shape) == 2:
        width = port.shape[1]
        return [entries[i : i + width] for i in range(0, len(entries), width)]
    return entries if port.shape else entries[0]
