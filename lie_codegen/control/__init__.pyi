"""Feedback: error functions, tracking and attitude laws, references, closed loops."""

from .attitude import attitude_linearisation as attitude_linearisation
from .attitude import attitude_region as attitude_region
from .attitude import cross_term_bound as cross_term_bound
from .attitude import gains_for_response as gains_for_response
from .attitude_law import attitude_law as attitude_law
from .certificate import Certificate as Certificate
from .certificate import certificate as certificate
from .closed_loop import ClosedLoop as ClosedLoop
from .closed_loop import closed_loop as closed_loop
from .closed_loop_package import generate_closed_loop as generate_closed_loop
from .compatibility import check_compatibility as check_compatibility
from .critical_points import critical_points as critical_points
from .error_catalogue import error_names as error_names
from .error_function import error_function as error_function
from .integral_law import integral_law as integral_law
from .invariance import invariance as invariance
from .law_file import read_law as read_law
from .linearisation import linear_loop as linear_loop
from .linearisation import rigid_gains as rigid_gains
from .reference_kernels import reference as reference
from .tracking_law import tracking_law as tracking_law
from .tracking_region import attitude_constants as attitude_constants
from .tracking_region import tracking_region as tracking_region
