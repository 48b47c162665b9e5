"""When a study may end early: once a quantile is known narrowly enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.kernel.saved import Saved


@dataclass(frozen=True, eq=False, repr=False)
class Quantile(Saved):
    """Stop when the confidence interval of a quantile of an output is narrower than `width`.

    The interval lies between two order statistics (Conover, Practical Nonparametric Statistics, section 3.2): the number of samples below
    the quantile q is binomial(n, q), whatever the distribution; nothing is assumed of the output. It is looked at after each
    chunk in the order of the samples, so that the same samples are taken whatever the workers. The confidence is that of one
    look: a study that looks k times and stops at the first narrow interval covers a little less.

    Attributes:
        output: a number a sample.
        q: the quantile, in (0, 1).
        width: of the interval, in the unit of the output.
        confidence: .95 if not given.

    Raises:
        InputError: an output that is no name, or a number outside its range.
    """

    output: str
    q: float
    width: float
    confidence: float = 0.95

    def __post_init__(self) -> None:
        if not isinstance(self.output, str):
            raise InputError("Quantile: output is the name of an output")
        for name, low, high in (("q", 0.0, 1.0), ("confidence", 0.0, 1.0), ("width", 0.0, np.inf)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not low < value < high:
                raise InputError(f"Quantile: {name} lies between {low:g} and {high:g}, given {value!r}")

    def interval(self, values: Array) -> tuple[float, float]:
        """The confidence interval; infinite where the samples are too few.

        Args:
            values: (n,) of the output, one a sample; NaN does not count.
        """
        from scipy.stats import binom

        ordered = np.sort(values[~np.isnan(values)])
        tail = (1 - self.confidence) / 2
        low = int(binom.ppf(tail, len(ordered), self.q)) - 1 if len(ordered) else -1
        high = int(binom.ppf(1 - tail, len(ordered), self.q)) if len(ordered) else 0
        return (
            float(ordered[low]) if low >= 0 else -np.inf,
            float(ordered[high]) if high < len(ordered) else np.inf,
        )

    def met(self, values: Array) -> bool:
        """Whether the interval is narrow enough.

        Args:
            values: (n,) of the output, one a sample; NaN does not count.
        """
        low, high = self.interval(values)
        return high - low <= self.width
