"""libFuzzer over generated C, under AddressSanitizer and UndefinedBehaviorSanitizer: every kernel of a group, the C steering solver; atheris
over the texts of group files and formulas, where that wheel is installed.

    python -m tests.hunt.fuzz [--seconds N]     fuzzes, and keeps in `corpus/` the smallest set of inputs that reaches as much of the C

Beside the sanitizers a kernel must give one sample the same bits in every lane, and a solver's status must not contradict its numbers.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import lie_codegen as lc
from lie_codegen.codegen.package import render_library
from lie_codegen.steering.shooting.package import render_steering_package

CORPUS = Path(__file__).with_name("corpus") / "fuzzed_c.json"
FLAGS = (
    "-std=c11",
    "-O1",
    "-g",
    "-fsanitize=fuzzer,address,undefined,float-cast-overflow",
    "-fno-sanitize-recover=all",
)
TARGETS = ("so2", "so3", "se3", "su2", "so3_steer")
TEXTS = ("group files", "formulas", "Lagrangians")

KERNELS = r"""
#include "NAMESPACE_binding.c"
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef void (*batch)(ptrdiff_t, const double *const *, const ptrdiff_t *, double *const *);
typedef struct {
    batch call;
    int inputs, outputs;
    ptrdiff_t in[16], out[16];
} kernel;
static const kernel kernels[] = {
KERNELS
};

/* The first byte is the kernel, the second the number of samples, all of them equal; the rest are the numbers, repeated as often as needed. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const ptrdiff_t counts[] = {1, 8, 9, 17};
    const size_t numbers = size < 10 ? 0 : (size - 2) / 8;
    double *in[16], *out[16];
    ptrdiff_t n, i, j;
    size_t next = 0;
    int k;
    if (numbers == 0) {
        return 0;
    }
    const kernel *const it = &kernels[data[0] % (sizeof kernels / sizeof *kernels)];
    n = counts[data[1] % 4];
    for (k = 0; k < it->inputs; ++k) {
        in[k] = malloc((size_t)(n * it->in[k]) * sizeof **in + 1);
        for (j = 0; j < it->in[k]; ++j, ++next) {
            for (i = 0; i < n; ++i) {
                memcpy(&in[k][i * it->in[k] + j], data + 2 + 8 * (next % numbers), 8);
            }
        }
    }
    for (k = 0; k < it->outputs; ++k) {
        out[k] = malloc((size_t)(n * it->out[k]) * sizeof **out + 1);
    }
    it->call(n, (const double *const *)in, it->in, out);
    for (k = 0; k < it->outputs; ++k) {
        for (i = 1; i < n && i < 8; ++i) {
            for (j = 0; n >= 8 && j < it->out[k]; ++j) {
                const double first = out[k][j], here = out[k][i * it->out[k] + j];
                if (memcmp(&first, &here, sizeof first) != 0 && !(isnan(first) && isnan(here))) {
                    __builtin_trap(); /* one sample has other bits in another lane */
                }
            }
        }
        free(out[k]);
    }
    for (k = 0; k < it->inputs; ++k) {
        free(in[k]);
    }
    return 0;
}
"""

SOLVER = r"""
#include "PREFIX.h"
#include <math.h>
#include <stdint.h>
#include <string.h>

static double number(const uint8_t *data, size_t size, size_t k)
{
    double value = 0.5;
    if (8 * k + 8 <= size) {
        memcpy(&value, data + 8 * k, 8);
    }
    return value;
}

