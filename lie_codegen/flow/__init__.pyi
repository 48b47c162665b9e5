"""Motion on a group: steps, simulation, charts that restart."""

from .events import Event as Event
from .logarithm import distance as distance
from .propagator import Propagator as Propagator
from .propagator import propagator as propagator
from .second_kind_coordinates import second_kind as second_kind
from .simulate import simulate as simulate
from .trajectory import Trajectory as Trajectory
