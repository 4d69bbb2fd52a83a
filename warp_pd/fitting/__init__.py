"""Constants of a material from tests, through the simulation. See docs/fitting.md."""

from .probes import Deflection, PointField, Probe, Reaction
from .sensitivity import Sensitivity, sensitivity

__all__ = ["Deflection", "PointField", "Probe", "Reaction", "Sensitivity", "sensitivity"]
