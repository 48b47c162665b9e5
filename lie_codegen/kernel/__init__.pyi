"""The language of kernels: functions as records of inputs, outputs and a body."""

from .casadi_function import casadi_function as casadi_function
from .definition import kernel_factory as kernel_factory
from .kernel import Kernel as Kernel
from .kernel import Port as Port
from .saved import load as load
