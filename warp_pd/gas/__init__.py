"""Gas and volumes that a sheet encloses."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .enclosed import BuiltEnclosed, Enclosed
else:
    __getattr__ = lazy(__name__)

__all__ = ["BuiltEnclosed", "Enclosed"]
