"""Every error the package raises on purpose.

Two families: `InputError` (what was given is wrong; the command line exits with status 2) and
`ComputationError` (the input was right, and the computation failed or the system refused; exit status 1). A message says
what is wrong, where, and how to mend it.
"""

from __future__ import annotations

import errno
from typing import Any

#: Characters of a message that are shown: what was given may be quoted in it, whatever its length.
_SHOWN = 6000


class LieCodegenError(Exception):
    """Base of all errors of this package."""

    def __str__(self) -> str:
        text = super().__str__()
        return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


class InputError(LieCodegenError, ValueError):
    """What the caller gave is wrong; nothing was written."""


class ArgumentError(InputError, TypeError):
    """An argument of a kind that the function is not made for; names the function, with what failed inside as its cause."""


class ExpressionError(InputError):
    """A text is not in the closed grammar of numbers and formulas; names the column."""


class GroupFileError(InputError):
    """A group file cannot be used; names the file, the key and, in an entry, the column."""


class IdentifierError(InputError):
    """A name cannot be a C identifier, or is a keyword of C or C++."""


class ShapeError(InputError):
    """An array has the wrong shape or type of entry; names the argument."""


class NotFiniteError(InputError):
    """An argument holds NaN or infinity; names the argument."""


class AlgebraError(InputError):
    """The definition is not a Lie algebra."""


class NotClosedError(AlgebraError):
    """A commutator leaves the span of the basis; names the pair."""


class DependentBasisError(AlgebraError):
    """The basis matrices are linearly dependent; names the relation."""


class JacobiError(AlgebraError):
    """The Jacobi identity fails; names the triple."""


class UnknownGroupError(InputError):
    """No group of that name in the catalogue, and no such file."""


class NotInAlgebraError(InputError):
    """A matrix is not in the Lie algebra; says how far off it is."""


class NotOnGroupError(InputError):
    """A matrix is not on the group; says how far off it is."""


class UncontrollableError(InputError):
    """The controls do not generate the algebra; carries the growth vector."""


class SteeringInputError(InputError):
    """A steering task that cannot be posed as given; says what to do instead."""


class OutputFolderError(InputError):
    """A folder cannot be written, or holds files that are not ours."""


class CodegenError(InputError):
    """A kernel cannot become C as it is written; names the operation or the symbol."""


class IncompatibleError(InputError):
    """An error function and a transport map do not satisfy (A2); carries the residual."""


class ComputationError(LieCodegenError, RuntimeError):
    """The input was right and the computation failed."""


class CompileError(ComputationError):
    """The C compiler failed; carries the command and what it printed."""


class ChartError(ComputationError):
    """Wei-Norman coordinates reached the edge of their chart; names the time."""


class SteeringError(ComputationError):
    """The solver found no admissible manoeuvre; says what was tried, and proves nothing.

    Attributes:
        best: the nearest plan, or None.
        violation: {name: by how much it misses}, or None.
    """

    def __init__(self, message: str = "", *, best: Any = None, violation: Any = None) -> None:
        super().__init__(message)
        self.best = best
        self.violation = violation


class InfeasibleError(SteeringError):
    """No controls within the bounds reach the goal in the time, or an obstacle holds a state that is prescribed: proved.

    Attributes:
        certificate: the proof, with what is needed and the most there can be.
    """

    def __init__(self, message: str = "", *, certificate: Any = None) -> None:
        super().__init__(message)
        self.certificate = certificate


class CompilerStoppedError(CompileError):
    """The compiler was stopped (killed, out of time, memory or processes): nothing is wrong with the text, and later it may work."""


class MissingDependencyError(ComputationError):
    """An optional package is not installed; names the extra that brings it."""


class SystemRefusalError(ComputationError):
    """The system refuses a file, a process or memory; names the function, with the system's error as its cause."""


class SubinterpreterError(ComputationError):
    """Another interpreter than the first of the process asks: NumPy serves the first alone; use processes or threads."""


#: What no other name of a file mends: a full disk, a quota, a device that fails, no memory, no more files.
_OF_THE_SYSTEM = {errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE}


def write_refusal(what: str, error: OSError) -> LieCodegenError:
    """The error of a file or folder that cannot be written: the caller's choice of it (status 2), or the system that is out of something (1)."""
    kind = SystemRefusalError if error.errno in _OF_THE_SYSTEM else OutputFolderError
    return kind(f"{what}: {error.strerror or error}")


class CacheError(ComputationError):
    """No folder could be found to build in; says which were tried."""


class NoCompilerWarning(UserWarning):
    """No C compiler was found: kernels are interpreted, with the same results, more slowly."""


class CompilerWarning(UserWarning):
    """A C compiler that was asked for cannot be used; names it, and the next is tried."""


class DegradedWarning(UserWarning):
    """Calls or batches are slower than they could be in this process; says why, and the results are the same."""


class CacheWarning(UserWarning):
    """The cache folder cannot be used; what is built lives in a private temporary folder."""


class InertiaWarning(UserWarning):
    """An inertia that is a legal metric and belongs to no rigid body: the triangle inequality fails."""


class PeriodError(InputError):
    """An input is not periodic, or not with that period; names the component and offers the common period."""


class AssumptionError(InputError):
    """A condition of a theorem fails; names the theorem, the condition and what holds instead."""


class AssumptionWarning(UserWarning):
    """A theorem is used where one of its conditions fails; names both."""


class SpreadWarning(UserWarning):
    """A covariance so wide that its Gaussian passes the cut of the logarithm."""


class SlowWarning(UserWarning):
    """Python is called in a loop that could be compiled."""
