"""Kernels as CUDA and OpenCL text: run on this processor by headers that stand in for a device, by pocl, and compiled by clang and nvcc."""

from __future__ import annotations

import ctypes
import random
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import CodegenError, InputError

REALS = {"double": np.float64, "float": np.float32}
ALLOWED = {"double": 2e-14, "float": 2e-5}
#: What a language gives a thread, said in C or C++: one thread, its number a variable.
STAND_IN = {
    "opencl": (
        "gcc",
        ("-std=c99", "-x", "c"),
        "#include <math.h>\n#define __kernel\n#define __global\nlong place;\n#define get_global_id(k) place\n",
    ),
    "cuda": (
        "g++",
        ("-x", "c++"),
        '#include <math.h>\n#define __global__\n#define __restrict__ __restrict\nextern "C" { long place; }\n'
        "struct Place { long x; };\n"
        "#define blockIdx (Place{place})\n#define blockDim (Place{1})\n#define threadIdx (Place{0})\n",
    ),
}


def samples(kernel: lc.Kernel, count: int, seed: int = 0) -> list[np.ndarray]:
    """(count, *shape) of every input."""
    rng = random.Random(seed)
    rows = [kernel.sampler(rng) for _ in range(count)]

    def number(z: Any) -> complex | float:
        return complex(z.re, z.im) if hasattr(z, "re") and hasattr(z, "im") else z

    return [
        np.array([[number(z) for z in np.ravel(np.array(row[i], dtype=object))] for row in rows])
        .reshape(count, *port.shape)
        .astype(complex if port.is_complex else float)
        for i, port in enumerate(kernel.inputs)
    ]


def reals(array: np.ndarray, real: str) -> np.ndarray:
    return np.ascontiguousarray(np.ascontiguousarray(array).view(float).astype(REALS[real]))


def wanted(group: str, kernel: lc.Kernel, arrays: list[np.ndarray]) -> list[np.ndarray]:
    function = lc.build(group)[kernel.name]
    found = [made if isinstance(made := function(*sample), tuple) else (made,) for sample in zip(*arrays, strict=True)]
    return [np.array(each) for each in zip(*found, strict=True)]


def agree(found: np.ndarray, exact: np.ndarray, real: str, what: str) -> None:
    flat = np.ascontiguousarray(exact).view(float).reshape(found.shape)
    np.testing.assert_allclose(
        found, flat, rtol=0, atol=ALLOWED[real] * max(1.0, np.max(np.abs(flat), initial=0)), err_msg=what
    )


@pytest.mark.parametrize("target", ["opencl", "cuda"])
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("group", ["so3", "su2", "se2"])
def test_every_thread_computes_its_sample(tmp_path: Path, target: str, real: str, group: str) -> None:
    compiler, flags, prelude = STAND_IN[target]
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}")
    text = lc.device_source(group, target=target, real=real)
    source = tmp_path / "device.txt"
    source.write_text(prelude + text)
    subprocess.run(
        [compiler, *flags, "-O1", "-ffp-contract=off", "-fPIC", "-shared", str(source), "-o", str(tmp_path / "d.so"), "-lm"],
        check=True,
    )  # fmt: skip
    library = ctypes.CDLL(str(tmp_path / "d.so"))
    thread = ctypes.c_long.in_dll(library, "place")
    seen = 0
    for kernel in lc.group_kernels(group):
        if f"{kernel.symbol}_batch" not in text:
            continue
        seen += 1
        arrays = samples(kernel, 9)
        exact = wanted(group, kernel, arrays)
        flat = [reals(each, real) for each in arrays]
        outputs = [np.full((9, port.size), np.nan, REALS[real]) for port in kernel.outputs]
        arguments: list[Any] = [ctypes.c_long(8)]
        for port, array in zip(kernel.inputs, flat, strict=True):
            arguments += [ctypes.c_void_p(array.ctypes.data), ctypes.c_long(port.size)]
        arguments += [ctypes.c_void_p(each.ctypes.data) for each in outputs]
        for k in range(9):
            thread.value = k
            library[f"{kernel.symbol}_batch"](*arguments)
        for found, each in zip(outputs, exact, strict=True):
            agree(found[:8], each[:8], real, kernel.symbol)
            assert np.all(np.isnan(found[8]))  # beyond the count
    assert seen >= 12


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("group", ["se3", pytest.param("su3", marks=pytest.mark.slow)])
def test_pocl_runs_the_opencl_text(real: str, group: str) -> None:
    cl = pytest.importorskip("pyopencl")
    try:
        device = cl.get_platforms()[0].get_devices()[0]
    except (cl.Error, IndexError):
        pytest.skip("no OpenCL device")
    context = cl.Context([device])
    queue = cl.CommandQueue(context)
    text = lc.device_source(group, real=real)
    program = cl.Program(context, text).build()
    flags, count = cl.mem_flags, 65
    for kernel in lc.group_kernels(group):
        if f"{kernel.symbol}_batch" not in text:
            continue
        arrays = samples(kernel, count, 1)
        exact = wanted(group, kernel, arrays)
        arguments: list[Any] = [np.int64(count)]
        for port, array in zip(kernel.inputs, arrays, strict=True):
            held = cl.Buffer(context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=reals(array, real))
            arguments += [held, np.int64(port.size)]
        outputs = [np.empty((count, port.size), REALS[real]) for port in kernel.outputs]
        buffers = [cl.Buffer(context, flags.WRITE_ONLY, each.nbytes) for each in outputs]
        getattr(program, f"{kernel.symbol}_batch")(queue, (count,), None, *arguments, *buffers)
        for array, buffer, each in zip(outputs, buffers, exact, strict=True):
            cl.enqueue_copy(queue, array, buffer)
            agree(array, each, real, kernel.symbol)


