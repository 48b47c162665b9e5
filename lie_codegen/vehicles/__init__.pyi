"""Vehicles and bodies: quadrotor, underwater vehicle, sphere, manipulator, actuator allocation."""

from .allocation import allocate as allocate
from .allocation import thruster_matrix as thruster_matrix
from .allocation_kernels import allocation_kernel as allocation_kernel
from .manipulator import manipulator_law as manipulator_law
from .potential import Potential as Potential
from .potential import damping_force as damping_force
from .quadrotor import flat_reference as flat_reference
from .quadrotor import quadrotor_force as quadrotor_force
from .quadrotor import quadrotor_law as quadrotor_law
from .sphere import sphere_gain_bound as sphere_gain_bound
from .sphere import sphere_law as sphere_law
from .underwater import UnderwaterVehicle as UnderwaterVehicle
from .underwater import compensated as compensated
from .underwater import underwater_forces as underwater_forces
from .underwater import underwater_kernel as underwater_kernel
from .underwater import underwater_vehicle as underwater_vehicle
