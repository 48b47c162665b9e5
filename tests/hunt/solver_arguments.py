"""What a C solver says to arguments that are no numbers, or none that it can use: a status of its own, never a wrong answer."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import lie_codegen as lc
from lie_codegen.steering.shooting.package import render_steering_package

COMPILER = shutil.which("gcc") or shutil.which("cc")
SANITIZE = (
    "-fsanitize=address,undefined,float-cast-overflow",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
    "-g1",
)
#: Each line of options, weights and the target is one fault; a good target stands beside the bad one.
DRIVER = r"""
#include "PREFIX.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

static int tried, wrong;

static void expect(const char *what, const double *targets, const double *weights, const PREFIX_options *options, int first, int second)
{
    PREFIX_result results[2];
    PREFIX_solve(2, targets, weights, options, results);
    ++tried;
    if (results[0].status != first || results[1].status != second || (first == UPPER_INPUT && !isnan(results[0].cost))
        || (first == UPPER_INPUT && !isnan(results[0].mu0[0]))) {
        ++wrong;
        printf("%s: status %d, %d\n", what, results[0].status, results[1].status);
    }
}

int main(void)
{
    static const double bad[] = {NAN, INFINITY, -INFINITY, -1.0, 1e300, 2.0};
    static const double good[] = {GOOD};
    double targets[2 * FULL], weights[CONTROLS];
    const PREFIX_options plain = PREFIX_defaults();
    PREFIX_options options;
    int i, k;
    for (i = 0; i < CONTROLS; ++i) {
        weights[i] = 1.0;
    }
    memcpy(targets, good, sizeof good);
    memcpy(targets + FULL, good, sizeof good);
    expect("good", targets, weights, &plain, UPPER_SOLVED, UPPER_SOLVED);
    for (k = 0; k < 6; ++k) {
        options = plain;
        options.tolerance = bad[k];
        expect("tolerance", targets, weights, &options, UPPER_INPUT, UPPER_INPUT);
        options = plain;
        options.search_tolerance = bad[k];
        expect("search_tolerance", targets, weights, &options, UPPER_INPUT, UPPER_INPUT);
    }
    for (k = 0; k < 5; ++k) {
        weights[0] = bad[k];
        expect("weight", targets, weights, &plain, UPPER_INPUT, UPPER_INPUT);
        weights[0] = 1.0;
        if (bad[k] != -1.0) {
            for (i = 0; i < FULL; ++i) {
                const double kept = targets[i];
                targets[i] = bad[k];
                expect("target", targets, weights, &plain, UPPER_INPUT, UPPER_SOLVED);
                targets[i] = kept;
            }
        }
    }
    weights[0] = 0.0;
    expect("no weight", targets, weights, &plain, UPPER_INPUT, UPPER_INPUT);
    weights[0] = 1.0;
    options = plain;
    options.starts = -1;
    expect("starts", targets, weights, &options, UPPER_INPUT, UPPER_INPUT);
    options = plain;
    options.polish_iterations = -5;
    expect("iterations", targets, weights, &options, UPPER_INPUT, UPPER_INPUT);
    printf("%d %d\n", tried, wrong);
    return wrong != 0;
}
"""


def hunt(folder: Path, *, sanitize: bool = True, lanes: tuple[str, ...] = ()) -> tuple[int, list[str]]:
    """(calls, those with a wrong status) of the shooting solver of SO(3) with two controls."""
    tree = render_steering_package(lc.group("so3"), ("w1", "w2"))
    for path, text in tree.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    good = "0.955336489125606, -0.295520206661340, 0.0, 0.295520206661340, 0.955336489125606, 0.0, 0.0, 0.0, 1.0"
    text = DRIVER.replace("FULL", "9").replace("CONTROLS", "2").replace("GOOD", good)
    (folder / "driver.c").write_text(text.replace("PREFIX", "so3_steer").replace("UPPER", "SO3_STEER"))
    flags = ("-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", *lanes, *(SANITIZE if sanitize else ()))
    command = [str(COMPILER), *flags, "-Iinclude", "driver.c", "src/so3_steer.c", "-lm", "-o", "driver"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    done = subprocess.run([folder / "driver"], capture_output=True, text=True, check=False, timeout=300)
    *lines, last = (done.stdout.strip() or "0 0").splitlines()
    found = lines + ([done.stderr[-2000:]] if done.stderr else [])
    return int(last.split()[0]), found
