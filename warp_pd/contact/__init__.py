"""Contact of the sheet with rigid bodies and with itself, and how bodies move."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .body_shapes import BodyShape
else:
    __getattr__ = lazy(__name__)

__all__ = ["BodyShape"]
