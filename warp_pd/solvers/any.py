"""Any of the solvers of the package, for annotations."""

from .explicit import Explicit
from .newton import Newton
from .relaxation import Relaxation

Solver = Explicit | Relaxation | Newton
