"""Generated C under the sanitizers and valgrind: the example, and batches of every length in arrays of exact size."""

from __future__ import annotations

import platform
import shutil
import subprocess
from pathlib import Path

import pytest
import toy_kernels
from operation_kernels import every_operation, mixed, sizes

import lie_codegen as lc
from lie_codegen.codegen.package import render_library

X86 = platform.machine() in ("x86_64", "AMD64")
SANITIZE = [
    "-fsanitize=address,undefined,float-cast-overflow",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
    "-g1",
]
#: The strides of a batch are sizes of ports: (kernel, sizes of the inputs, sizes of the outputs).
DRIVER = """
#include "toy_binding.c"
#include <stdio.h>
#include <stdlib.h>

static double *filled(size_t count)
{
    double *made = malloc((count ? count : 1) * sizeof *made);
    size_t k;
    for (k = 0; k < count; ++k) {
        made[k] = 0.01 * (double)(k % 37);
    }
    return made;
}

typedef void (*batch)(ptrdiff_t, const double *const *, const ptrdiff_t *, double *const *);

static void exercise(batch f, const ptrdiff_t *in_sizes, int inputs, const ptrdiff_t *out_sizes, int outputs)
{
    ptrdiff_t n;
    int repeated, k;
    for (n = 0; n < 20; ++n) {
        for (repeated = -1; repeated < inputs; ++repeated) {
            double *in[8], *out[8];
            ptrdiff_t strides[8];
            for (k = 0; k < inputs; ++k) {
                strides[k] = k == repeated ? 0 : in_sizes[k];
                in[k] = filled((size_t)((k == repeated ? 1 : n) * in_sizes[k]));
            }
            for (k = 0; k < outputs; ++k) {
                out[k] = filled((size_t)(n * out_sizes[k]));
            }
            f(n, (const double *const *)in, strides, out);
            for (k = 0; k < inputs; ++k) {
                free(in[k]);
            }
            for (k = 0; k < outputs; ++k) {
                free(out[k]);
            }
        }
    }
}

static void loops(void)
{
    ptrdiff_t count, n = 6;
    for (count = 0; count < 20; ++count) {
        const ptrdiff_t lane[3] = {2, 6, 0}, step[3] = {0, 1, 0};
        double *in[3], *out;
        in[0] = filled((size_t)(2 * count));
        in[1] = filled((size_t)(6 * count));
        in[2] = filled(1);
        out = filled((size_t)(count * 3 * 2));
        toy_step_scan_batch(count, n, 3, (const double *const *)in, lane, step, out);
        free(in[0]);
        free(in[1]);
        free(in[2]);
        free(out);
    }
}

int main(void)
{
CALLS
    loops();
    return puts("done") < 0;
}
"""


def run(*command: str, folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def batches(tmp_path_factory: pytest.TempPathFactory) -> Path:
    kernels = [kernel for kernel in (*toy_kernels.KERNELS, every_operation(), mixed(), sizes()) if kernel.inputs]
    folder = tmp_path_factory.mktemp("sanitized")
    for name, text in render_library("toy", kernels).files.items():
        (folder / name).write_text(text)
    calls = []
    for kernel in kernels:
        ins = ", ".join(str(port.size) for port in kernel.inputs)
        outs = ", ".join(str(port.size) for port in kernel.outputs)
        calls.append(
            f"    exercise({kernel.symbol}_batch, (const ptrdiff_t[]){{{ins}}}, {len(kernel.inputs)}, "
            f"(const ptrdiff_t[]){{{outs}}}, {len(kernel.outputs)});"
        )
    (folder / "driver.c").write_text(DRIVER.replace("CALLS", "\n".join(calls)))
    return folder


@pytest.mark.skipif(not shutil.which("gcc"), reason="needs gcc and its sanitizers")
@pytest.mark.parametrize(
    "machine", ["native", *([pytest.param("haswell", marks=pytest.mark.slow), "x86-64"] if X86 else [])]
)
def test_batches_of_every_length_are_clean(batches: Path, machine: str) -> None:
    if machine == "haswell" and "avx2" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("no AVX2 here")
    output = f"driver_{machine}"
    run("gcc", "-std=c99", "-O1", f"-march={machine}", *SANITIZE, "driver.c", "-lm", "-o", output, folder=batches)
    assert run(f"./{output}", folder=batches) == "done\n"


@pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("valgrind")), reason="needs gcc and valgrind")
def test_valgrind_finds_nothing(batches: Path) -> None:
    run("gcc", "-std=c99", "-O1", "-g", "driver.c", "-lm", "-o", "driver_plain", folder=batches)
    check = ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full", "./driver_plain"]
    assert run(*check, folder=batches) == "done\n"


@pytest.mark.skipif(not shutil.which("gcc"), reason="needs gcc and its sanitizers")
@pytest.mark.parametrize("real", ["double", "float"])
def test_the_example_is_clean(tmp_path: Path, real: str) -> None:
    folder = lc.generate(lc.group("se2"), tmp_path / "se2", real=real)
    sources = ["-Iinclude", "example.c", "src/se2.c", "-lm"]
    run("gcc", "-std=c99", "-O1", *SANITIZE, *sources, "-o", "example", folder=folder)
    assert "WRONG" not in run("./example", folder=folder)
