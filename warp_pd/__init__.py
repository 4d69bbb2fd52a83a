"""Peridynamics of thin rubber sheets on NVIDIA Warp.

    from warp_pd import Sheet, Simulation, BondAssociated, NeoHookean, Explicit, Fixed, RigidBall, CriticalStretch

See README.md and the examples in `scenes/`, which are meant to be read and modified.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from . import contact as contact
from . import distributed as distributed
from . import fast as fast
from . import viewer as viewer
from .device.lazy import lazy
from .device.version import __version__ as __version__

if TYPE_CHECKING:
    from .bending.plate import Plate
    from .contact.body_mesh import TriangleMesh
    from .contact.body_motion import BodyPath
    from .contact.body_shapes import Box, Capsule, Cylinder, Plane, Sphere
    from .contact.free_body import Free
    from .contact.joint import Joint, Weld, pillow
    from .contact.newton_world import newton_bodies
    from .contact.rigid_body import RigidBall, RigidBody
    from .contact.self_contact import SelfContact
    from .device.checks import InputError
    from .gas.enclosed import EnclosedGas, EnclosedVolume
    from .implicit.steps import Implicit
    from .interfaces.frame import Frame, Surface
    from .laws.bond_associated import BondAssociated
    from .materials import (
        ArrudaBoyce,
        ByRegion,
        Carroll,
        ExtendedTube,
        Gent,
        Incompressible,
        Material,
        MooneyRivlin,
        NeoHookean,
        Ogden,
        PairwiseMaterial,
        TensionField,
        Yeoh,
    )
    from .output.frames import Frames, SavedFrame
    from .papers.bond_based import Bimodular, BondBased
    from .papers.boundary_force import BoundaryForce
    from .papers.critical_energy import CriticalEnergy
    from .papers.hyperelastic_bonds import BondNeoHookean, HyperelasticBonds
    from .papers.mirror import Mirror
    from .papers.neural.law import Neural
    from .papers.nodal import Nodal
    from .papers.visco_bonds import ViscoBondBased
    from .parts.loads import BodyForce, PointForce, Pressure, ValuesInTime
    from .parts.reaction import Reaction
    from .parts.rupture import CriticalStretch
    from .parts.supports import Fixed, Motion
    from .run.built import Built
    from .run.result import Result
    from .run.scene import Measure, Outcome
    from .run.simulation import Simulation
    from .shapes.curves import Circle, Polygon, Spline
    from .shapes.files import read_mesh
    from .shapes.pieces import Place
    from .shapes.sheet import Sheet
    from .shapes.svg import read_outline
    from .shapes.together import glued, placed, together
    from .solvers.explicit import Explicit
    from .statics.newton import Newton
    from .statics.path import ArcLength
    from .statics.relaxation import Relaxation
    from .tearing.cuts_in_time import CutsInTime, Punch, Seam, Slit
    from .tearing.family_criteria import CriticalEnergyDensity, CriticalStress
    from .tearing.tearing_energy import TearingEnergy
    from .viewer.shape_plot import draw_sheet
    from .visco.law import Maxwell, Prony, Visco
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
    "Carroll",
    "Circle",
    "CriticalEnergy",
    "CriticalEnergyDensity",
    "CriticalStress",
    "CriticalStretch",
    "CutsInTime",
    "Cylinder",
    "EnclosedGas",
    "EnclosedVolume",
    "Explicit",
    "ExtendedTube",
    "Fixed",
    "Frame",
    "Frames",
    "Free",
    "Gent",
    "HyperelasticBonds",
    "Implicit",
    "Incompressible",
    "InputError",
    "Joint",
    "Material",
    "Maxwell",
    "Measure",
    "Mirror",
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
    "Plate",
    "PointForce",
    "Polygon",
    "Pressure",
    "Prony",
    "Punch",
    "Reaction",
    "Relaxation",
    "Result",
    "RigidBall",
    "RigidBody",
    "SavedFrame",
    "Seam",
    "SelfContact",
    "Sheet",
    "Simulation",
    "Slit",
    "Sphere",
    "Spline",
    "Surface",
    "TearingEnergy",
    "TensionField",
    "TriangleMesh",
    "ValuesInTime",
    "Visco",
    "ViscoBondBased",
    "Weld",
    "Yeoh",
    "draw_sheet",
    "glued",
    "newton_bodies",
    "pillow",
    "placed",
    "read_mesh",
    "read_outline",
    "together",
]
