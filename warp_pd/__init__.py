"""Peridynamics of thin rubber sheets on NVIDIA Warp.

    from warp_pd import Sheet, Simulation, BondAssociated, NeoHookean, Explicit, Fixed, RigidBall, CriticalStretch

See README.md and the examples in `scenes/`, which are meant to be read and modified.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from .device.lazy import lazy
from .device.version import __version__ as __version__

if TYPE_CHECKING:
    from .device.checks import InputError
    from .geometry.curves import Circle, Polygon, Spline
    from .geometry.files import read_mesh
    from .geometry.pieces import Place
    from .geometry.sheet import Sheet
    from .geometry.svg import read_outline
    from .geometry.together import glued, placed, together
    from .interfaces.frame import Frame, Surface
    from .laws.bond_associated import BondAssociated
    from .laws.bond_based import BondBased
    from .laws.hyperelastic_bonds import HyperelasticBonds
    from .laws.neural.law import Neural
    from .laws.nodal import Nodal
    from .laws.visco import Visco
    from .laws.visco_bonds import ViscoBondBased
    from .materials import (
        ArrudaBoyce,
        Bimodular,
        ByRegion,
        Gent,
        Incompressible,
        Material,
        Maxwell,
        MooneyRivlin,
        NeoHookean,
        Ogden,
        PairwiseMaterial,
        Prony,
        TensionField,
        Yeoh,
    )
    from .materials.bond_neo_hookean import BondNeoHookean
    from .output.frames import Frames, SavedFrame
    from .output.sheet_plot import draw_sheet
    from .parts.bodies import RigidBody
    from .parts.body_mesh import TriangleMesh
    from .parts.body_motion import BodyPath, Free
    from .parts.body_shapes import Box, Capsule, Cylinder, Plane, Sphere
    from .parts.boundary_force import BoundaryForce
    from .parts.enclosed import EnclosedGas, EnclosedVolume
    from .parts.joint import Joint
    from .parts.loads import BodyForce, PointForce, Pressure
    from .parts.newton_world import newton_bodies
    from .parts.point_values import ValuesInTime
    from .parts.reaction import Reaction
    from .parts.rigid_ball import RigidBall
    from .parts.rupture import CriticalEnergy, CriticalStretch
    from .parts.self_contact import SelfContact
    from .parts.supports import Fixed, Motion
    from .parts.tearing_energy import TearingEnergy
    from .run.built import Built
    from .run.result import Result
    from .run.scene import Measure, Outcome
    from .run.simulation import Simulation
    from .solvers.explicit import Explicit
    from .solvers.newton import Newton
    from .solvers.path import ArcLength
    from .solvers.relaxation import Relaxation
else:
    __getattr__ = lazy(__name__)

# In a clone kernels and scenes are folders beside this one, in an installed package inside.
if not (Path(__file__).parent / "kernels").is_dir():
    __path__.append(str(Path(__file__).parents[1]))

__all__ = [
    "ArcLength",
    "ArrudaBoyce",
    "Bimodular",
    "BodyForce",
    "BodyPath",
    "BondAssociated",
    "BondBased",
    "BondNeoHookean",
    "BoundaryForce",
    "Box",
    "Built",
    "ByRegion",
    "Capsule",
    "Circle",
    "CriticalEnergy",
    "CriticalStretch",
    "Cylinder",
    "EnclosedGas",
    "EnclosedVolume",
    "Explicit",
    "Fixed",
    "Frame",
    "Frames",
    "Free",
    "Gent",
    "HyperelasticBonds",
    "Incompressible",
    "InputError",
    "Joint",
    "Material",
    "Maxwell",
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
    "Place",
    "Plane",
    "PointForce",
    "Polygon",
    "Pressure",
    "Prony",
    "Reaction",
    "Relaxation",
    "Result",
    "RigidBall",
    "RigidBody",
    "SavedFrame",
    "SelfContact",
    "Sheet",
    "Simulation",
    "Sphere",
    "Spline",
    "Surface",
    "TearingEnergy",
    "TensionField",
    "TriangleMesh",
    "ValuesInTime",
    "Visco",
    "ViscoBondBased",
    "Yeoh",
    "draw_sheet",
    "glued",
    "newton_bodies",
    "placed",
    "read_mesh",
    "read_outline",
    "together",
]
