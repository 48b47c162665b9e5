"""The language of kernels: functions as records of inputs, outputs and a body."""

from .definition import kernel_factory as kernel_factory
from .kernel import Kernel as Kernel
from .kernel import Port as Port
from .saved import load as load
