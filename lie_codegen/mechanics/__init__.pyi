"""Mechanical systems: connections, Lagrangians, Routh reduction, vibrational averages."""

from .lagrangian import lagrangian_system as lagrangian_system
from .routh import routh_reduce as routh_reduce
from .vibrational_average import vibrational_average as vibrational_average
