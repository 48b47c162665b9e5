"""Mechanical systems: connections, Lagrangians, Routh reduction, vibrational averages."""

from .accessibility import accessibility_rank as accessibility_rank
from .accessibility import direction_observability as direction_observability
from .accessibility import second_order_controllability as second_order_controllability
from .actuators import MomentumWheels as MomentumWheels
from .actuators import PointMassOscillator as PointMassOscillator
from .connection import symmetric_product as symmetric_product
from .driven import simulate_driven as simulate_driven
from .driven_step import driven_step as driven_step
from .kernels import euler_poincare_kernel as euler_poincare_kernel
from .kernels import spatial_momentum_kernel as spatial_momentum_kernel
from .lagrangian import lagrangian_system as lagrangian_system
from .mechanical_system import mechanical_system as mechanical_system
from .relative_equilibria import linear_controllability as linear_controllability
from .relative_equilibria import relative_equilibria as relative_equilibria
from .relative_equilibria import relative_equilibrium as relative_equilibrium
from .routh import routh_reduce as routh_reduce
from .variational_step import variational_step as variational_step
from .vibration_feedback import vibration_feedback as vibration_feedback
from .vibrational_average import vibrational_average as vibrational_average
from .vibrational_feedback import design_feedback as design_feedback
from .vibrational_fields import vibrational_fields as vibrational_fields
from .vibrational_kernels import lagrangian_kernels as lagrangian_kernels
from .vibrational_kernels import vibrational_kernels as vibrational_kernels
from .vibrational_law import feedback_kernels as feedback_kernels
