"""Force laws, which map displacements to forces, one file per law. interfaces/law.py defines their interface."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from ..papers.by_name import force_law, point_areas
else:
    __getattr__ = lazy(__name__)

__all__ = ["force_law", "point_areas"]
