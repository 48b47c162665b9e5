"""Averaging of periodic and feedback inputs, the Magnus series, order checks."""

from .averaged import average as average
from .order_check import order_check as order_check
