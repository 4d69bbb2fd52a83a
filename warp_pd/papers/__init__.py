"""The force laws of the papers beside the bond-associated one, and what belongs to them."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .by_name import force_law, point_areas
else:
    __getattr__ = lazy(__name__)

__all__ = ["force_law", "point_areas"]
