"""Motion on a group: steps, simulation, charts that restart."""

from .events import Event as Event
from .simulate import simulate as simulate
