"""Feedback: error functions, tracking and attitude laws, references, closed loops."""

from .attitude_law import attitude_law as attitude_law
from .closed_loop import closed_loop as closed_loop
from .closed_loop_package import generate_closed_loop as generate_closed_loop
from .error_function import error_function as error_function
from .integral_law import integral_law as integral_law
from .reference_kernels import reference as reference
from .tracking_law import tracking_law as tracking_law
