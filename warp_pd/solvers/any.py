"""Type alias for any solver of the package."""

from .arc_length import ArcLength
from .explicit import Explicit
from .newton import Newton
from .relaxation import Relaxation

Solver = Explicit | Relaxation | Newton | ArcLength
