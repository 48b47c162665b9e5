"""Inputs as functions of time: periodic, sampled, piecewise, from text.

The public names stand in __init__.pyi; each is imported when first used.
"""

from lie_codegen import door

__getattr__, __dir__, __all__ = door.attach(__name__, __file__)
