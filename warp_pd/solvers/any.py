"""Any of the solvers of the package, for annotations."""

from .arc_length import ArcLength
from .explicit import Explicit
from .newton import Newton
from .relaxation import Relaxation

Solver = Explicit | Relaxation | Newton | ArcLength
