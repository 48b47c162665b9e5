"""Averaging of periodic and feedback inputs, the Magnus series, order checks."""

from .actuated_inputs import oscillator_areas as oscillator_areas
from .actuated_inputs import oscillator_average as oscillator_average
from .actuated_inputs import wheel_input as wheel_input
from .areas import areas as areas
from .areas import moments as moments
from .averaged import average as average
from .convergence import convergence as convergence
from .corollary_bounds import corollary_bound as corollary_bound
from .corollary_bounds import corollary_check as corollary_check
from .feedback import feedback_average as feedback_average
from .floquet_orbit import floquet as floquet
from .gait_design import gait as gait
from .kernels import averaged_kernels as averaged_kernels
from .magnus import magnus as magnus
from .order_check import order_check as order_check
from .phase_system import phase_average as phase_average
from .point_masses import point_mass_connection as point_mass_connection
from .shape_connection import connection as connection
from .shape_examples import example_connection as example_connection
from .time_system import time_average as time_average
from .vibration_drift import VibrationLine as VibrationLine
from .vibration_drift import line_drift as line_drift
from .vibration_drift import spectral_drift as spectral_drift
