"""The front door, indexed by subject: `lc.NAME` for every public name.

Written by tests/tools/front_door.py from lie_codegen/SUBJECT/__init__.pyi; add names there.
"""

__version__: str

from . import averaging as averaging
from . import control as control
from . import errors as errors
from . import flow as flow
from . import groups as groups
from . import kernel as kernel
from . import mechanics as mechanics
from . import pictures as pictures
from . import rigid_body as rigid_body
from . import signals as signals
from . import steering as steering
from . import vehicles as vehicles

# averaging
from .averaging import average as average
from .averaging import order_check as order_check

# control
from .control import attitude_law as attitude_law
from .control import closed_loop as closed_loop
from .control import error_function as error_function
from .control import generate_closed_loop as generate_closed_loop
from .control import integral_law as integral_law
from .control import reference as reference
from .control import tracking_law as tracking_law

# flow
from .flow import Event as Event
from .flow import simulate as simulate

# groups
from .groups import MatrixGroup as MatrixGroup
from .groups import Uncertain as Uncertain
from .groups import build as build
from .groups import cartan_involution as cartan_involution
from .groups import change_of_basis as change_of_basis
from .groups import chart_domain as chart_domain
from .groups import controllability as controllability
from .groups import covariance_kernels as covariance_kernels
from .groups import from_brackets as from_brackets
from .groups import from_matrices as from_matrices
from .groups import fuse as fuse
from .groups import generate as generate
from .groups import group as group
from .groups import group_kernels as group_kernels
from .groups import group_names as group_names
from .groups import interpolate as interpolate
from .groups import mean as mean
from .groups import nearest as nearest
from .groups import pauli as pauli
from .groups import product as product
from .groups import quaternion_from_rotation as quaternion_from_rotation
from .groups import rotation_from_quaternion as rotation_from_quaternion
from .groups import semidirect as semidirect
from .groups import structure as structure
from .groups import tangent_from as tangent_from
from .groups import tangent_to as tangent_to
from .groups import wei_norman as wei_norman
from .groups import wei_norman_order as wei_norman_order

# kernel
from .kernel import Kernel as Kernel
from .kernel import Port as Port
from .kernel import kernel_factory as kernel_factory

# mechanics
from .mechanics import lagrangian_system as lagrangian_system
from .mechanics import routh_reduce as routh_reduce
from .mechanics import vibrational_average as vibrational_average

# pictures
from .pictures import plot_plan as plot_plan

# rigid_body
from .rigid_body import elliptic_kernels as elliptic_kernels
from .rigid_body import euler_average as euler_average
from .rigid_body import free_rigid_body as free_rigid_body

# signals
from .signals import PeriodicInput as PeriodicInput
from .signals import SampledInput as SampledInput

# steering
from .steering import Ball as Ball
from .steering import Cone as Cone
from .steering import Coset as Coset
from .steering import Pointing as Pointing
from .steering import Position as Position
from .steering import UpToPhase as UpToPhase
from .steering import mpc as mpc
from .steering import ocp as ocp
from .steering import qutip_evolution as qutip_evolution
from .steering import steer as steer

# vehicles
