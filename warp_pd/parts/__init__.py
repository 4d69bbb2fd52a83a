"""The parts of a scene: supports, loads, contact, rupture. Each file holds what users write and what it builds."""

from .boundary_force import BoundaryForce
from .contact import RigidBall, RigidContact
from .enclosed import Enclosed, EnclosedGas, EnclosedVolume
from .loads import BodyForce, PointForce, Pressure
from .rupture import BondCriterion, CriticalEnergy, CriticalStretch
from .self_contact import SelfContact
from .supports import Fixed, Motion, stretching_edges
from .tearing_energy import TearingEnergy, stretch_or_energy, tip_width

__all__ = [
    "BodyForce",
    "BondCriterion",
    "BoundaryForce",
    "CriticalEnergy",
    "CriticalStretch",
    "Enclosed",
    "EnclosedGas",
    "EnclosedVolume",
    "Fixed",
    "Motion",
    "PointForce",
    "Pressure",
    "RigidBall",
    "RigidContact",
    "SelfContact",
    "TearingEnergy",
    "stretch_or_energy",
    "stretching_edges",
    "tip_width",
]
