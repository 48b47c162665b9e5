"""Generated C with random, huge, subnormal and non-finite arguments under AddressSanitizer and UndefinedBehaviorSanitizer.

What must hold: no access outside the arrays (each has its exact size on the heap), no undefined behaviour (a conversion of NaN to an integer,
an index out of range), an end; and on lanes what the scalar function gives, NaN for NaN.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import lie_codegen as lc
from lie_codegen.codegen.package import render_library
from lie_codegen.kernel.kernel import Kernel
from tests.hunt.solver_arguments import COMPILER, SANITIZE

DRIVER = r"""
#include "NAMESPACE_binding.c"
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

static uint64_t state = SEED;

static double hostile(void)
{
    static const double odd[] = {NAN, INFINITY, -INFINITY, 0.0, -0.0, 1e308, -1e308, 5e-324, 1e-300, 1e16, 3.141592653589793, 1e200};
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    if ((state >> 60) < 3) {
        return odd[(state >> 20) % (sizeof odd / sizeof *odd)];
    }
    return 8.0 * ((double)(state >> 11) / 9007199254740992.0) - 4.0;
}

static double *filled(size_t count)
{
    double *made = malloc((count ? count : 1) * sizeof *made);
    size_t k;
    for (k = 0; k < count; ++k) {
        made[k] = hostile();
    }
    return made;
}

typedef void (*batch)(ptrdiff_t, const double *const *, const ptrdiff_t *, double *const *);
static long tried;

static void exercise(batch f, const ptrdiff_t *in_sizes, int inputs, const ptrdiff_t *out_sizes, int outputs)
{
    ptrdiff_t n;
    int k, round;
    for (round = 0; round < ROUNDS; ++round) {
        for (n = 1; n < 20; n += 6) {
            double *in[16], *out[16];
            for (k = 0; k < inputs; ++k) {
                in[k] = filled((size_t)(n * in_sizes[k]));
            }
            for (k = 0; k < outputs; ++k) {
                out[k] = filled((size_t)(n * out_sizes[k]));
            }
            f(n, (const double *const *)in, in_sizes, out);
            tried += n;
            for (k = 0; k < inputs; ++k) {
                free(in[k]);
            }
            for (k = 0; k < outputs; ++k) {
                free(out[k]);
            }
        }
    }
}

int main(void)
{
CALLS
    printf("%ld\n", tried);
    return 0;
}
"""


def _call(kernel: Kernel) -> str:
    sizes = [", ".join(str(port.size) for port in ports) for ports in (kernel.inputs, kernel.outputs)]
    return (
        f"    {{ const ptrdiff_t a[] = {{{sizes[0]}}}, b[] = {{{sizes[1]}}}; "
        f"exercise({kernel.symbol}_batch, a, {len(kernel.inputs)}, b, {len(kernel.outputs)}); }}"
    )


def hunt(folder: Path, group: str, rounds: int, *, lanes: bool = True, seed: int = 1) -> tuple[int, list[str]]:
    """(samples, what the sanitizers say) of every kernel of a group."""
    kernels = [kernel for kernel in lc.group_kernels(group) if len(kernel.inputs) <= 16 and len(kernel.outputs) <= 16]
    namespace = kernels[0].namespace
    sources = render_library(namespace, kernels)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in sources.files.items():
        (folder / name).write_text(text)
    text = DRIVER.replace("NAMESPACE", namespace).replace("SEED", f"UINT64_C({seed + 88172645463325252})")
    calls = "\n".join(_call(kernel) for kernel in kernels)
    (folder / "driver.c").write_text(text.replace("ROUNDS", str(rounds)).replace("CALLS", calls))
    flags = ["-std=c11", "-O1", "-fno-tree-vectorize", *SANITIZE, *([] if lanes else ["-DLCG_LANES=1"])]
    command = [str(COMPILER), *flags, "driver.c", "-lm", "-o", "driver"]
    built = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True)
    if built.returncode:
        return 0, [f"{group}: {built.stderr[:2000]}"]
    done = subprocess.run([folder / "driver"], capture_output=True, text=True, check=False, timeout=600)
    wrong = [] if done.returncode == 0 else [f"{group}, lanes {lanes}: {done.stderr[:2000]}"]
    return int(done.stdout or 0), wrong


def has_sanitizers(folder: Path) -> bool:
    """Whether the compiler brings their libraries."""
    if COMPILER is None:
        return False
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "empty.c").write_text("int main(void) { return 0; }\n")
    command = [COMPILER, *SANITIZE, "empty.c", "-o", "empty"]
    built = subprocess.run(command, cwd=folder, check=False, capture_output=True)
    return (
        built.returncode == 0 and subprocess.run([folder / "empty"], check=False, capture_output=True).returncode == 0
    )
