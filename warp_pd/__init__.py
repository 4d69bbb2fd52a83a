"""Peridynamics of thin rubber sheets on NVIDIA Warp.

    from warp_pd import Sheet, Simulation, BondAssociated, NeoHookean, Explicit, Fixed, RigidBall, CriticalStretch

See README.md and the examples in `scenes/`, which are meant to be read and modified.
"""

from typing import TYPE_CHECKING

from .device.lazy import lazy

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
    from .output.vtkhdf import read_frame, read_series
    from .parts.bodies import RigidBody
    from .parts.body_mesh import TriangleMesh
    from .parts.body_motion import BodyPath, Free
    from .parts.body_shapes import Box, Capsule, Cylinder, Plane, Sphere
    from .parts.boundary_force import BoundaryForce
    from .parts.contact import RigidBall
    from .parts.enclosed import EnclosedGas, EnclosedVolume
    from .parts.joint import Joint
    from .parts.loads import BodyForce, PointForce, Pressure
    from .parts.newton_world import newton_bodies
    from .parts.point_values import ValuesInTime
    from .parts.reaction import Reaction
    from .parts.rupture import CriticalEnergy, CriticalStretch
    from .parts.self_contact import SelfContact
    from .parts.supports import Fixed, Motion
    from .parts.tearing_energy import TearingEnergy
    from .run.built import Built
    from .run.result import Result
    from .run.scene import Measure, Outcome
    from .run.simulation import Simulation
    from .solvers.arc_length import ArcLength
    from .solvers.explicit import Explicit
    from .solvers.newton import Newton
    from .solvers.relaxation import Relaxation
else:
    __getattr__ = lazy(
        __name__,
        {
            "materials.bond_neo_hookean": "BondNeoHookean",
            "run.built": "Built",
            "device.checks": "InputError",
            "interfaces.frame": "Frame Surface",
            "laws.bond_associated": "BondAssociated",
            "laws.bond_based": "BondBased",
            "laws.hyperelastic_bonds": "HyperelasticBonds",
            "laws.neural.law": "Neural",
            "laws.nodal": "Nodal",
            "laws.visco": "Visco",
            "laws.visco_bonds": "ViscoBondBased",
            "materials": "ArrudaBoyce Bimodular ByRegion Gent Incompressible Material Maxwell MooneyRivlin NeoHookean "
            "Ogden PairwiseMaterial Prony TensionField Yeoh",
            "output.frames": "Frames SavedFrame",
            "output.sheet_plot": "draw_sheet",
            "output.vtkhdf": "read_frame read_series",
            "geometry.together": "glued placed together",
            "parts.bodies": "RigidBody",
            "parts.body_mesh": "TriangleMesh",
            "parts.body_motion": "BodyPath Free",
            "parts.body_shapes": "Box Capsule Cylinder Plane Sphere",
            "parts.boundary_force": "BoundaryForce",
            "parts.contact": "RigidBall",
            "parts.enclosed": "EnclosedGas EnclosedVolume",
            "parts.joint": "Joint",
            "parts.loads": "BodyForce PointForce Pressure",
            "parts.newton_world": "newton_bodies",
            "parts.point_values": "ValuesInTime",
            "parts.reaction": "Reaction",
            "parts.rupture": "CriticalEnergy CriticalStretch",
            "parts.self_contact": "SelfContact",
            "parts.supports": "Fixed Motion",
            "parts.tearing_energy": "TearingEnergy",
            "run.result": "Result",
            "run.scene": "Measure Outcome",
            "geometry.curves": "Circle Polygon Spline",
            "geometry.files": "read_mesh",
            "geometry.pieces": "Place",
            "geometry.svg": "read_outline",
            "geometry.sheet": "Sheet",
            "run.simulation": "Simulation",
            "solvers.arc_length": "ArcLength",
            "solvers.explicit": "Explicit",
            "solvers.newton": "Newton",
            "solvers.relaxation": "Relaxation",
        },
    )

__version__ = "0.1.0"

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
    "read_frame",
    "read_mesh",
    "read_outline",
    "read_series",
    "together",
]
