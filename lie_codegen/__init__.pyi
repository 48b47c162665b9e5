"""The front door, indexed by subject: `lc.NAME` for every public name.

Written by tests/tools/front_door.py from lie_codegen/SUBJECT/__init__.pyi; add names there.
"""

__version__: str

from . import averaging as averaging
from . import control as control
from . import errors as errors
from . import exact as exact
from . import flow as flow
from . import groups as groups
from . import kernel as kernel
from . import mechanics as mechanics
from . import pictures as pictures
from . import rigid_body as rigid_body
from . import signals as signals
from . import steering as steering
from . import studies as studies
from . import vehicles as vehicles

# averaging
from .averaging import VibrationLine as VibrationLine
from .averaging import areas as areas
from .averaging import average as average
from .averaging import averaged_kernels as averaged_kernels
from .averaging import connection as connection
from .averaging import convergence as convergence
from .averaging import corollary_bound as corollary_bound
from .averaging import corollary_check as corollary_check
from .averaging import example_connection as example_connection
from .averaging import feedback_average as feedback_average
from .averaging import floquet as floquet
from .averaging import gait as gait
from .averaging import line_drift as line_drift
from .averaging import magnus as magnus
from .averaging import moments as moments
from .averaging import order_check as order_check
from .averaging import oscillator_areas as oscillator_areas
from .averaging import oscillator_average as oscillator_average
from .averaging import phase_average as phase_average
from .averaging import point_mass_connection as point_mass_connection
from .averaging import spectral_drift as spectral_drift
from .averaging import time_average as time_average
from .averaging import wheel_input as wheel_input

# control
from .control import Certificate as Certificate
from .control import ClosedLoop as ClosedLoop
from .control import adaptive_law as adaptive_law
from .control import attitude_constants as attitude_constants
from .control import attitude_law as attitude_law
from .control import attitude_linearisation as attitude_linearisation
from .control import attitude_region as attitude_region
from .control import certificate as certificate
from .control import check_compatibility as check_compatibility
from .control import closed_loop as closed_loop
from .control import critical_points as critical_points
from .control import cross_term_bound as cross_term_bound
from .control import error_function as error_function
from .control import error_names as error_names
from .control import gains_for_response as gains_for_response
from .control import generate_closed_loop as generate_closed_loop
from .control import hybrid_law as hybrid_law
from .control import integral_law as integral_law
from .control import invariance as invariance
from .control import linear_loop as linear_loop
from .control import loop_margins as loop_margins
from .control import manifold as manifold
from .control import manifold_law as manifold_law
from .control import observer as observer
from .control import output_feedback_law as output_feedback_law
from .control import pointing_law as pointing_law
from .control import quaternion_law as quaternion_law
from .control import read_law as read_law
from .control import reference as reference
from .control import rigid_gains as rigid_gains
from .control import tracking_law as tracking_law
from .control import tracking_region as tracking_region

# exact
from .exact import Budget as Budget

# flow
from .flow import Event as Event
from .flow import Propagator as Propagator
from .flow import Trajectory as Trajectory
from .flow import distance as distance
from .flow import propagator as propagator
from .flow import second_kind as second_kind
from .flow import simulate as simulate

# groups
from .groups import MatrixGroup as MatrixGroup
from .groups import Uncertain as Uncertain
from .groups import build as build
from .groups import cartan_involution as cartan_involution
from .groups import change_of_basis as change_of_basis
from .groups import chart_domain as chart_domain
from .groups import chart_margin as chart_margin
from .groups import commutator_free_step as commutator_free_step
from .groups import controllability as controllability
from .groups import covariance_kernels as covariance_kernels
from .groups import device_source as device_source
from .groups import from_brackets as from_brackets
from .groups import from_matrices as from_matrices
from .groups import fuse as fuse
from .groups import generate as generate
from .groups import gradient as gradient
from .groups import group as group
from .groups import group_kernels as group_kernels
from .groups import group_names as group_names
from .groups import hessian as hessian
from .groups import interpolate as interpolate
from .groups import jacobian as jacobian
from .groups import jax_function as jax_function
from .groups import mean as mean
from .groups import nearest as nearest
from .groups import pauli as pauli
from .groups import product as product
from .groups import quaternion_from_rotation as quaternion_from_rotation
from .groups import rkmk4_step as rkmk4_step
from .groups import rotation_from_quaternion as rotation_from_quaternion
from .groups import semidirect as semidirect
from .groups import structure as structure
from .groups import tangent_from as tangent_from
from .groups import tangent_to as tangent_to
from .groups import torch_function as torch_function
from .groups import transition_step as transition_step
from .groups import wei_norman as wei_norman
from .groups import wei_norman_determinant as wei_norman_determinant
from .groups import wei_norman_order as wei_norman_order
from .groups import wei_norman_step as wei_norman_step
from .groups import with_quaternion as with_quaternion

# kernel
from .kernel import Kernel as Kernel
from .kernel import Port as Port
from .kernel import casadi_function as casadi_function
from .kernel import kernel_factory as kernel_factory
from .kernel import load as load

