"""Peridynamics of thin rubber sheets, on NVIDIA Warp.

    from warp_pd import Sheet, Simulation, BondAssociated, NeoHookean, Explicit, Fixed, RigidBall, CriticalStretch

See README.md and the files in `scenes/`, which are meant to be read and changed.
"""

from .bond_neo_hookean import BondNeoHookean
from .checks import InputError
from .contact import RigidBall
from .damage import CriticalEnergy, CriticalStretch
from .forces import BondAssociated, BondBased, HyperelasticBonds, Neural, Nodal, Visco, ViscoBondBased
from .frame import Frame, Surface
from .loads import BodyForce, BoundaryForce, Fixed, Motion, PointForce, Pressure
from .materials import (
    ArrudaBoyce,
    Bimodular,
    Gent,
    Incompressible,
    Material,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    PairwiseMaterial,
    Prony,
    Yeoh,
)
from .runner import Result
from .sheet import Sheet
from .simulation import Built, Measure, Outcome, Simulation
from .solvers import Explicit, Newton, Relaxation

__version__ = "0.1.0"

__all__ = [
    "ArrudaBoyce",
    "Bimodular",
    "BodyForce",
    "BondAssociated",
    "BondBased",
    "BondNeoHookean",
    "BoundaryForce",
    "Built",
    "CriticalEnergy",
    "CriticalStretch",
    "Explicit",
    "Fixed",
    "Frame",
    "Gent",
    "HyperelasticBonds",
    "Incompressible",
    "InputError",
    "Material",
    "Measure",
    "MooneyRivlin",
    "Motion",
    "NeoHookean",
    "Neural",
    "Newton",
    "Nodal",
    "Ogden",
    "Outcome",
    "PairwiseMaterial",
    "PointForce",
    "Pressure",
    "Prony",
    "Relaxation",
    "Result",
    "RigidBall",
    "Sheet",
    "Simulation",
    "Surface",
    "Visco",
    "ViscoBondBased",
    "Yeoh",
]
