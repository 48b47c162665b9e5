"""The free and the tumbling rigid body: elliptic functions, Euler averages."""

from .elliptic_kernels import elliptic_kernels as elliptic_kernels
from .euler_average import euler_average as euler_average
from .free_rigid_body import free_rigid_body as free_rigid_body
