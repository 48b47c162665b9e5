"""Finding a C compiler and turning C text into a shared library.

The ladder: $LIE_CODEGEN_CC, $CC, cc, gcc, clang, then `python -m ziglang cc` if that wheel is installed.
LIE_CODEGEN_CC=none stops the search; $LIE_CODEGEN_CFLAGS are flags after ours. Microsoft's compiler is out of scope: its command line is
another; on Windows install the zig extra.
"""

from __future__ import annotations

import contextlib
import errno
import importlib.util
import os
import shlex
import shutil
import signal
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from lie_codegen.door import warn_caller
from lie_codegen.errors import CompileError, CompilerStoppedError, CompilerWarning, NoCompilerWarning

#: -ffp-contract=off: the same numbers as the interpreter; never -ffast-math, which changes the whole process.
#: No automatic vectorising: gcc 12.2 fuses multiply and add in it in spite of -ffp-contract=off (measured).
FLAGS = (
    "-std=c99",
    "-fno-math-errno",
    "-fno-semantic-interposition",
    "-ffp-contract=off",
    "-fno-tree-vectorize",
    "-fno-tree-slp-vectorize",
    "-fPIC",
    "-shared",
)
NATIVE = "-march=native"
#: Above this many statements in one kernel -O2 compiles a quarter longer than -O1 and gains nothing (measured with gcc 12 on
#: kernels of su3, sp4, su4 and so6: 600 to 3,000 statements run 1 to 5 % slower with -O1, 5,900 to 20,500 equally fast).
LARGE = 5_000
#: Statements between which lanes are compiled with gcc's first scheduling, by the registers that are left: without it values of a long body
#: wait in memory for lack of registers, and without an eye on these it takes what it gains (measured with gcc 12: a loop's step, 1,660
#: statements, takes .85 of the time with AVX2 and .89 with AVX-512; the tracking law of SE(3), 830, 1.0 and .94, and 1.27 and 1.07 without
#: the eye; 3,500 would compile 2.6 times as long). clang knows neither.
SCHEDULED = (400, 2_000)
_SCHEDULING = ("-fschedule-insns", "-fsched-pressure")
#: Seconds that a compiler is given unless LIE_CODEGEN_COMPILE_SECONDS says otherwise; the longest kernel of the tests takes thirty.
_PATIENCE = 600.0
#: What gcc and clang print when the system ended a part of them.
_STOPPED = (
    "Killed",
    "Terminated",
    "virtual memory exhausted",
    "out of memory",
    "Cannot allocate memory",
    "Resource temporarily",
)
#: Where gcc and clang look for headers, libraries and their own parts; what Apple's builds for.
_CHANGE_IT = (
    "CPATH",
    "C_INCLUDE_PATH",
    "COMPILER_PATH",
    "GCC_EXEC_PREFIX",
    "LIBRARY_PATH",
    "SDKROOT",
    "MACOSX_DEPLOYMENT_TARGET",
)
#: Programs that take a compiler's name and run it.
_KEEPERS = {"ccache", "sccache", "distcc", "icecc"}


@dataclass(frozen=True)
class Compiler:
    """A compiler that was found.

    Attributes:
        command: program and leading arguments.
        identity: the command, the program's real path, its size and time of change, the further flags, the variables that change
            what it does; changes when the compiler is upgraded, and costs a process only of a script, which is asked for its version.
        further: flags after ours, from $LIE_CODEGEN_CFLAGS.
    """

    command: tuple[str, ...]
    identity: str
    further: tuple[str, ...] = ()


def find_compilers(environment: Mapping[str, str] | None = None) -> tuple[Compiler, ...]:
    """The compilers of the ladder that exist, best first; empty when there is none."""
    variables = os.environ if environment is None else environment
    if variables.get("LIE_CODEGEN_CC", "").strip().lower() == "none":
        return ()
    found: dict[str, Compiler] = {}
    asked, further = _asked(variables), _words(variables, "LIE_CODEGEN_CFLAGS")
    for command in _ladder(variables):
        program = shutil.which(command[0], path=variables.get("PATH", ""))
        if program is None:
            if command in asked:
                warn_passed_over(shlex.join(command), "there is no such program (see $LIE_CODEGEN_CC, $CC)")
            continue
        extra = command[1:] if command[1:2] != ("-m",) else ()
        real = _zig_program() if command[1:2] == ("-m",) else os.path.realpath(program)
        identity = _identity((*command, *further), real, variables)
        found.setdefault(" ".join((real, *extra)), Compiler((program, *command[1:]), identity, further))
    return tuple(found.values())


@cache
def warn_no_compiler() -> None:
    """Say once a process that kernels will be interpreted."""
    warn_caller(
        "no C compiler found ($CC, cc, gcc, clang, the ziglang package): kernels are interpreted, with the same "
        "results, more slowly. Install a compiler, or: pip install 'lie_codegen[zig]'",
        NoCompilerWarning,
    )


@cache
def warn_passed_over(command: str, why: str) -> None:
    """Say once a process that a compiler is passed over; it may be the user's own choice, in $CC."""
    warn_caller(f"the C compiler {command!r} is passed over, {why}; the next is tried", CompilerWarning)


def flags_for(statements: int, *, fused: bool = False) -> tuple[str, ...]:
    """The flags for a unit whose longest kernel has that many statements; `fused`: multiplications and additions may become one."""
    contraction = ("-ffp-contract=fast",) if fused else ()
    return ("-O1" if statements > LARGE else "-O2", NATIVE, *FLAGS, *contraction)


def lane_flags(statements: int, *, fused: bool = False) -> tuple[str, ...]:
    """The flags for the lanes of such a unit."""
    least, most = SCHEDULED
    return (*flags_for(statements, fused=fused), *(_SCHEDULING if least <= statements <= most else ()))