/* A rotation by the first three numbers, then moved off the group by the fourth; weights; options. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const PREFIX_options plain = PREFIX_defaults();
    PREFIX_options options = plain;
    PREFIX_result result;
    double weights[2], target[9], q[4], length = 0.0;
    int k;
    for (k = 0; k < 4; ++k) {
        q[k] = number(data, size, (size_t)k);
        length += q[k] * q[k];
    }
    for (k = 0; k < 4; ++k) {
        q[k] /= sqrt(length);
    }
    target[0] = 1 - 2 * (q[2] * q[2] + q[3] * q[3]);
    target[1] = 2 * (q[1] * q[2] - q[0] * q[3]);
    target[2] = 2 * (q[1] * q[3] + q[0] * q[2]);
    target[3] = 2 * (q[1] * q[2] + q[0] * q[3]);
    target[4] = 1 - 2 * (q[1] * q[1] + q[3] * q[3]);
    target[5] = 2 * (q[2] * q[3] - q[0] * q[1]);
    target[6] = 2 * (q[1] * q[3] - q[0] * q[2]);
    target[7] = 2 * (q[2] * q[3] + q[0] * q[1]);
    target[8] = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
    weights[0] = number(data, size, 4);
    weights[1] = number(data, size, 5);
    if (size > 56) {
        target[data[48] % 9] += number(data, size, 7);
    }
    if (size > 64) {
        options.tolerance = number(data, size, 8);
    }
    options.starts = size > 72 ? (int)(int8_t)data[72] % 3 : 1;
    options.search_iterations = 5;
    options.polish_iterations = 3;
    options.search_steps = 8;
    options.polish_steps = 8;
    PREFIX_solve(1, target, weights, &options, &result);
    switch (result.status) {
    case UPPER_SOLVED:
        if (!(result.residual <= options.tolerance) || !isfinite(result.cost) || !(result.cost >= 0) || !isfinite(result.mu0[0] + result.mu0[1] + result.mu0[2])) {
            __builtin_trap(); /* solved, and the numbers say it is not */
        }
        break;
    case UPPER_NOT_CONVERGED:
    case UPPER_NOTHING_FOUND:
        break;
    case UPPER_INPUT:
        if (!isnan(result.cost) || !isnan(result.mu0[0])) {
            __builtin_trap();
        }
        break;
    default:
        __builtin_trap();
    }
    return 0;
}
"""


@cache
def has_fuzzer() -> bool:
    """Whether clang is here with its fuzzer."""
    with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
        (Path(folder) / "t.c").write_text(
            "int LLVMFuzzerTestOneInput(const char *d, unsigned long n) { return d && n > 9; }\n"
        )
        command = ["clang", *FLAGS, "t.c", "-o", "t"]
        return (
            shutil.which("clang") is not None
            and subprocess.run(command, cwd=folder, check=False, capture_output=True).returncode == 0
        )


def compiled(folder: Path, target: str) -> Path:
    """The program of a target.

    Raises:
        subprocess.CalledProcessError: it is not compiled.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if target.endswith("_steer"):
        files = render_steering_package(lc.group(target.removesuffix("_steer")), ("w1", "w2"))
        text = SOLVER.replace("PREFIX", target).replace("UPPER", target.upper())
        sources = ["-Iinclude", "target.c", f"src/{target}.c"]
    else:
        kernels = [each for each in lc.group_kernels(target) if max(len(each.inputs), len(each.outputs)) <= 16]
        files = render_library(kernels[0].namespace, kernels).files
        rows = []
        for kernel in kernels:
            sizes = [[port.size for port in ports] for ports in (kernel.inputs, kernel.outputs)]
            both = ", ".join("{" + ", ".join(map(str, each)) + "}" for each in sizes)
            rows.append(f"    {{{kernel.symbol}_batch, {len(kernel.inputs)}, {len(kernel.outputs)}, {both}}},")
        text = KERNELS.replace("NAMESPACE", kernels[0].namespace).replace("KERNELS", "\n".join(rows))
        sources = ["target.c"]
    for path, content in {**files, "target.c": text}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(content)
    subprocess.run(
        ["clang", *FLAGS, *sources, "-lm", "-o", "fuzz"], cwd=folder, check=True, capture_output=True, text=True
    )
    return folder / "fuzz"


def kept(target: str) -> list[str]:
    """The inputs kept of a target, in hexadecimal."""
    return list(json.loads(CORPUS.read_text(encoding="utf-8")).get(target, [])) if CORPUS.exists() else []


def hunt(folder: Path, target: str, seconds: int, seed: int = 1) -> tuple[int, list[str]]:
    """(inputs run, finds): the kept ones, and what the fuzzer makes of them in so many seconds."""
    program, inputs = compiled(folder, target), folder / "inputs"
    inputs.mkdir(exist_ok=True)
    for k, text in enumerate(kept(target)):
        (inputs / f"kept{k}").write_bytes(bytes.fromhex(text))
    command = [
        program,
        inputs,
        f"-max_total_time={seconds}",
        f"-seed={seed}",
        "-timeout=10",
        "-max_len=400",
        "-print_final_stats=1",
    ]
    done = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True, timeout=60 + 4 * seconds)
    ran = re.search(r"number_of_executed_units:\s*(\d+)", done.stderr)
    finds = [
        f"{target}: {path.name}: {path.read_bytes().hex()}"
        for path in folder.glob("*-*")
        if path.name.split("-")[0] in ("crash", "timeout", "oom", "leak")
    ]
    if done.returncode and not finds:
        finds.append(f"{target}: status {done.returncode}")
    return int(ran.group(1)) if ran else 0, [f"{each}: {done.stderr[-1500:]}" for each in finds]


def smallest(folder: Path, target: str) -> list[str]:
    """The fewest of the inputs in `folder` that reach as much, in hexadecimal."""
    merged = folder / "merged"
    merged.mkdir(exist_ok=True)
    subprocess.run(
        [folder / "fuzz", "-merge=1", merged, folder / "inputs"], cwd=folder, check=True, capture_output=True
    )
    return sorted(path.read_bytes().hex() for path in merged.iterdir())


def has_atheris() -> bool:
    """Whether the wheel is installed."""
    return importlib.util.find_spec("atheris") is not None


def hunt_texts(kind: str, seconds: int) -> tuple[int, list[str]]:
    """(inputs run, finds) of atheris in a process of its own, guided by the coverage of the loader and of the grammar."""
    command = [
        sys.executable,
        "-m",
        "tests.hunt.fuzz_texts",
        kind,
        f"-max_total_time={seconds}",
        "-timeout=60",
        "-print_final_stats=1",
    ]
    root = Path(__file__).resolve().parents[2]
    with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
        command.append(f"-artifact_prefix={folder}/")
        done = subprocess.run(command, cwd=root, check=False, capture_output=True, text=True, timeout=120 + 4 * seconds)
    ran = re.search(r"number_of_executed_units:\s*(\d+)", done.stderr)
    return int(ran.group(1)) if ran else 0, [
        f"{kind}: {(done.stdout + done.stderr)[-1500:]}"
    ] if done.returncode else []


def main() -> None:
    """Fuzz every target, and keep what is worth it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=60)
    seconds = parser.parse_args().seconds
    every = {}
    with tempfile.TemporaryDirectory(prefix="hunt-") as home:
        for target in TARGETS:
            ran, found = hunt(Path(home) / target, target, seconds)
            print(f"{target}: {ran:,} inputs, {len(found)} found", *found, sep="\n", flush=True)  # noqa: T201
            every[target] = smallest(Path(home) / target, target)
    CORPUS.write_text(json.dumps(every, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
