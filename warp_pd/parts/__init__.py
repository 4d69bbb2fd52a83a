"""The parts of a scene: supports, loads, rupture. Each file has the user's class and its built counterpart.

`warp_pd` offers the parts themselves; here are the base classes of your own parts, and what scenes share.
"""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .rupture import BondCriterion
    from .supports import stretching_edges
else:
    __getattr__ = lazy(__name__)

__all__ = [
    "BondCriterion",
    "stretching_edges",
]
