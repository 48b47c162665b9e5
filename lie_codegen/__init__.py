"""lie_codegen: from a Lie algebra to fast C.

The names of the front door stand in __init__.pyi, by subject; each is imported when first used, so that calling
compiled functions imports neither SymPy nor CasADi.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]
