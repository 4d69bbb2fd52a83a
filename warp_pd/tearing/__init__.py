"""Tearing by a damage field: its energy, the way of its tips, cuts that are drawn, materials beyond their strength."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .tearing_energy import horizon_for_tears, length_for_tears, notes_on_criterion, stretch_or_energy
else:
    __getattr__ = lazy(__name__)

__all__ = ["horizon_for_tears", "length_for_tears", "notes_on_criterion", "stretch_or_energy"]
