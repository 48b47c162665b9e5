"""Monte Carlo studies and sweeps."""

from .designs import LatinHypercube as LatinHypercube
from .designs import Sobol as Sobol
from .distributions import Choice as Choice
from .distributions import Distribution as Distribution
from .distributions import Grid as Grid
from .distributions import Joint as Joint
from .distributions import LogUniform as LogUniform
from .distributions import Normal as Normal
from .distributions import Uniform as Uniform
from .engines import Engine as Engine
from .on_group import OnGroup as OnGroup
from .result import Study as Study
from .results import each as each
from .stopping import Quantile as Quantile
from .study import open_study as open_study
from .study import study as study
from .study_file import study_from_file as study_from_file
from .tasks import Run as Run