# mechanics
from .mechanics import MomentumWheels as MomentumWheels
from .mechanics import PointMassOscillator as PointMassOscillator
from .mechanics import accessibility_rank as accessibility_rank
from .mechanics import bracket_table as bracket_table
from .mechanics import design_feedback as design_feedback
from .mechanics import direction_observability as direction_observability
from .mechanics import driven_step as driven_step
from .mechanics import euler_poincare_kernel as euler_poincare_kernel
from .mechanics import feedback_kernels as feedback_kernels
from .mechanics import lagrangian_kernels as lagrangian_kernels
from .mechanics import lagrangian_system as lagrangian_system
from .mechanics import lagrangian_variational_step as lagrangian_variational_step
from .mechanics import linear_controllability as linear_controllability
from .mechanics import mechanical_system as mechanical_system
from .mechanics import relative_equilibria as relative_equilibria
from .mechanics import relative_equilibrium as relative_equilibrium
from .mechanics import routh_reduce as routh_reduce
from .mechanics import second_order_controllability as second_order_controllability
from .mechanics import simulate_driven as simulate_driven
from .mechanics import spatial_momentum_kernel as spatial_momentum_kernel
from .mechanics import symmetric_product as symmetric_product
from .mechanics import variational_step as variational_step
from .mechanics import vibration_feedback as vibration_feedback
from .mechanics import vibration_waveform as vibration_waveform
from .mechanics import vibrational_average as vibrational_average
from .mechanics import vibrational_fields as vibrational_fields
from .mechanics import vibrational_kernels as vibrational_kernels

# pictures
from .pictures import plot_loops as plot_loops
from .pictures import plot_plan as plot_plan
from .pictures import view as view
from .pictures import widget as widget

# rigid_body
from .rigid_body import coning_angles as coning_angles
from .rigid_body import coning_bounds as coning_bounds
from .rigid_body import elliptic_kernels as elliptic_kernels
from .rigid_body import euler_average as euler_average
from .rigid_body import euler_perturbation as euler_perturbation
from .rigid_body import explicit_inertia_change as explicit_inertia_change
from .rigid_body import free_rigid_body as free_rigid_body
from .rigid_body import free_rotation as free_rotation
from .rigid_body import inertia_from_masses as inertia_from_masses
from .rigid_body import limit_cycle_gains as limit_cycle_gains
from .rigid_body import limit_cycles as limit_cycles
from .rigid_body import modulus_squared as modulus_squared
from .rigid_body import momentum_directions as momentum_directions
from .rigid_body import moving_parts as moving_parts
from .rigid_body import plates as plates
from .rigid_body import principal_body as principal_body
from .rigid_body import slow_equilibria as slow_equilibria
from .rigid_body import solve_actual as solve_actual
from .rigid_body import solve_averaged as solve_averaged
from .rigid_body import torque as torque
from .rigid_body import tumbling_average as tumbling_average

# signals
from .signals import ParametricInput as ParametricInput
from .signals import PeriodicInput as PeriodicInput
from .signals import SampledInput as SampledInput

# steering
from .steering import Ball as Ball
from .steering import Box as Box
from .steering import Cone as Cone
from .steering import Coset as Coset
from .steering import Cylinder as Cylinder
from .steering import Plan as Plan
from .steering import Pointing as Pointing
from .steering import Position as Position
from .steering import Status as Status
from .steering import UpToPhase as UpToPhase
from .steering import kinetic_energy_metric as kinetic_energy_metric
from .steering import momentum_wheels as momentum_wheels
from .steering import mpc as mpc
from .steering import ocp as ocp
from .steering import qutip_evolution as qutip_evolution
from .steering import shooter as shooter
from .steering import steer as steer

# studies
from .studies import Choice as Choice
from .studies import Distribution as Distribution
from .studies import Engine as Engine
from .studies import Grid as Grid
from .studies import Joint as Joint
from .studies import LatinHypercube as LatinHypercube
from .studies import LogUniform as LogUniform
from .studies import Normal as Normal
from .studies import OnGroup as OnGroup
from .studies import Quantile as Quantile
from .studies import Run as Run
from .studies import Sobol as Sobol
from .studies import Study as Study
from .studies import Uniform as Uniform
from .studies import each as each
from .studies import open_study as open_study
from .studies import study as study
from .studies import study_from_file as study_from_file

# vehicles
from .vehicles import Potential as Potential
from .vehicles import UnderwaterVehicle as UnderwaterVehicle
from .vehicles import allocate as allocate
from .vehicles import allocation_kernel as allocation_kernel
from .vehicles import compensated as compensated
from .vehicles import damping_force as damping_force
from .vehicles import flat_reference as flat_reference
from .vehicles import manipulator_law as manipulator_law
from .vehicles import quadrotor_force as quadrotor_force
from .vehicles import quadrotor_law as quadrotor_law
from .vehicles import sphere_gain_bound as sphere_gain_bound
from .vehicles import sphere_law as sphere_law
from .vehicles import thruster_matrix as thruster_matrix
from .vehicles import underwater_forces as underwater_forces
from .vehicles import underwater_kernel as underwater_kernel
from .vehicles import underwater_vehicle as underwater_vehicle
