"""The free and the tumbling rigid body: elliptic functions, Euler averages."""

from .coning import coning_angles as coning_angles
from .coning import coning_bounds as coning_bounds
from .coning import modulus_squared as modulus_squared
from .elliptic_kernels import elliptic_kernels as elliptic_kernels
from .environment_torques import torque as torque
from .euler_average import euler_average as euler_average
from .euler_equilibria import limit_cycle_gains as limit_cycle_gains
from .euler_equilibria import limit_cycles as limit_cycles
from .euler_equilibria import momentum_directions as momentum_directions
from .euler_equilibria import slow_equilibria as slow_equilibria
from .euler_solutions import explicit_inertia_change as explicit_inertia_change
from .euler_solutions import solve_actual as solve_actual
from .euler_solutions import solve_averaged as solve_averaged
from .euler_variational import euler_perturbation as euler_perturbation
from .euler_variational import moving_parts as moving_parts
from .free_rigid_body import free_rigid_body as free_rigid_body
from .free_rotation import free_rotation as free_rotation
from .mass_points import inertia_from_masses as inertia_from_masses
from .plates import plates as plates
from .principal_body import principal_body as principal_body
from .tumbling_average import tumbling_average as tumbling_average
