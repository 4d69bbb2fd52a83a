"""Contact of the sheet with rigid bodies and with itself, and how bodies move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..device.lazy import lazy
from ..run import PARTS

if TYPE_CHECKING:
    from ..interfaces import Part
    from ..run.scene import Scene
    from .body_shapes import BodyShape
else:
    __getattr__ = lazy(__name__)

__all__ = ["BodyShape"]


def _inclusions(scene: Scene) -> Sequence[Part]:
    if not scene.sheet.inclusions:
        return ()
    from .rigid_inclusions import inclusions_of

    constraints = [c for load in scene.loads for c in load.constraints(scene.sheet)]
    return inclusions_of(scene.sheet, constraints, scene.initial("initial_velocity"))


PARTS.append(_inclusions)
