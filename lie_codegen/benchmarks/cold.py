"""A fresh process to its first exp of SE(3): ours with a warm and a cold cache, the peers, and what imports alone take."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from lie_codegen.benchmarks.rows import Row
from lie_codegen.benchmarks.timing import timings_of
from lie_codegen.codegen.templates import template_folder
from lie_codegen.runtime.child import child_environment

_X = "x = np.array([.1, .2, .3, .4, .5, .6])\n"
_OURS = "import lie_codegen as lc, numpy as np\n" + _X + "lc.build('{0}').exp(x[:{1}])"
#: name -> a program that ends after its first exp; the module it needs.
_PEERS = {
    "numpy, import alone": ("numpy", "import numpy"),
    "casadi, import alone": ("casadi", "import casadi"),
    "jaxlie": (
        "jaxlie",
        "import jax, jaxlie, numpy as np\njax.config.update('jax_enable_x64', True)\n" + _X
        + "jax.block_until_ready(jax.jit(lambda x: jaxlie.SE3.exp(x).as_matrix())(x))",
    ),
    "liecasadi, interpreted": (
        "liecasadi",
        "import casadi as ca, liecasadi, numpy as np\n" + _X
        + "s = ca.SX.sym('x', 6)\nca.Function('f', [s], [liecasadi.SE3Tangent(s).exp().as_matrix()])(x)",
    ),
    "cyecca, interpreted": (
        "cyecca",
        "import casadi as ca, cyecca.lie as lie, numpy as np\n" + _X
        + "s = ca.SX.sym('x', 6)\nca.Function('f', [s], [lie.se3.elem(s).exp(lie.SE3Quat).to_Matrix()])(x)",
    ),
    "SymForce, interpreted": (
        "symforce",
        "import symforce\nsymforce.set_epsilon_to_number()\nimport numpy as np\n"
        "from symforce.geo.unsupported.pose3_se3 import Pose3_SE3\n" + _X
        + "Pose3_SE3.from_tangent(list(x)).to_homogenous_matrix().to_numpy()",
    ),
}  # fmt: skip


def cold_row(folder: Path, rounds: int) -> Row:
    """A process from its start to its end; the first is ours, SE(3), from the cache."""
    numba = folder / "cold_numba.py"
    numba.write_text((template_folder() / "bench_cold_numba.py").read_text(encoding="utf-8"), encoding="utf-8")
    cache = folder / "cache"
    cache.mkdir(mode=0o700)
    warm = {name: ["-c", _OURS.format(*group)] for name, group in _GROUPS.items()}
    cold = {name.replace("warm", "cold"): arguments for name, arguments in warm.items()}
    peers = {name: ["-c", code] for name, (_, code) in _PEERS.items()} | {"numba": [str(numba)]}
    needs = {name: module for name, (module, _) in _PEERS.items()} | {"numba": "numba"}
    skipped = {name: "not installed" for name, module in needs.items() if not _there(module)}
    programs = {**warm, **cold, **{name: each for name, each in peers.items() if name not in skipped}}
    environment = child_environment(LIE_CODEGEN_CACHE=str(cache))
    seen: dict[str, list[float]] = {name: [] for name in programs}
    for number in range(rounds + 1):
        for name, arguments in programs.items():
            if name in cold:
                _forget(cache)
            seconds = _seconds(arguments, environment)
            if number:
                seen[name].append(seconds * 1e9)
            if name in cold:  # the next warm start finds both groups again
                for each in warm.values():
                    _seconds(each, environment)
    return Row("cold start", "a process to its first exp", "ns", timings_of(seen), skipped)


_GROUPS = {"lie_codegen se3, warm": ("se3", 6), "lie_codegen so3, warm": ("so3", 3)}


def _there(module: str) -> bool:
    import importlib.util

    return importlib.util.find_spec(module) is not None


def _forget(cache: Path) -> None:
    """Everything but the extension, which is built once for a Python."""
    for file in (*cache.glob("entries/*/entry.json"), *cache.glob("requests/*.json")):
        file.unlink()


def _seconds(arguments: list[str], environment: dict[str, str]) -> float:
    """Processor time of the process and its children, compilers among them: on one core, what it takes on a quiet machine."""
    import resource  # Unix alone has it

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], env=environment, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
