"""Inputs as functions of time: periodic, sampled, piecewise, from text."""

from .parametric_input import ParametricInput as ParametricInput
from .periodic_input import PeriodicInput as PeriodicInput
from .sampled_input import SampledInput as SampledInput