def compile_library(compiler: Compiler, folder: Path, main: str, output: str, flags: tuple[str, ...]) -> None:
    """Compile `folder/main` to the shared library `folder/output`.

    A compiler that does not know how to schedule, or -march=native, is asked again without.

    Raises:
        CompileError: with the command and what the compiler printed.
        CompilerStoppedError: it was killed, or took longer than `compile_seconds`.
        OSError: there is no space left on the disk.
    """
    attempts = [flags]
    for foreign in (_SCHEDULING, (NATIVE,)):
        fewer = tuple(flag for flag in attempts[-1] if flag not in foreign)
        if fewer != attempts[-1]:
            attempts.append(fewer)
    failures = []
    for attempt in attempts:
        command = (*compiler.command, *attempt, *compiler.further, "-o", output, main, "-lm")
        status, printed = _run(command, folder)
        if status == 0 and (folder / output).is_file():
            return
        if os.strerror(errno.ENOSPC) in printed:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        report = f"{shlex.join(command)}\nexit status {status}\n{printed[-4000:].strip()}"
        # A negative status is a signal to the compiler's driver; its parts are killed alone, and then it says so.
        if status < 0 or any(words in printed for words in _STOPPED):
            raise CompilerStoppedError("the C compiler was stopped (too little memory?):\n" + report)
        failures.append(report)
    raise CompileError("the C compiler failed:\n" + failures[-1])


def compile_seconds() -> float:
    """How long a compiler may take: LIE_CODEGEN_COMPILE_SECONDS, else ten minutes."""
    try:
        seconds = float(os.environ.get("LIE_CODEGEN_COMPILE_SECONDS", ""))
    except ValueError:
        return _PATIENCE
    return seconds if seconds > 0 else _PATIENCE


def _run(command: tuple[str, ...], folder: Path) -> tuple[int, str]:
    """(exit status, what it printed), in a session of its own, so that a late compiler is ended with all its parts."""
    import subprocess  # not needed where the cache has the answer

    try:
        with subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=_quiet_environment(folder),
            start_new_session=True,
        ) as running:
            try:
                _, printed = running.communicate(timeout=compile_seconds())
            except BaseException as stopped:
                _end(running)
                if isinstance(stopped, subprocess.TimeoutExpired):
                    raise CompilerStoppedError(
                        f"the C compiler gave no answer in {compile_seconds():g} s: {shlex.join(command)}; "
                        "LIE_CODEGEN_COMPILE_SECONDS allows it more"
                    ) from None
                raise
    except OSError as error:
        raise CompilerStoppedError(f"cannot run {shlex.join(command)}: {error}") from error
    return running.returncode, printed.decode(errors="replace")


def _end(running: Any) -> None:
    with contextlib.suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(running.pid, signal.SIGKILL)
        else:
            running.kill()


def is_working(compiler: Compiler, folder: Path) -> bool:
    """Whether it compiles the smallest program; asked only after a failure, to tell whose fault it was."""
    (folder / "probe.c").write_text("int lie_codegen_probe(void);\nint lie_codegen_probe(void) { return 0; }\n")
    try:
        compile_library(compiler, folder, "probe.c", "probe.so", flags_for(0))
    except CompileError:
        return False
    return True


def _asked(variables: Mapping[str, str]) -> tuple[tuple[str, ...], ...]:
    """The commands that the user asks for."""
    commands = (_words(variables, name) for name in ("LIE_CODEGEN_CC", "CC"))
    return tuple(words for words in commands if words)


def _words(variables: Mapping[str, str], name: str) -> tuple[str, ...]:
    """A variable as a shell would split it; nothing where its quotes do not close."""
    try:
        return tuple(shlex.split(variables.get(name, "")))
    except ValueError:
        return ()


def _ladder(variables: Mapping[str, str]) -> Iterator[tuple[str, ...]]:
    yield from _asked(variables)
    yield from (("cc",), ("gcc",), ("clang",))
    if sys.executable and importlib.util.find_spec("ziglang") is not None:
        yield (sys.executable, "-m", "ziglang", "cc")


def _zig_program() -> str:
    spec = importlib.util.find_spec("ziglang")
    return os.path.realpath(spec.origin) if spec is not None and spec.origin else "ziglang"


def _identity(command: tuple[str, ...], real: str, variables: Mapping[str, str]) -> str:
    words = [*command, real, *(f"{name}={variables[name]}" for name in _CHANGE_IT if variables.get(name))]
    with contextlib.suppress(OSError):
        status = os.stat(real)
        words += [str(status.st_size), str(status.st_mtime_ns)]
        if _runs_another(real):
            words.append(_words_of(command, status.st_size, status.st_mtime_ns))
    return " ".join(words)


def _runs_another(real: str) -> bool:
    """Whether it is a script, or keeps what another compiler made: it stays what it is while that one is upgraded."""
    if Path(real).stem in _KEEPERS:
        return True
    try:
        with open(real, "rb") as file:
            return file.read(2) == b"#!"
    except OSError:
        return False


@cache
def _words_of(command: tuple[str, ...], size: int, changed: int) -> str:
    """What `command --version` prints; nothing where it does not answer soon. Size and time are of the program, for the memo."""
    import subprocess

    try:
        done = subprocess.run(
            [*command, "--version"], stdin=subprocess.DEVNULL, capture_output=True, timeout=min(compile_seconds(), 5.0)
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.decode(errors="replace").strip()


def _quiet_environment(folder: Path) -> dict[str, str]:
    """Messages in English; intermediate files beside the text, so that one disk alone must have room."""
    return {**os.environ, "LC_ALL": "C", "TMPDIR": str(folder)}