@pytest.mark.parametrize("real", ["double", "float"])
def test_nvcc_takes_the_cuda_text(tmp_path: Path, real: str) -> None:
    if shutil.which("nvcc") is None:
        pytest.skip("no nvcc")
    source = tmp_path / "se3.cu"
    source.write_text(lc.device_source("se3", target="cuda", real=real))
    done = subprocess.run(
        ["nvcc", "-ptx", "-arch=sm_80", str(source), "-o", str(tmp_path / "se3.ptx")], capture_output=True, text=True, check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert ".entry se3_exp_batch" in (tmp_path / "se3.ptx").read_text()


#: What nvcc knows of itself and clang takes from CUDA's headers: threads and the mathematics.
DEVICE = """
#define __global__ __attribute__((global))
#define __device__ __attribute__((device))
#define NAN __builtin_nanf("")
#define HUGE_VAL __builtin_huge_val()
#define HUGE_VALF __builtin_huge_valf()
struct Place { int x; };
#define threadIdx (Place{__nvvm_read_ptx_sreg_tid_x()})
#define blockIdx (Place{__nvvm_read_ptx_sreg_ctaid_x()})
#define blockDim (Place{__nvvm_read_ptx_sreg_ntid_x()})
#define ONE(name) extern "C" __device__ double name(double); extern "C" __device__ float name##f(float);
#define TWO(name) extern "C" __device__ double name(double, double); extern "C" __device__ float name##f(float, float);
ONE(sin) ONE(cos) ONE(tan) ONE(asin) ONE(acos) ONE(atan) ONE(sinh) ONE(cosh) ONE(tanh) ONE(exp) ONE(expm1) ONE(log)
ONE(sqrt) ONE(fabs) ONE(floor) ONE(ceil) TWO(atan2) TWO(pow) TWO(copysign) TWO(fmin) TWO(fmax)
"""
CLANG = {
    "cuda": (
        "-x",
        "cuda",
        "--cuda-gpu-arch=sm_70",
        "--cuda-device-only",
        "-nocudainc",
        "-nocudalib",
        "-Wno-unknown-cuda-version",
    ),
    "opencl": ("-x", "cl", "-cl-std=CL1.2", "-Xclang", "-finclude-default-header", "--target=nvptx64-nvidia-nvcl"),
}


@pytest.mark.parametrize("target", ["opencl", "cuda"])
@pytest.mark.parametrize("real", ["double", "float"])
def test_clang_makes_machine_code_of_a_device_from_the_text(tmp_path: Path, target: str, real: str) -> None:
    """PTX, in which every kernel is an entry."""
    if (
        shutil.which("clang") is None
        or b"nvptx64" not in subprocess.run(["clang", "-print-targets"], capture_output=True).stdout
    ):
        pytest.skip("no clang for such devices")
    text = lc.device_source("se3", target=target, real=real)
    (tmp_path / "se3").write_text((DEVICE if target == "cuda" else "") + text)
    done = subprocess.run(
        ["clang", *CLANG[target], "-O1", "-S", str(tmp_path / "se3"), "-o", str(tmp_path / "se3.ptx")], capture_output=True, text=True, check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    wanted = {kernel.symbol for kernel in lc.group_kernels("se3") if f"{kernel.symbol}_batch(" in text}
    machine = (tmp_path / "se3.ptx").read_text()
    assert len(wanted) >= 12
    assert {symbol for symbol in wanted if f".entry {symbol}_batch" in machine} == wanted


def test_a_stride_of_zero_and_names_that_are_taken_are_no_trouble() -> None:
    kernel = lc.Kernel(
        name="odd", namespace="toy",
        inputs=(lc.Port("count", ()), lc.Port("thread", (2,)), lc.Port("count_all", (2,))), outputs=(lc.Port("y", ()),),
        body=lambda ops, count, thread, more: (count * thread[0] + more[1],), formula="", source="",
        sampler=lambda rng: (rng.random(), [rng.random(), 1.0], [1.0, rng.random()]),
    )  # fmt: skip
    text = lc.device_source(kernel, target="cuda")
    arguments = text[text.index("toy_odd_batch(") : text.index(")\n{")]
    names = [each.split("*")[-1].split()[-1] for each in arguments.split("(")[1].split(",")]
    assert len(set(names)) == len(names) == 8


def test_what_has_no_device_form_is_refused() -> None:
    with pytest.raises(InputError, match="target is one of opencl, cuda"):
        lc.device_source("so3", target="metal")
    with pytest.raises(InputError, match="real is one of"):
        lc.device_source("so3", real="half")
    with pytest.raises(CodegenError, match="calls a routine with loops"):
        lc.device_source("su3", kernels=["log"])
    with pytest.raises(InputError, match="kernels= are names"):
        lc.device_source(lc.group_kernels("so3")[0], kernels=["exp"])
    with pytest.raises(InputError, match="give a group or Kernels"):
        lc.device_source([])
