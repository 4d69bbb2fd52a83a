"""The parts of a scene: supports, loads, contact, rupture. Each file has the user's class and its built counterpart.

`warp_pd` offers the parts themselves; here are the base classes of your own parts, and what scenes share.
"""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from ..contact.body_shapes import BodyShape
    from ..gas.enclosed import BuiltEnclosed, Enclosed
    from ..tearing.scene_rupture import horizon_for_tears, length_for_tears, notes_on_criterion, stretch_or_energy
    from .rupture import BondCriterion
    from .supports import stretching_edges
else:
    __getattr__ = lazy(__name__)

__all__ = [
    "BodyShape",
    "BondCriterion",
    "BuiltEnclosed",
    "Enclosed",
    "horizon_for_tears",
    "length_for_tears",
    "notes_on_criterion",
    "stretch_or_energy",
    "stretching_edges",
]
