"""Steering: tasks, goals, constraints, plans and open optimal control."""

from .blocks import Box as Box
from .blocks import Cylinder as Cylinder
from .constraints import Ball as Ball
from .constraints import Cone as Cone
from .front import steer as steer
from .goals import Coset as Coset
from .goals import Pointing as Pointing
from .goals import Position as Position
from .goals import UpToPhase as UpToPhase
from .kinetic_metric import kinetic_energy_metric as kinetic_energy_metric
from .ocp.front import ocp as ocp
from .ocp.mpc import mpc as mpc
from .plan import Plan as Plan
from .plan import Status as Status
from .qutip_export import qutip_evolution as qutip_evolution
from .shooting.shooter import shooter as shooter
from .wheels.system import momentum_wheels as momentum_wheels
