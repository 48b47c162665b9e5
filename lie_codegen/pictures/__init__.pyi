"""Pictures of plans, runs and averages."""

from .plot_loops import plot_loops as plot_loops
from .plot_plan import plot_plan as plot_plan
from .view import view as view
from .widget import widget as widget
