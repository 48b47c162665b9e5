"""Exact numbers and formulas, and how much work they may ask for."""

from .budget import Budget as Budget
