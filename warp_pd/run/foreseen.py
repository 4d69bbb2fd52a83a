"""What can be told about a run before it begins."""

from __future__ import annotations

from ..materials import stability_notes
from .built import Built


def foreseen(built: Built) -> list[str]:
    """Notes on a scene, one line each."""
    material = getattr(built.simulation.force, "material", None)
    return [] if material is None else stability_notes(material)
